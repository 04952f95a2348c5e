"""What the best model could gain: true followers behind their leaders, with and without the planted effect."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.signal import savgol_filter

from tests.simulators.first import behaviour as act
from tests.simulators.first.files import position_noise
from tests.simulators.first.plans import FORMS, MODELS
from tests.simulators.first.simulation import Planted

FRAME = 0.1  # s
PAST = 13  # frames that a delay reaches into
STEPS = (0.4, 0.2, 0.1, 0.05)  # of the logarithms of the parameters: from coarse to fine
# Times the true v0, T, a, b, s0: without its effect the best driver is another one, and far along a narrow valley.
STARTS = ((1.0, 1.0, 1.0, 1.0, 1.0), (0.75, 1.2, 1.2, 0.8, 0.5), (1.2, 0.85, 0.8, 1.25, 1.8), (0.9, 1.3, 0.7, 1.5, 0.7))
SWEEPS = 12  # over the parameters with one step, at most
SETTLED = 0.999  # of the error before a sweep: one that gains less is the last of its step
SMOOTHED = 21  # frames that a measured path is smoothed over
MOST_DRIVERS = 120  # more tell nothing new
NOT_BEHAVIOUR = ("measurement_artefact", "distraction")


@dataclass(frozen=True)
class Achievable:
    """Mean absolute position error (m) over drivers, each with its best parameters, without and with what is hidden.

    Of several effects, ``without`` has the errors without each in turn, the others in the model.
    """

    base: float
    extended: float
    drivers: int
    without: tuple[float, ...] = ()

    @property
    def share(self) -> float:
        """Return the gain as a share of the base."""
        return (self.base - self.extended) / self.base


def achievable(planted: Planted, *, seconds: float = 10.0, drivers: int = MOST_DRIVERS) -> Achievable:
    """Return the errors of the true model with and without its effects; in all of them each driver is fitted.

    Without fitting, what a driver's own parameters can absorb would count as gain. The paths of drivers and leaders are
    as they were measured, and smoothed: what noise hides cannot be gained. Of more than ``drivers`` some are
    chosen evenly. The traffic must have been simulated with ``remember=True``.

    Raises
    ------
    ValueError
        If nothing was remembered, or the effect is not one of behaviour.
    """
    chosen = planted.plan
    if not planted.sights.size or not chosen.effects or any(name in NOT_BEHAVIOUR for name in chosen.effects):
        raise ValueError("needs simulate(plan, remember=True) and a planted effect of behaviour")
    driver, start = _windows(planted, round(seconds / FRAME))
    known = np.unique(driver)
    some = np.isin(driver, known[:: -(-len(known) // drivers)])
    effects = np.zeros((2, len(act.INDEX)))
    for name, size in chosen.effects.items():
        effects[1, act.INDEX[name]] = size
    if len(chosen.effects) > 1:
        each = [act.INDEX[name] for name in chosen.effects]
        effects = np.vstack([effects, np.repeat(effects[1:], len(each), axis=0)])
        effects[2 + np.arange(len(each)), each] = 0.0
    shown = _as_measured(planted)
    ade = best_errors(
        MODELS.index(chosen.underlying), FORMS.index(chosen.form), effects, planted.affected, planted.kind,
        planted.theta,
        np.array([*chosen.place, *chosen.time]), chosen.lane, chosen.only_lane, shown.x, shown.v, planted.lane,
        shown.sights, driver[some], start[some], round(seconds / FRAME), np.array(STARTS), np.array(STEPS),
    )  # fmt: skip
    base, extended, *without = ade.mean(axis=1).tolist()
    return Achievable(base, extended, ade.shape[1], tuple(without))


def _as_measured(planted: Planted) -> Planted:
    """Return the paths of drivers, leaders and second leaders with the noise that smoothing leaves."""
    rng = np.random.default_rng([planted.plan.seed, 3])

    def left_over() -> list[npt.NDArray[np.float64]]:
        noise = position_noise(rng, planted.x.shape, planted.plan.noise, planted.plan.sigma)
        return [savgol_filter(noise, SMOOTHED, 2, deriv=order, delta=FRAME) for order in (0, 1)]

    sights = planted.sights.copy()
    for place, speed in ((act.REAR, act.AHEAD_V), (act.SECOND_REACH, act.SECOND_V)):
        for column, error in zip((place, speed), left_over(), strict=True):
            sights[:, :, column] += error
    own, own_speed = left_over()
    return replace(planted, x=planted.x + own, v=np.maximum(planted.v + own_speed, 0.0), sights=sights)


def _windows(planted: Planted, frames: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Return driver and first frame of windows with a leader on the section throughout, one after the other."""
    rear = planted.sights[:, :, act.REAR]
    usable = np.isfinite(planted.x) & np.isfinite(rear) & (rear < planted.plan.length - 4.0)
    driver, start = [], []
    for i, row in enumerate(usable):
        k = 0
        while k + PAST + frames < len(row):
            gone = np.flatnonzero(~row[k : k + PAST + frames + 1])
            if len(gone):
                k += int(gone[-1]) + 1
                continue
            driver.append(i)
            start.append(k + PAST)
            k += frames
    return np.array(driver, np.int64), np.array(start, np.int64)


@njit(cache=True)
def best_errors(  # type: ignore[no-untyped-def]
    model, form, effects, affected, kind, theta, where, special_lane, only_lane, x, v, lane, sights, driver, start,
    frames, starts, steps,
):  # fmt: skip
    """Return each driver's least mean error over its windows, shape (models, drivers): one model a row of ``effects``.

    Pattern search in the logarithms, after Hooke and Jeeves (1961), from the true parameters times each of ``starts``.
    """
    first = np.flatnonzero(np.append(True, driver[1:] != driver[:-1]))
    ends = np.append(first[1:], len(driver))
    out = np.empty((len(effects), len(first)))
    for which in range(len(effects)):
        for n in range(len(first)):
            i = driver[first[n]]
            planted = effects[which] if affected[i] else effects[which] * 0.0
            given = (
                model, form, planted, kind[i] == 3, where, special_lane, only_lane, x[i], v[i], lane[i], sights[i],
                start[first[n] : ends[n]], frames,
            )  # fmt: skip
            least = np.inf
            for begin in starts:
                least = min(least, settled(theta[i] * begin, steps, given))
            out[which, n] = least
    return out


@njit(cache=True)
def settled(best, steps, given):  # type: ignore[no-untyped-def]
    """Return the error at which a search from ``best`` ends."""
    least = driver_error(best, given)
    for step in steps:
        for _ in range(SWEEPS):
            was = least
            best, least = sweep(best, least, step, given)
            if least >= SETTLED * was:
                break
    return least


@njit(cache=True)
def sweep(best, least, step, given):  # type: ignore[no-untyped-def]
    """Try every parameter in both directions, then the whole way once more; return the best and its error."""
    begin = best.copy()
    for p in range(len(best)):
        for sign in (-1.0, 1.0):
            tried = best.copy()
            tried[p] *= np.exp(sign * step)
            error = driver_error(tried, given)
            if error < least:
                best, least = tried, error
    tried = best * best / begin
    error = driver_error(tried, given)
    return (tried, error) if error < least else (best, least)


@njit(cache=True)
def driver_error(theta, given):  # type: ignore[no-untyped-def]
    """Return the mean error (m) over a driver's windows."""
    model, form, planted, truck, where, special_lane, only_lane, x, v, lane, sights, start, frames = given
    total = 0.0
    for k in start:
        total += window_error(
            model, form, planted, theta, truck, where, special_lane, only_lane, x, v, lane, sights, k, frames
        )
    return total / len(start)


@njit(cache=True)
def window_error(  # type: ignore[no-untyped-def]
    model, form, planted, theta, own_truck, where, special_lane, only_lane, x, v, lane, sights, start, frames
):  # fmt: skip
    """Return the mean absolute position error (m) of one closed-loop window from the true state."""
    size = PAST + frames + 1
    past_s, past_v, past_d = np.empty(size), np.empty(size), np.empty(size)
    none = np.zeros_like(planted)
    seen = np.empty(sights.shape[1])
    here, speed, total = x[start], v[start], 0.0
    for n in range(size):
        k = start - PAST + n
        if n < PAST:
            here, speed = x[k], v[k]
        elif n == PAST:
            here, speed = x[start], v[start]
        seen[:] = sights[k]
        past_s[n], past_v[n], past_d[n] = seen[act.REAR] - here, speed, speed - seen[act.AHEAD_V]
        if n < PAST:
            continue
        if n > PAST:
            total += abs(here - x[k])
        e = planted if only_lane < 0 or lane[k] == only_lane else none
        ago = n - round((e[act.DELAY] + e[act.LATE] * (seen[act.IN_TIME] > 0.5)) / FRAME)
        own = speed if form == act.OTHER else past_v[ago]
        then_s, then_d = past_s[ago], past_d[ago]
        if (
            form == act.THIRD and seen[act.SINCE] < (n - ago) * FRAME
        ):  # of a leader who was not followed yet, at its speed of now
            then_s += seen[act.REAR] - (n - ago) * FRAME * seen[act.AHEAD_V] - sights[start - PAST + ago, act.REAR]
            then_d = past_v[ago] - seen[act.AHEAD_V]
        limit = 1.0 - e[act.LIMIT] if lane[k] == special_lane else 1.0
        new = act.respond(
            model, form, e, theta, limit, own_truck, seen, where, here, speed, own, then_s, then_d
        )  # fmt: skip
        new = min(max(new, -8.0), 4.0)
        time = -speed / new if new < 0.0 and speed + new * FRAME < 0.0 else FRAME
        here += speed * time + 0.5 * new * time * time
        speed = max(0.0, speed + new * FRAME)
    return total / frames
