"""Blind trials of ``diagnose``: recordings with a hidden effect, and a table of what was found.

    python -m tests.simulators.campaign -o DIR [--cases 1] [--nulls 40] [--jobs 2] [--seed 0]
    python -m tests.simulators.campaign -o DIR --small        # four short recordings, to see that it works
    python -m tests.simulators.campaign -o DIR --simulator second     # a simulator of another author
    python -m tests.simulators.campaign -o DIR --cluster ADDRESS      # by dask workers that see the clone and DIR

The recordings come from simulators under ``tests/`` that share no code with ``idm_sumo`` or with each other; the finder
is given the file and nothing else. A finished case is kept as JSON in DIR/cases and not run again, so an interrupted
campaign goes on (after a change of the finder take another DIR). A case that fails does not stop the others; the
campaign then ends with 1.
Recordings with nothing planted alternate with the others, and the tables are written anew as cases finish.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.runtime.attempts import Failed
from idm_sumo.runtime.spread import spread
from tests.simulators import first
from tests.simulators.campaign import second
from tests.simulators.campaign.cases import keep_case, kept_case, plain, shown
from tests.simulators.campaign.tables import summarise

LEVELS = ("mid", "large", "small")
SINGLE = (
    "reaction_delay", "multi_leader_anticipation", "lane_change_relaxation", "acceleration_asymmetry", "leader_class",
    "speed_dependent_headway", "perception_threshold", "hysteresis", "adjacent_lane_friction", "location",
    "time_of_day",
)  # fmt: skip
CONTRARY = ("time_of_day", "speed_dependent_headway")  # that drifts all the time; that falls with speed
PAIRS = (("reaction_delay", "location"), ("leader_class", "time_of_day"), ("hysteresis", "adjacent_lane_friction"),
         ("lane_change_relaxation", "location"), ("perception_threshold", "time_of_day"))  # fmt: skip
# What nothing planted must not be taken for.
PLAIN: tuple[dict[str, Any], ...] = (
    {"kind": "white noise", "noise": "white"}, {"kind": "correlated noise", "noise": "correlated"},
    {"kind": "smoothed noise", "noise": "smoothed"}, {"kind": "heterogeneous drivers", "spread": 0.4},
    {"kind": "many trucks", "trucks": 0.15},
    {"kind": "many lane changes", "lane_changes": 2.5},
)  # fmt: skip
# SUMO's drivers change their headways at a place, where ours brake; and who has a truck ahead all along only has a long
# headway.
OF_SUMO: dict[str, dict[str, Any]] = {
    "location": {"form": "third"},
    "leader_class": {"trucks": 0.15, "lane_changes": 2.5},
}
IN_LANE = (("hysteresis", 1), ("reaction_delay", 0), ("adjacent_lane_friction", 2))  # beside a location
NO_EFFECT = "none"
WINDOW = 12.0  # s, of the rollouts whose gain is compared
GIVEN = (
    "share",
    "only_lane",
    "drivers",
    "minutes",
    "underlying",
    "density",
    "noise",
    "spread",
    "trucks",
    "lane_changes",
    "form",
)


def trials(cases: int, nulls: int, seed: int) -> list[dict[str, Any]]:
    """Return what to plant, one dict a trial.

    A trial's seed depends on its kind and number, not on how many there are.
    """
    of_sumo = itertools.cycle({"kind": "driven by SUMO", "underlying": model} for model in first.SUMO_MODELS)
    kinds = itertools.cycle([*PLAIN, {}])
    plain = [
        {"group": NO_EFFECT, "effect": None, "size": "mid", **(next(kinds) or next(of_sumo))} for _ in range(nulls)
    ]
    hidden: list[dict[str, Any]] = []
    for number in range(cases):
        models = np.roll(first.SUMO_MODELS, -number)  # every effect meets every model
        contrary = [{"group": "single", "effect": name, "size": size, "form": "third"}
                    for name in CONTRARY for size in LEVELS[:2]]  # fmt: skip
        contrary.append({"group": "outside", "effect": "throttle_wave", "size": "large", "form": "third"})
        hidden += [{"group": "single", "effect": name, "size": size} for size in LEVELS[:2] for name in SINGLE]
        hidden += [{"group": "pair", "effect": list(pair), "size": "large"} for pair in PAIRS]
        hidden += [{"group": "outside", "effect": name, "size": "large"} for name in first.OUTSIDE]
        hidden += [{"group": "some drivers", "effect": "reaction_delay", "size": "large", "share": 0.4},
                   {"group": "one lane", "effect": "location", "size": "large", "only_lane": 1}]  # fmt: skip
        hidden += [{"group": "single", "effect": name, "size": LEVELS[2]} for name in SINGLE]
        hidden += [{"group": "in SUMO", "effect": name, "size": "large", "underlying": str(model),
            **OF_SUMO.get(name, {})}
                   for name, model in zip(first.IN_SUMO, models, strict=True)]  # fmt: skip
        hidden += contrary
        hidden += [
            {"group": "one lane", "effect": name, "size": "large", "only_lane": lane, "form": "usual"}
            for name, lane in IN_LANE
        ]
    begin = 100_000 * (seed + 1)
    plain = [_conditions(trial, k, begin + k) for k, trial in enumerate(plain)]
    hidden = [_conditions(trial, k, begin + 10_000 + k) for k, trial in enumerate(hidden)]
    return [trial for two in itertools.zip_longest(plain, hidden) for trial in two if trial is not None]


def _conditions(trial: dict[str, Any], number: int, seed: int) -> dict[str, Any]:
    """Add the traffic's model by turns, light traffic and smoothed noise to some.

    The rest is drawn from the seed.
    """
    light = {"density": "light"} if number % 8 == 7 else {}
    smoothed = {"noise": "smoothed"} if number % 7 == 3 else {}
    return {"underlying": first.MODELS[number % len(first.MODELS)], **light, **smoothed, **trial, "seed": seed}


def few(seed: int) -> list[dict[str, Any]]:
    """Return four short trials."""
    planned = [trial for trial in trials(1, 2, seed) if trial["effect"] in (None, "reaction_delay", "location")]
    return [{**trial, "drivers": 200, "minutes": 4.0} for trial in planned[:4]]


def run_trial(trial: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Hide, write, find and keep: return the trial's record."""
    name = "+".join(trial["effect"]) if isinstance(trial["effect"], list) else trial["effect"] or NO_EFFECT
    kept = folder / f"{trial['seed']}-{name}-{trial['size']}.json"
    if (before := kept_case(kept, trial)) is not None:
        return before
    effect = tuple(trial["effect"]) if isinstance(trial["effect"], list) else trial["effect"]
    given = {key: trial[key] for key in GIVEN if key in trial}
    chosen = first.plan(trial["seed"], effect=effect, size=trial["size"], **given)
    ours = chosen.underlying in first.MODELS and not set(chosen.effects) & set(first.NOT_BEHAVIOUR)
    known = bool(chosen.effects) and ours
    planted = first.simulate(chosen, remember=known)
    record = {
        **trial, "name": name, **shown(find, lambda file: first.write(planted, file), trial["seed"]),
        "achievable": vars(first.achievable(planted, seconds=WINDOW)) if known else None,
        "plan": {key: value for key, value in vars(chosen).items() if key != "effects"}, "effects": chosen.effects,
    }  # fmt: skip
    return keep_case(kept, record)


def find(file: Path, seed: int) -> dict[str, Any]:
    """Diagnose a file; the content of ``diagnosis.json``."""
    from analysis.diagnosis.content import contract
    from idm_sumo.diagnosis.diagnose import diagnose
    from idm_sumo.recordings.cleaning import clean
    from idm_sumo.recordings.reading import read_recording

    recording = clean(read_recording(file, any_length=True))
    return dict(json.loads(json.dumps(contract(diagnose(recording, seed=seed)), default=plain)))


def main(arguments: list[str] | None = None) -> None:
    """Run the campaign from the command line."""
    options = _asked(arguments)
    cases = options.output.resolve() / "cases"
    cases.mkdir(parents=True, exist_ok=True)
    planned, run = _planned(options)
    records: list[dict[str, Any]] = []
    calls = [(trial, cases) for trial in planned]
    for done, (_, record) in enumerate(spread(run, calls, jobs=options.jobs, cluster=options.cluster), 1):
        if isinstance(record, Failed):
            print(f"[{done}/{len(planned)}] failed: {record.reason}", flush=True)
        else:
            records.append(record)
            print(f"[{done}/{len(planned)}] {_said(record)}", flush=True)
        if records and (done % 5 == 0 or done == len(planned)):
            summarise(pd.DataFrame(records), options.output)
    if len(records) < len(planned):
        sys.exit(1)


def _said(record: dict[str, Any]) -> str:
    found = record["found"]
    names = "+".join(cause["name"] for cause in found["causes"])
    return f"{record['name']} {record['size']}: {found['verdict']} {names}"


def _planned(options: argparse.Namespace) -> tuple[list[dict[str, Any]], Callable[..., dict[str, Any]]]:
    """Return the trials that the command line asks for, and what runs one of them."""
    if options.simulator == "second":
        return second.trials(options.cases, options.nulls, options.seed), run_second
    planned = few(options.seed) if options.small else trials(options.cases, options.nulls, options.seed)
    fixed = {
        "drivers": None if options.small else options.drivers,
        "underlying": options.underlying,
        "form": options.form,
    }
    given = {key: value for key, value in fixed.items() if value}
    if options.underlying:  # what SUMO drives is another question
        planned = [trial for trial in planned if trial["underlying"] in first.MODELS]
    return [{**trial, **given} for trial in planned], run_trial


def run_second(trial: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Run a trial of the second simulator."""
    return second.run_trial(trial, folder, find)


def _asked(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line's options; what the second simulator draws itself cannot be asked for."""
    parser = _parser()
    options = parser.parse_args(arguments)
    drawn = ("small", "underlying", "form", "drivers")
    if options.simulator == "second" and (asked := [f"--{name}" for name in drawn if getattr(options, name)]):
        parser.error(f"--simulator second draws its scenes from the seed: leave out {', '.join(asked)}")
    return options


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tests.simulators.campaign",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="tables, picture, cases/*.json")
    parser.add_argument("--cases", type=int, default=1, help="rounds of every effect and size (about 51 trials each)")
    parser.add_argument("--nulls", type=int, default=40, help="recordings with nothing planted")
    parser.add_argument(
        "--simulator", choices=("first", "second"), default="first",
        help="second draws from the seed what --small, --underlying, --form and --drivers would fix",
    )  # fmt: skip
    parser.add_argument("--small", action="store_true", help="four short recordings instead")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--cluster", metavar="ADDRESS", help="dask scheduler whose workers run the cases instead")
    parser.add_argument("--seed", type=int, default=0, help="other seeds, other recordings")
    parser.add_argument("--underlying", choices=first.MODELS, help="one car-following model (default: by turns)")
    parser.add_argument("--form", choices=first.FORMS, help="one form of the effects (default: drawn)")
    parser.add_argument("--drivers", type=int, help="vehicles a recording (default: 500)")
    return parser


if __name__ == "__main__":
    main()
