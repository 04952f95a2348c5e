"""``replay`` and ``reproduce``: the study itself."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import note, progress_bar, say, study_module, text_table

SHOWN = ["method", "ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"]


def add(commands: Any) -> None:
    """Add the commands of this module."""
    parser = shared.command(commands, "replay", replay, "drive one recorded vehicle by the model, in its recorded traffic",
                            "idm-sumo replay RECORDING --vehicle 515 -o out && open out/replay.gif")  # fmt: skip
    shared.recording_argument(parser)
    parser.add_argument("--vehicle", type=int, required=True, metavar="ID")
    shared.window_arguments(parser)
    parser.add_argument(
        "--backend", choices=("sumo", "kernel"), default="sumo", help="what carries the traffic (default sumo)"
    )
    parser.add_argument("--drivers", type=Path, metavar="FILE",
                        help="parameters from `calibrate` or `predict`; by default this driver's own fit (oracle)")  # fmt: skip
    parser.add_argument("--model", type=Path, metavar="FILE",
                        help="extended model of `diagnose` (model.json), driven beside the plain one")  # fmt: skip
    shared.output_argument(parser, "DIR", "trajectory, picture, animation and scores go there")

    parser = shared.command(commands, "reproduce", reproduce, "the paper's tables and figures, with report and manifest",
                            "idm-sumo reproduce -c runs/paper.toml -o out")  # fmt: skip
    shared.recording_argument(parser, nargs="*")
    parser.add_argument(
        "-c",
        "--configuration-file",
        type=Path,
        metavar="RUN.toml",
        help="a named run (default, without RECORDING: the paper's)",
    )
    shared.output_argument(parser, "DIR", "tables/, figures/, report.html, manifest.json go there")
    parser.add_argument(
        "--quick", action="store_true", help="fewer drivers and a shorter built-in recording: seconds, not minutes"
    )
    parser.add_argument(
        "--train", action="append", metavar="PERIOD", help="training period; may be repeated (default: the first)"
    )
    parser.add_argument(
        "--test", action="append", metavar="PERIOD", help="test period; may be repeated (default: all later ones)"
    )
    parser.add_argument(
        "--rollout-start", choices=("observed", "entry"), help="simulate from the last observed frame, or from entry"
    )
    parser.add_argument("--neighbours", type=int, metavar="K")
    parser.add_argument("--desired-speed", type=float, metavar="M_S", help="v0 (default: the speed limit)")
    parser.add_argument("--backend", choices=("sumo", "kernel"), help="what drives the table of methods (default sumo)")
    learner = parser.add_mutually_exclusive_group()
    learner.add_argument("--agents", type=Path, metavar="DIR",
                         help="drive by the agents of `irl train` there (default: train them, kept in the user's cache)")  # fmt: skip
    learner.add_argument("--no-agents", action="store_true", help="leave the learned agents and clones out")
    parser.set_defaults(seed=None)


def replay(options: argparse.Namespace) -> None:
    """Replay one vehicle."""
    module = study_module("replay.run")
    request = module.Request(
        options.recording, options.vehicle, tuple(options.period or ()), shared.window_of(options), options.backend,
        options.drivers, options.desired_speed, options.seed, options.model,
    )  # fmt: skip
    recording = shared.load(options)
    with progress_bar() as report:
        scores = module.replay_one(recording, request, options.output, command=sys.argv, progress=report)
    say(text_table(scores), f"wrote {options.output}")


def reproduce(options: argparse.Namespace) -> None:
    """Run the study."""
    settings_module, module = study_module("reproduce.settings"), study_module("reproduce.run")
    overrides = {
        "recordings": tuple(str(path) for path in options.recording) or None,
        "train": options.train, "test": options.test, "rollout_start": options.rollout_start,
        "neighbours": options.neighbours, "desired_speed": options.desired_speed, "backend": options.backend,
        "seed": options.seed, "agent": str(options.agents) if options.agents else None,
        "agent_seeds": 0 if options.no_agents else None,
    }  # fmt: skip
    run = options.configuration_file or (None if options.recording else settings_module.DEFAULT_RUN)
    settings = settings_module.load_settings(run, overrides)
    if options.quick:
        settings = module.quick(settings)
    with progress_bar() as report:
        table = module.reproduce(settings, options.output, command=sys.argv, jobs=options.jobs, progress=report)
    if not options.no_agents and (missing := study_module("reproduce.agents.rows").missing_row(table)):
        note(missing)
    say(text_table(table[SHOWN]), f"open {options.output / 'report.html'}")
