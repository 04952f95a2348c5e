"""Blind trials of ``diagnose``: recordings with a hidden effect, and a table of what was found.

    python -m analysis.campaign -o DIR [--cases 1] [--nulls 40] [--jobs 2] [--seed 0]

The recordings come from a simulator under ``tests/`` that shares no code with ``idm_sumo``; the finder is given the
file and nothing else. A finished case is kept as JSON in DIR/cases and not run again, so an interrupted campaign goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd

from .campaign_tables import summarise

LEVELS = ("small", "mid", "large")
SINGLE = (
    "reaction_delay", "multi_leader_anticipation", "lane_change_relaxation", "acceleration_asymmetry", "leader_class",
    "speed_dependent_headway", "perception_threshold", "hysteresis", "adjacent_lane_friction", "location", "time_of_day",
)  # fmt: skip
PAIRS = (("reaction_delay", "location"), ("leader_class", "time_of_day"), ("hysteresis", "adjacent_lane_friction"),
         ("lane_change_relaxation", "location"), ("perception_threshold", "time_of_day"))  # fmt: skip
NO_EFFECT = "none"


def trials(cases: int, nulls: int, seed: int) -> list[dict[str, Any]]:
    """Return what to plant, one dict a trial; the seed of each follows from its place in the list."""
    planned: list[dict[str, Any]] = [{"group": NO_EFFECT, "effect": None, "size": "mid"} for _ in range(nulls)]
    for _ in range(cases):
        planned += [{"group": "single", "effect": name, "size": size} for size in LEVELS[::-1] for name in SINGLE]
        planned += [{"group": "pair", "effect": list(pair), "size": "large"} for pair in PAIRS]
        planned += [{"group": "outside", "effect": name, "size": "large"} for name in _outside()]
        planned += [{"group": "some drivers", "effect": "reaction_delay", "size": "large", "share": 0.4},
                    {"group": "one lane", "effect": "location", "size": "large", "only_lane": 1}]  # fmt: skip
    return [{**trial, "seed": 1000 * (seed + 1) + number} for number, trial in enumerate(planned)]


def _outside() -> tuple[str, ...]:
    return _planting().OUTSIDE  # type: ignore[no-any-return]


def _planting() -> Any:
    try:
        from tests import planting
    except ImportError:
        sys.exit("analysis.campaign: tests/planting is not importable; run it from the root of a clone")
    return planting


def run_trial(trial: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Hide, write, find and keep: return the trial's record."""
    name = "+".join(trial["effect"]) if isinstance(trial["effect"], list) else trial["effect"] or NO_EFFECT
    kept = folder / f"{trial['seed']}-{name}-{trial['size']}.json"
    if kept.exists():
        return dict(json.loads(kept.read_text(encoding="utf-8")))
    planting = _planting()
    effect = tuple(trial["effect"]) if isinstance(trial["effect"], list) else trial["effect"]
    given = {key: trial[key] for key in ("share", "only_lane", "drivers") if key in trial}
    chosen = planting.plan(trial["seed"], effect=effect, size=trial["size"], **given)
    with tempfile.TemporaryDirectory() as scratch:
        file = planting.write(planting.simulate(chosen), Path(scratch) / "recording.parquet")
        begin = time.perf_counter()
        found = find(file, trial["seed"])
    record = {
        **trial, "name": name, "found": found, "seconds": time.perf_counter() - begin,
        "plan": {key: value for key, value in vars(chosen).items() if key != "effects"}, "effects": chosen.effects,
    }  # fmt: skip
    part = kept.with_suffix(".part")
    part.write_text(json.dumps(record, indent=1), encoding="utf-8")
    part.replace(kept)
    return record


def find(file: Path, seed: int) -> dict[str, Any]:
    """Diagnose a file; the content of ``diagnosis.json``."""
    from idm_sumo.cleaning import clean
    from idm_sumo.diagnosis.diagnose import diagnose
    from idm_sumo.reading import read_recording

    from .diagnosis_report import contract

    recording = clean(read_recording(file).recording).recording
    return dict(json.loads(json.dumps(contract(diagnose(recording, seed=seed)), default=_plain)))


def _plain(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def main(arguments: list[str] | None = None) -> None:
    """Run the campaign from the command line."""
    parser = argparse.ArgumentParser(prog="python -m analysis.campaign", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="tables, picture, cases/*.json")
    parser.add_argument("--cases", type=int, default=1, help="rounds of every effect and size (about 45 trials each)")
    parser.add_argument("--nulls", type=int, default=40, help="recordings with nothing planted")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--seed", type=int, default=0, help="other seeds, other recordings")
    parser.add_argument("--drivers", type=int, default=500, help="vehicles a recording")
    options = parser.parse_args(arguments)
    cases = options.output / "cases"
    cases.mkdir(parents=True, exist_ok=True)
    planned = [{**trial, "drivers": options.drivers} for trial in trials(options.cases, options.nulls, options.seed)]
    work = joblib.Parallel(n_jobs=options.jobs, return_as="generator_unordered")
    records = []
    for record in work(joblib.delayed(run_trial)(trial, cases) for trial in planned):
        records.append(record)
        names = "+".join(cause["name"] for cause in record["found"]["causes"])
        line = (
            f"[{len(records)}/{len(planned)}] {record['name']} {record['size']}: {record['found']['verdict']} {names}"
        )
        print(line, flush=True)
    summarise(pd.DataFrame(records), options.output)


if __name__ == "__main__":
    main()
