"""How one blind trial is judged: what was named, how large, how much better, against what was hidden."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

RIGHT, WRONG, SILENT, UNKNOWN, FALSE_ALARM = "right", "wrong", "silent", "unknown", "false alarm"
RIGHT_AND_MORE = "right and more"  # a further cause was named that was not hidden
# Where an effect outside the catalogue must show: covariates (their beginnings), or its planted place or time.
SHOWS_IN: dict[str, tuple[str, ...]] = {
    "distraction": ("place", "leader_acceleration"),
    "throttle_wave": ("oscillation",),
    "lane_enforcement": ("lane", "time"),
    "beside_truck": ("trucks_beside",),
    "late_for_a_while": ("time",),
    "brake_lights_across": ("braking_beside",),
    "weariness": ("unrest", "since_braking"),
    # Those of the second simulator.
    "late_beside_accident": ("place",),
    "slow_start": ("since_standing",),
    "motorcycle_beside": ("motorcycles_beside",),
    "brake_lights": ("leader_acceleration",),
    "attention_cycle": ("oscillation",),
    "tired_in_section": ("since_entry", "position"),
    "long_car_ahead": ("leader_length",),
    "drawn_along": ("faster_difference", "adjacent_difference"),
    "staggering": ("nearest_beside", "abreast", "beside_gap"),
    "pedal_dead_zone": ("response",),
    "shower": ("place", "time"),
    "shaken": ("since_braking", "unrest"),
    "closes_the_door": ("beside_gap",),
    "glare": ("place", "time"),
}
# m behind a truck that a planted share of 1 stands for, where metres are kept: with the middle headway; and in the
# second simulator.
TRUCK_DISTANCE, TRUCK_DISTANCE_ELSEWHERE = 9.0 * 1.25, 15.0
GAIN_BOUNDS = (0.05, 0.02)  # of ADE
GAIN_CLASSES = ("5 % or more", "2 to 5 %", "below 2 %")
SIZED = ["name", "form", "underlying", "planted", "estimate", "low", "high", "error", "covered", "seed"]
SOME = "some drivers"
SIZED_GROUPS = ("single", "pair", "one lane", "in SUMO", SOME)
SIGMA_CLASSES = ("0.1-0.2 m", "0.2-0.35 m", "0.35-0.5 m")


def scored(trials: pd.DataFrame) -> pd.DataFrame:
    """Return one row a trial: its conditions, what was said, and the grades."""
    return pd.DataFrame([_row(trial) for trial in trials.to_dict("records")])


def _row(trial: dict[str, Any]) -> dict[str, Any]:
    found, plan = trial["found"], trial["plan"]
    gain, best = found["gain"], trial.get("achievable")
    sure = gain is not None and gain["base"] > 0
    names = [cause["name"] for cause in found["causes"]]
    return {
        "group": trial["group"], "name": trial["name"], "size": trial["size"], "kind": trial.get("kind", ""),
        "outcome": outcome(trial), "verdict": found["verdict"], "named": ", ".join(names),
        "first": names[0] if names else found["verdict"], "best_gain": _share(best), **_present(trial),
        "gain_class": gain_class(_share(best)), "lesser_class": gain_class(_lesser_share(best)),
        "gain": gain["difference"] / gain["base"] if sure else math.nan,
        "realised": gain["difference"] / (best["base"] - best["extended"])
        if best and sure and names and best["base"] > 1.02 * best["extended"] else math.nan,
        "law": found.get("law"), **{key: plan[key] for key in ("underlying", "noise", "form", "density", "lanes")},
        "sigma": sigma_class(plan["sigma"]), "sigma_m": plan["sigma"], "seed": trial["seed"],
        "seconds": trial["seconds"],
    }  # fmt: skip


def _present(trial: Mapping[str, Any]) -> dict[str, int]:
    """Return how many hidden effects are not named, present without gain, and not hidden."""
    hidden, found = set(trial["effects"]), trial["found"]
    missed = hidden - {cause["name"] for cause in found["causes"]}
    present = {cause["name"] for cause in found.get("without_gain", [])}  # of an older campaign not known
    return {"missed": len(missed), "missed_present": len(missed & present), "present_not_hidden": len(present - hidden)}


def outcome(trial: Mapping[str, Any]) -> str:
    """Return right (the right cause first), wrong, silent, unknown; for nulls silent or false alarm.

    Pairs are right if both are named, else ``one of two``; ``right and more`` names a further cause that was not
    hidden. An effect in one lane only is right if it is named there, else ``all lanes``.
    An effect outside the catalogue is right as ``unknown`` where it shows, ``unknown, elsewhere`` otherwise.
    """
    found, hidden = trial["found"], list(trial["effects"])
    names = [cause["name"] for cause in found["causes"]]
    if trial["group"] == "outside":
        if names:
            return WRONG
        if found["verdict"] != UNKNOWN:
            return SILENT
        return RIGHT if shows(trial) else "unknown, elsewhere"
    if not hidden:
        return SILENT if found["verdict"] == "none" else FALSE_ALARM
    if not names:
        return UNKNOWN if found["verdict"] == UNKNOWN else SILENT
    if names[0] not in hidden:
        return WRONG
    if trial["group"] == "one lane" and _lanes(found["causes"][0]) != [trial["plan"]["only_lane"] + 1]:
        return "all lanes"
    if set(hidden) - set(names):
        return "one of two"
    return RIGHT_AND_MORE if set(names) - set(hidden) else RIGHT


def _lanes(cause: Mapping[str, Any]) -> list[int]:
    """Return the lanes to which a cause is confined, from 1; empty for all."""
    return list((cause.get("where") or {}).get("lanes") or [])


def shows(trial: Mapping[str, Any]) -> bool:
    """Return whether what is unexplained lies where the effect acts: its covariate, its place or its time."""
    plan = trial["plan"]
    for one in trial["found"]["unexplained"]:
        for key in SHOWS_IN.get(trial["name"], ()):
            if key == "place" and "position" in one["covariate"] and _meet(one["position_m"], plan["place"]):
                return True
            if key == "time" and "time" in one["covariate"] and _meet(one["time_s"], plan["time"]):
                return True
            if key not in ("place", "time") and key in one["covariate"]:
                return True
    return False


def sized(trials: pd.DataFrame) -> pd.DataFrame:
    """Return planted and found size of every hidden effect that was named.

    Also whether the 95 % interval holds the planted one.

    Of effects that some drivers have only, those are left out that were found of all: there the size of all drivers is
    another.
    """
    chosen = (trial for trial in trials.to_dict("records") if trial["group"] in SIZED_GROUPS)
    return pd.DataFrame([row for trial in chosen for row in _sizes(trial)], columns=SIZED)


def _sizes(trial: dict[str, Any]) -> Iterator[dict[str, Any]]:
    for cause in trial["found"]["causes"]:
        if cause["name"] in trial["effects"] and (trial["group"] != SOME or "share" in cause["parameters"]):
            truth, form = abs(trial["effects"][cause["name"]]), trial["plan"]["form"]
            if "ell" in cause["parameters"]:  # a share of the headway is more or less metres, by the speed
                form = "other"
                truth *= TRUCK_DISTANCE_ELSEWHERE if "truth" in trial else TRUCK_DISTANCE
            one = next(iter(cause["parameters"].values()))  # the size comes first
            low, high = sorted(abs(bound) for bound in one["ci95"])
            low = 0.0 if one["ci95"][0] < 0.0 < one["ci95"][1] else low
            yield {
                "name": cause["name"], "form": form, "underlying": trial["plan"]["underlying"],
                "planted": truth, "estimate": abs(one["value"]), "low": low, "high": high,
                "error": abs(abs(one["value"]) / truth - 1), "covered": low <= truth <= high, "seed": trial["seed"],
            }  # fmt: skip


def gain_class(share: float) -> str:
    """Return the class of what the true model could gain."""
    if math.isnan(share):
        return ""
    return GAIN_CLASSES[sum(share < bound for bound in GAIN_BOUNDS)]


def sigma_class(sigma: float) -> str:
    """Return the class of a measurement noise (m)."""
    return SIGMA_CLASSES[0] if sigma < 0.2 else SIGMA_CLASSES[1] if sigma < 0.35 else SIGMA_CLASSES[2]


def _share(best: Mapping[str, float] | None) -> float:
    return (best["base"] - best["extended"]) / best["base"] if best else math.nan


def _lesser_share(best: Mapping[str, Any] | None) -> float:
    """Return what the lesser of several effects is worth beside the others, as a share of the error."""
    without = best.get("without") if best else None
    return min(1 - best["extended"] / one for one in without) if best and without else math.nan


def _meet(one: Any, other: Any) -> bool:
    """Whether two ranges overlap by a third of the shorter."""
    if one is None or other is None:
        return False
    both = min(one[1], other[1]) - max(one[0], other[0])
    return bool(both > min(one[1] - one[0], other[1] - other[0]) / 3)
