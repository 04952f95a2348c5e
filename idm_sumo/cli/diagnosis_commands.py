"""``diagnose``: what the simulation gets wrong, why, and what naming it buys."""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, study_module
from idm_sumo.runtime.memory import keep_freed_memory

ABOUT = """\
show what the IDM gets wrong in a recording, name the cause, extend the model and measure the gain

Every driver is simulated behind its recorded leader, window by window. What refitting its own parameters can absorb is
taken out first; what is left is held against a catalogue of causes (reaction delay, a second leader, lane changes,
trucks, places, times, ...). A cause is named only if the extended model is better for drivers that were never touched.

Before that the IDM is held against other car-following laws (full velocity difference, Krauss, Gipps, optimal
velocity, the improved IDM). If the drivers follow one of them clearly more likely, causes are what goes beyond that
one, and the model file holds it.

verdicts (exit code 0 for each):
  named     causes with size, place, p-value and their share of the gain
  none      nothing is there that these data could show; the report says which sizes would have been seen
  unknown   something is there that no cause of the catalogue explains; where, when and along what is said

DIR/diagnosis.json is for programs, DIR/report.html for people, DIR/model.json for
`idm-sumo replay|export|interactive --model`, DIR/drivers.parquet beside it for `interactive`: each driver's
parameters, refitted with the causes."""


def add(commands: Any) -> None:
    """Add the command of this module."""
    parser = shared.command(commands, "diagnose", diagnose, ABOUT.splitlines()[0],
                            "idm-sumo diagnose RECORDING -o out && open out/report.html")  # fmt: skip
    parser.description = ABOUT
    shared.recording_argument(parser)
    parser.set_defaults(jobs=None)
    shared.output_argument(
        parser,
        "DIR",
        "diagnosis.json, report.html, model.json, drivers.parquet, tables/, figures/, manifest.json go there",
    )


def diagnose(options: argparse.Namespace) -> None:
    """Diagnose a recording."""
    keep_freed_memory()
    module, words = study_module("diagnosis.report"), study_module("diagnosis.words")
    with progress_bar() as report:
        found = module.diagnose_file(
            options.recording, options.output, location=options.location, seed=options.seed,
            jobs=options.jobs or os.cpu_count() or 1,
            command=sys.argv, progress=report,
        )  # fmt: skip
    sentences = (
        words.headline(found), words.without_gain_sentence(found), words.gain_sentence(found.gain), words.law_sentence(found),
    )  # fmt: skip
    say(*filter(None, sentences))
    if found.verdict == "none" and found.power:
        say(*words.power_sentences(found))
    if options.verbose:
        for name, seconds in found.seconds.items():
            note(f"{name}: {seconds:.1f} s")
    say(f"open {options.output / 'report.html'}")
