"""The median driver with one cause and without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from idm_sumo.models.effects import NO_STIMULI, Cause, ExtendedModel, Stimuli, extended_acceleration
from idm_sumo.models.effects.reaction_delay import acted_on
from idm_sumo.recordings.columns import FRAME_STEP

Floats = npt.NDArray[np.float64]

NEAREST, FARTHEST = 0.5, 500.0  # m: gaps searched for the one that is kept
LEVEL, SLOPE = 12.0, 6.0  # s that the leader keeps a speed, and takes to change it
AHEAD = 1.0  # s by which the second leader is earlier
RECENT = 3.0  # s over which the leader's acceleration is averaged


def with_only(model: ExtendedModel, cause: Cause | None) -> ExtendedModel:
    """Return a model with one cause for all drivers.

    Parameters
    ----------
    model : ExtendedModel
        Whose law and median driver are kept.
    cause : Cause or None
        None for no cause at all.

    Returns
    -------
    ExtendedModel
        For comparison with the model without causes.
    """
    return replace(model, causes=() if cause is None else (replace(cause, share=1.0, lanes=()),))


def stimuli(known: Mapping[str, float]) -> Stimuli:
    """Return stimuli of which only some are known.

    Parameters
    ----------
    known : mapping of str to float
        Fields of Stimuli.

    Returns
    -------
    Stimuli
        All others NaN.
    """
    return NO_STIMULI._replace(**known)


def kept_gaps(model: ExtendedModel, speeds: Floats, around: Stimuli) -> Floats:
    """Return the median driver's gaps at steady speeds.

    Parameters
    ----------
    model : ExtendedModel
        With or without a cause.
    speeds : float64, shape (n,)
        Of driver and leader (m/s).
    around : Stimuli
        What the driver reacts to beside them.

    Returns
    -------
    float64, shape (n,)
        Gaps (m) at which it neither accelerates nor brakes; NaN where there is none.
    """
    own, m = np.asarray(model.parameters), model.magnitudes()

    def pulled(gap: float, speed: float) -> float:
        seen = around._replace(second_gap=2.0 * gap, second_speed=speed)
        return float(extended_acceleration(speed, 0.0, gap, seen, own, model.desired_speed, m))

    return np.array([
        brentq(pulled, NEAREST, FARTHEST, args=(v,)) if pulled(NEAREST, v) < 0.0 < pulled(FARTHEST, v) else np.nan
        for v in speeds
    ])  # fmt: skip


def through_a_wave(model: ExtendedModel, slow: float, fast: float, around: Stimuli) -> tuple[Floats, Floats]:
    """Drive the median driver through a wave of its leader.

    Parameters
    ----------
    model : ExtendedModel
        With or without a cause.
    slow, fast : float
        Speeds of the leader (m/s).
    around : Stimuli
        What the driver reacts to beside it.

    Returns
    -------
    gap, speed : float64, shape (steps,)
        Of the driver (m, m/s).
    """
    own, m = np.asarray(model.parameters), model.magnitudes()
    leader, second = _profile(slow, fast), _profile(slow, fast, early=AHEAD)
    change = np.gradient(leader, FRAME_STEP)
    width = round(RECENT / FRAME_STEP)
    recent = np.convolve(change, np.ones(width) / width)[: len(change)]
    start = kept_gaps(model, np.array([fast]), around)[0]
    past = np.full((len(leader), 3), np.nan)
    gap, speed, second_gap = start, fast, 2.0 * start
    for k in range(len(leader)):
        past[k] = gap, speed, speed - leader[k]
        seen = around._replace(
            second_gap=second_gap, second_speed=second[k], leader_acceleration=change[k],
            leader_acceleration_mean=recent[k],
        )  # fmt: skip
        acted, known, rate = acted_on(past, k, m, FRAME_STEP)
        acceleration = float(extended_acceleration(known, rate, acted, seen, own, model.desired_speed, m))
        driven = max(speed + acceleration * FRAME_STEP, 0.0)
        gap += (leader[k] - 0.5 * (speed + driven)) * FRAME_STEP
        second_gap += (second[k] - 0.5 * (speed + driven)) * FRAME_STEP
        speed = driven
    return past[:, 0], past[:, 1]


def _profile(slow: float, fast: float, *, early: float = 0.0) -> Floats:
    """Return a leader's speed through one wave."""
    moments = np.cumsum([0.0, LEVEL / 2, SLOPE, LEVEL, SLOPE, 2.0 * LEVEL])
    t = np.arange(0.0, moments[-1], FRAME_STEP) + early
    return np.asarray(np.interp(t, moments, [fast, fast, slow, slow, fast, fast]))
