"""The commands and their options, spelled as in SUMO's tools."""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

import idm_sumo
from idm_sumo.cli import (
    closed_loop_commands,
    diagnosis_commands,
    driver_commands,
    export_command,
    irl_commands,
    recording_commands,
    report_command,
    study_commands,
)
from idm_sumo.cli.guard import BAD_INPUT, complain, say

DESCRIPTION = """\
Replay recorded traffic in SUMO, drive one vehicle at a time by a model,
and explain the difference.

typical order:
  idm-sumo inspect RECORDING --vehicles
      what is in the file, what became of each row, which vehicles there are
  idm-sumo calibrate RECORDING -o drivers.parquet
      five IDM parameters for every driver
  idm-sumo predict RECORDING --drivers drivers.parquet -o predicted.parquet
      the same parameters, from the first second of every driver
  idm-sumo replay RECORDING --vehicle 20 -o out/replay
      ten seconds of one driver, animated
  idm-sumo diagnose RECORDING -o out/diagnosis
      what the model gets wrong, and why
  idm-sumo export drivers.parquet -o drivers.rou.xml
      SUMO vehicle types that drive as calibrated
  idm-sumo reproduce --quick -o out/study
      the paper's tables and figures
  idm-sumo report out/study
      its page, in the browser

RECORDING is a file of trajectories (NGSIM text, portal CSV or Parquet,
leader-follower pairs, SUMO FCD), or the word `surrogate`: traffic simulated
with SUMO, made at first use and kept in the cache. It is not measured.
"""
SHELLS = ("bash", "zsh", "tcsh", "fish", "powershell")  # that shtab knows
EPILOG = """\
shell completion:
  idm-sumo --print-completion bash > ~/.local/share/bash-completion/completions/idm-sumo
  idm-sumo --print-completion zsh > "${fpath[1]}/_idm-sumo"

`idm-sumo COMMAND --help` tells what a command reads, what it leaves, and an example.
"""


class OneLineParser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong.

    It names what may have been meant, and exits with 2.
    """

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print help where it can be read, or say that it cannot; argparse would say nothing."""
        say(message.rstrip("\n"))  # errors come by :meth:`error`

    def error(self, message: str) -> NoReturn:
        """Exit with one line.

        Parameters
        ----------
        message : str
        """
        complain(f"{self.prog}: {message}; see `{self.prog} --help`")
        sys.exit(BAD_INPUT)

    def parse_known_args(self, args: Sequence[str] | None = None, namespace: Any = None) -> Any:  # type: ignore[override]
        """Parse, refusing mistyped options first.

        Otherwise a missing option would be asked for that is there, but mistyped.

        Parameters
        ----------
        args : sequence of str, optional
        namespace : argparse.Namespace, optional
        """
        given = list(sys.argv[1:] if args is None else args)
        if self._subparsers is None:
            self._refuse_unknown(given[: given.index("--")] if "--" in given else given)
        return super().parse_known_args(given, namespace)

    def _refuse_unknown(self, given: Iterable[str]) -> None:
        known = self._option_string_actions
        for option in (argument.partition("=")[0] for argument in given if argument.startswith("--")):
            if not any(name.startswith(option) for name in known):
                self.error(f"unrecognized option {option}{_meant(option, known)}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            names = [str(choice) for choice in action.choices]
            meant = _meant(str(value), names) or f"; choose from {', '.join(names)}"
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}{meant}")


def _meant(word: str, known: Iterable[str]) -> str:
    """Return a guess at a mistyped word, or nothing."""
    alike = difflib.get_close_matches(word, list(known), n=1)
    return f", did you mean {alike[0]}?" if alike else ""


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = OneLineParser(
        prog="idm-sumo", description=DESCRIPTION, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--version", action="version", version=f"idm-sumo {idm_sumo.__version__}")
    parser.add_argument(
        "--print-completion", action=_PrintCompletion, choices=SHELLS,
        help="print what makes a shell complete commands and options",
    )  # fmt: skip
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=OneLineParser)
    for module in (
        recording_commands,
        driver_commands,
        export_command,
        study_commands,
        closed_loop_commands,
        diagnosis_commands,
        irl_commands,
        report_command,
    ):
        module.add(commands)
    return parser


class _PrintCompletion(argparse.Action):
    """Print a shell's completion and exit; only then is shtab needed."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option_string: Any = None
    ) -> NoReturn:
        import shtab

        shtab.OPTION_END = (*shtab.OPTION_END, _PrintCompletion)  # type: ignore[assignment]  # nothing follows it
        _complete_paths(parser)
        say(shtab.complete(parser, values))
        sys.exit(0)


def _complete_paths(parser: argparse.ArgumentParser) -> None:
    """Let a shell complete files and folders."""
    import shtab

    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_paths(command)
        elif action.type is Path or action.dest in ("recording", "others"):
            action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE  # type: ignore[attr-defined]
