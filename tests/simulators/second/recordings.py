"""From a case to a sound recording, and what is hidden in it."""

from typing import Any

from tests.simulators.second import cases, outside
from tests.simulators.second.checks import FEWEST_CHANGES, eagerness_missing, faults, summary

MOST_STRENGTH = 2.5  # times the usual strength; if that is too weak still, another scene is drawn
LOUDER = 0.7  # factor on the strength of an effect so large that anybody would find it
MOST_EAGER = 4.0  # m/s2, how far the braking accepted at lane changes is shifted at most


def make(seed: int, number: int, case: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Try until traffic is sound, lane changes frequent and an effect outside the catalogue strong enough.

    Returns the attempt and what is still wrong with it.
    """
    draw, strength, eager = 0, 1.0, 0.0
    for _ in range(cases.TRIES):
        got = cases.attempt(seed, number, case, draw, strength, eager)
        wrong = faults(got)
        missing = eagerness_missing(got)
        if case["kind"] == "outside" and got["rms"][0] < cases.LEAST_OUTSIDE:
            wrong.append("effect weak")
        if wrong == ["effect weak"] and strength < MOST_STRENGTH:
            strength *= min(1.6, 1.2 * cases.LEAST_OUTSIDE / max(got["rms"][0], 0.01))
        elif case["kind"] == "outside" and not wrong and got["rms"][0] > cases.MOST_OUTSIDE:
            strength *= LOUDER
        elif wrong or (summary(got)["lane_changes_per_vehicle"] < FEWEST_CHANGES and abs(eager) >= MOST_EAGER):
            draw, strength, eager = draw + 1, 1.0, 0.0
        elif missing and abs(eager) < MOST_EAGER:
            eager += missing
        else:
            break
    return got, wrong


def truth(number: int, case: dict[str, Any], got: dict[str, Any], wrong: list[str]) -> dict[str, Any]:
    """Return what is hidden in recording `number`, as it is written beside it."""
    planted = [cases.describe(e, rms) for e, rms in zip(got["hidden"], got["rms"][1:], strict=True)]
    outer = None
    if case["kind"] == "outside":
        idea = outside.IDEAS[outside.NAMES.index(case["names"][0])]
        outer = {"name": idea[0], "description": idea[1], "covariate": idea[2], "where": planted[0]["where"],
                 "parameters": planted[0]["parameters"]}  # fmt: skip
    scene = got["scene"]
    return {
        "file": f"{number:03d}.parquet", "kind": case["kind"], "planted": [] if outer else planted,
        "outside_catalogue": outer, "model": scene["law"],
        "effect_on_acceleration": {"rms": round(float(got["rms"][0]), 4) if got["hidden"] else 0.0},
        "noise": scene["noise"], "driver_noise": scene["driver_noise"], "recording": summary(got), "faults": wrong,
        "scene": {k: scene[k] for k in ("traffic", "means", "spread", "trucks", "motorcycles", "selection")},
    }  # fmt: skip
