"""Blind trials of the second simulator, :mod:`tests.simulators.second`, as records that the campaign's tables count."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.simulators import second
from tests.simulators.campaign.cases import Find, keep_case, kept_case, shown

# What it calls its kinds of cases, how many there are a round, and the campaign's groups.
GROUPS = {"single": ("single", 15), "pair": ("pair", 5), "outside": ("outside", 14),
    "some_drivers": ("some drivers", 2),
          "one_lane": ("one lane", 2)}  # fmt: skip
NOTHING = "none"
# Braking or accelerating there, where the catalogue's form changes the headway; of the follower's pressure it has a
# size of its own.
OTHER_UNITS = ("courtesy_yielding", "pre_insertion", "desired_speed", "follower_pressure")


def trials(cases: int, nulls: int, seed: int) -> list[dict[str, Any]]:
    """Return what to hide, one dict a trial, in the order of the recordings, which says nothing."""
    counts = {"null": nulls, **{kind: cases * each for kind, (_, each) in GROUPS.items()}}
    groups = {"null": NOTHING, **{kind: group for kind, (group, _) in GROUPS.items()}}
    return [
        {"group": groups[case["kind"]], "seed": seed, "number": number, "case": case}
        for number, case in enumerate(second.plan(seed, counts), 1)
    ]


def run_trial(trial: dict[str, Any], folder: Path, find: Find) -> dict[str, Any]:
    """Simulate, write, find and keep; return the trial's record.

    ``find`` is given the file and a seed, and nothing else.
    """
    kept = folder / f"{trial['seed']}-{trial['number']:03d}.json"
    if (before := kept_case(kept, trial)) is not None:
        return before
    got, faults = second.make(trial["seed"], trial["number"], trial["case"])
    hidden = second.truth(trial["number"], trial["case"], got, faults)
    seen = shown(find, lambda file: got["table"].to_parquet(file, index=False), trial["seed"])
    best = second.worth(got, trial["seed"]) if got["hidden"] else None
    return keep_case(kept, {**trial, **_described(hidden), **seen, "achievable": best, "truth": hidden})


def _described(truth: dict[str, Any]) -> dict[str, Any]:
    """Return what is hidden in the campaign's words."""
    planted, outer = truth["planted"], truth["outside_catalogue"]
    usual = all(one["usual_form"] and one["name"] not in OTHER_UNITS for one in planted)
    effects = {one["name"]: next(iter(one["parameters"].values())) for one in planted}
    if outer:
        effects = {outer["name"]: next(iter(outer["parameters"].values()))}
    where = [one["where"] or {} for one in [*planted, *([outer] if outer else [])]]
    recording = truth["recording"]
    return {
        "name": "+".join(effects) or NOTHING, "effects": effects, "size": planted[0]["size"] if planted else "large",
        "plan": {
            "underlying": truth["model"], "noise": truth["noise"]["kind"], "sigma": truth["noise"]["sigma_m"],
            "form": "usual" if usual else "other", "density": truth["scene"]["traffic"], "lanes": recording["lanes"],
            "only_lane": next((one["lane"] for one in where if "lane" in one), 0) - 1,
            "place": _range(where, "position_m", recording["section_m"]),
            "time": _range(where, "time_s", recording["seconds"]),
        },
    }  # fmt: skip


def _range(where: list[dict[str, Any]], key: str, whole: float) -> list[float]:
    """Return the place (m) or time (s) to which something is confined, or all of it."""
    return next((sorted(one[key]) for one in where if key in one), [0.0, whole])
