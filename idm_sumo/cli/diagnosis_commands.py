"""``diagnose``: what the simulation gets wrong, and why."""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any

from idm_sumo.cli import many, outputs
from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, study_module
from idm_sumo.runtime import limits
from idm_sumo.runtime.memory import keep_freed_memory

ABOUT = f"""\
name what the IDM gets wrong in a recording, and measure the gain

Every driver is simulated behind its recorded leader, window by window. What
refitting its own parameters can absorb is taken out first; what is left is held
against a catalogue of causes (reaction delay, a second leader, lane changes,
trucks, places, times, ...). A cause is named if it is likely at its size and
makes the simulation better for the drivers that it was fitted to. What all
causes gain together is measured on a quarter of the drivers, set aside before.

Before that the IDM is held against other car-following laws (full velocity
difference, Krauss, Gipps, optimal velocity, the improved IDM). If the drivers
follow one of them clearly more likely, causes are what goes beyond that one,
and the model file holds it.

verdicts (exit code 0 for each):
  named     causes with size, place, p-value and their share of the gain
  none      nothing is there that these data could show; the report says which
            sizes would have been seen
  unknown   something is there that no cause of the catalogue explains; where,
            when and along what is said

{many.ABOUT}
A recording's folder then holds _diagnosis.json, _model.json and a plain page;
DIR/_report.html lists them all, with what they say together.

reads   RECORDING ...
leaves  DIR/report.html for people, diagnosis.json for programs, tables/,
        figures/, manifest.json, model.json, the extended model, and
        drivers.parquet, each driver refitted with the causes; replays/, three
        held-out drivers by the base and the extended model, if a cause is named
next    open DIR/report.html; idm-sumo replay RECORDING --vehicle ID --model
        DIR/model.json -o out, and `export` and `interactive` with --model"""


def add(commands: Any) -> None:
    """Add the command of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    parser = shared.command(
        commands, "diagnose", diagnose, ABOUT, "idm-sumo diagnose RECORDING -o out/diagnosis", jobs=None
    )
    many.add_arguments(parser)
    parser.add_argument(
        "--injections",
        type=shared.whole(limits.INJECTIONS),
        default=0,
        metavar="N",
        help="inject each effect N times, at three sizes, into the recording's own followers, and say in how many it "
        "stands out (default: 0)",
    )
    shared.output_argument(
        parser,
        "DIR",
        "diagnosis.json, report.html, model.json, drivers.parquet, tables/, figures/, manifest.json go there",
    )
    outputs.declare(parser, "recording", many=True)


def diagnose(options: argparse.Namespace) -> None:
    """Diagnose a recording.

    Parameters
    ----------
    options : argparse.Namespace
    """
    keep_freed_memory()
    if many.are_meant(options):
        many.run(options, study_module("many.work").Diagnose(options.seed, options.injections))
        return
    (options.recording,) = options.recording
    module, words = study_module("diagnosis.report"), study_module("diagnosis.words")
    first = study_module("diagnosis.answer")
    with progress_bar(module.STAGES) as report:
        found = module.diagnose_file(
            shared.recording_path(options),
            options.output,
            location=options.location,
            seed=options.seed,
            jobs=options.jobs or os.cpu_count() or 1,
            command=sys.argv,
            injections=options.injections,
            progress=report,
        )
    say(*filter(None, (*first.spoken(found), words.law_sentence(found))))
    say(*words.detectable_sentences(found))
    if found.verdict == "none" and not found.detectable:
        note("--injections 10 shows which sizes of each effect would have been found in these drivers")
    if options.verbose:
        for name, seconds in found.seconds.items():
            note(f"{name}: {seconds:.1f} s")
    say(f"open {options.output / 'report.html'}")
    shared.note_origin_of(options.output)
