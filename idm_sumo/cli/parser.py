"""The commands and their options. Spelled as SUMO's tools spell theirs."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

import idm_sumo
from idm_sumo.cli import (
    closed_loop_commands,
    diagnosis_commands,
    driver_commands,
    irl_commands,
    recording_commands,
    study_commands,
)

DESCRIPTION = """\
Replay recorded traffic in SUMO, drive one vehicle at a time by a model, and explain the difference.

typical order:
  idm-sumo inspect RECORDING                          what is in the file, and what became of each row
  idm-sumo calibrate RECORDING -o drivers.parquet     five IDM parameters for every driver
  idm-sumo predict RECORDING --drivers drivers.parquet -o predicted.parquet
  idm-sumo replay RECORDING --vehicle 515 -o out      ten seconds of one driver, animated
  idm-sumo diagnose RECORDING -o out                  what the model gets wrong, and why
  idm-sumo reproduce -o out                           the paper's tables and figures, on the built-in recording

RECORDING is NGSIM (official text, portal CSV, Parquet with those names) or SUMO FCD (XML, Parquet).
"""


class OneLineParser(argparse.ArgumentParser):
    """A parser that says what is wrong in one line and exits with 2."""

    def error(self, message: str) -> NoReturn:
        """Exit with one line."""
        print(f"{self.prog}: {message}; see `{self.prog} --help`", file=sys.stderr)
        sys.exit(2)


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = OneLineParser(
        prog="idm-sumo", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"idm-sumo {idm_sumo.__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=OneLineParser)
    for module in (
        recording_commands,
        driver_commands,
        study_commands,
        closed_loop_commands,
        diagnosis_commands,
        irl_commands,
    ):
        module.add(commands)
    return parser
