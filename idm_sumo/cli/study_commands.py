"""``replay`` and ``reproduce``: the study itself."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli import outputs
from idm_sumo.cli.console import note, progress_bar, say, study_module, text_table
from idm_sumo.runtime import limits
from idm_sumo.runtime.places import refuse_overlap
from idm_sumo.sumo.surrogate import SURROGATE

SHOWN = ["method", "ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions", "vehicles"]


REPLAY = """\
drive one recorded vehicle by the model, in its recorded traffic

All other vehicles drive as recorded; this one follows its leader by the IDM
from its last observed frame on.

reads   RECORDING; with --drivers its parameters, without them it is calibrated
leaves  DIR/replay.html (plays it), trajectory.parquet (the last model beside
        recorded, frame by frame), scores.csv, time_space.png, replay.gif,
        manifest.json
next    open DIR/replay.html; idm-sumo diagnose RECORDING -o out says why the
        two part"""
REPRODUCE = """\
the paper's tables and figures, with report and manifest

reads   RECORDING ..., by default the built-in recording with the settings of
        runs/paper.toml
leaves  DIR/report.html, tables/ (methods.csv is the paper's main table),
        figures/, manifest.json
next    open DIR/report.html"""


def add(commands: Any) -> None:
    """Add the commands of this module.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    _add_replay(commands)
    _add_reproduce(commands)


def _add_replay(commands: Any) -> None:
    parser = shared.command(commands, "replay", replay, REPLAY, "idm-sumo replay RECORDING --vehicle 20 -o out/replay")
    shared.recording_argument(parser)
    parser.add_argument(
        "--vehicle",
        type=shared.whole(limits.VEHICLE),
        required=True,
        metavar="ID",
        help="its number; `idm-sumo inspect RECORDING --vehicles` lists them",
    )
    shared.window_arguments(parser)
    parser.add_argument("--desired-speed", type=shared.real(limits.DESIRED_SPEED), metavar="V",
                        help="v0 in m/s (default: that of --drivers, else the speed limit of the "
                             "recorded road)")  # fmt: skip
    parser.add_argument(
        "--backend", choices=("sumo", "kernel"), default="sumo", help="what carries the traffic (default sumo)"
    )
    parser.add_argument(
        "--drivers",
        type=shared.path,
        action="append",
        metavar="FILE",
        help="parameters from `calibrate` or `predict`; may be repeated, each is driven beside the others "
        "(default: this driver's own fit)",
    )
    parser.add_argument(
        "--model",
        type=shared.path,
        metavar="FILE",
        help="extended model of `diagnose` (model.json), driven beside the plain one",
    )
    shared.output_argument(parser, "DIR", "trajectory, picture, animation and scores go there")
    outputs.declare(parser, "recording", "drivers", "model")


def _add_reproduce(commands: Any) -> None:
    parser = shared.command(
        commands, "reproduce", reproduce, REPRODUCE, "idm-sumo reproduce RECORDING --quick --no-agents -o out/study"
    )
    parser.add_argument(
        "recording", type=shared.recording_name, metavar="RECORDING", nargs="*", help=shared.RECORDING_HELP
    )
    parser.add_argument(
        "-c",
        "--configuration-file",
        type=shared.path,
        metavar="RUN.toml",
        help="a named run (default, without RECORDING: the paper's)",
    )
    shared.output_argument(parser, "DIR", "tables/, figures/, report.html, manifest.json go there")
    outputs.declare(parser, "recording", "configuration_file", "agents")
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
    parser.add_argument(
        "--neighbours",
        type=shared.whole(limits.NEIGHBOURS),
        metavar="K",
        help="drivers that a prediction averages (default 8)",
    )
    parser.add_argument(
        "--code-speed",
        choices=("own", "relative"),
        help="what the driving code's nu is: the driver's own mean speed (default), or that relative to the leader",
    )
    parser.add_argument(
        "--desired-speed",
        type=shared.real(limits.DESIRED_SPEED),
        metavar="V",
        help="v0 in m/s (default: the speed limit)",
    )
    parser.add_argument("--backend", choices=("sumo", "kernel"), help="what drives the table of methods (default sumo)")
    learner = parser.add_mutually_exclusive_group()
    learner.add_argument(
        "--agents",
        type=shared.path,
        metavar="DIR",
        help="drive by the agents of `irl train` there (default: train them, kept in the user's cache)",
    )
    learner.add_argument("--no-agents", action="store_true", help="leave the learned agents and clones out")
    shared.cluster_argument(parser, "train the agents")
    parser.set_defaults(seed=None)


def replay(options: argparse.Namespace) -> None:
    """Replay one vehicle.

    Parameters
    ----------
    options : argparse.Namespace
    """
    module = study_module("replay.run")
    request = module.Request(
        shared.recording_path(options),
        options.vehicle,
        tuple(options.period or ()),
        shared.window_of(options),
        options.backend,
        tuple(options.drivers or ()),
        options.desired_speed,
        options.seed,
        options.model,
    )
    recording = shared.load(options)
    with progress_bar() as report:
        scores = module.replay_one(recording, request, options.output, command=sys.argv, progress=report)
    say(text_table(scores), f"wrote {options.output}")
    shared.note_origin(recording.notes)


def reproduce(options: argparse.Namespace) -> None:
    """Run the study.

    Parameters
    ----------
    options : argparse.Namespace
    """
    settings_module, module = study_module("reproduce.settings"), study_module("reproduce.run")
    named = options.recording and options.recording != [SURROGATE]
    overrides = {
        "recordings": tuple(options.recording) if named else None,
        "train": options.train,
        "test": options.test,
        "rollout_start": options.rollout_start,
        "neighbours": options.neighbours,
        "code_speed": options.code_speed,
        "desired_speed": options.desired_speed,
        "backend": options.backend,
        "seed": options.seed,
        "agent": str(options.agents) if options.agents else None,
        "agent_seeds": 0 if options.no_agents else None,
    }
    run = options.configuration_file or (None if named else settings_module.DEFAULT_RUN)
    settings = settings_module.load_settings(run, overrides)
    if options.quick:
        settings = module.quick(settings)
    refuse_overlap(settings.recordings, [options.output])  # those that a run file names, too
    cluster = shared.cluster_of(options)
    with progress_bar(module.stages(settings)) as report:
        table = module.reproduce(
            settings, options.output, command=sys.argv, jobs=options.jobs, cluster=cluster, progress=report
        )
    if not options.no_agents and (missing := study_module("reproduce.agents.rows").missing_row(table)):
        note(missing)
    say(text_table(table[SHOWN]), f"open {options.output / 'report.html'}")
    shared.note_origin_of(options.output)
