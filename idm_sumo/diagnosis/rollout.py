"""Compiled closed-loop rollouts of windows, and their linear response to a little more acceleration."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from numba import literal_unroll, njit

from idm_sumo.diagnosis import windows as w
from idm_sumo.models import idm, laws
from idm_sumo.models.effects import slots
from idm_sumo.models.effects.acceleration import EffectTerms, Stimuli, acceleration_with_terms, effect_terms
from idm_sumo.models.effects.reaction_delay import (
    approached,
    between,
    follow_another,
    gap_between,
    knows_new_leader,
    moment_ago,
    own_delay,
)
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
PARAMETERS = 5  # a, b, T, d0 and the desired speed; d1 stays zero
NUDGE = 0.1  # m, m/s: of the numerical derivatives by the state; less, and the edge of a dead band looks like a wall
LITTLE = 1e-3  # of a log-parameter
BIN = 5  # frames of one pulse, 0.5 s
# Numbers that a processor takes at once, and from how many left over on they take longer one after the other than filled up to as many.
WIDE, WORTH_FILLING = 8, 3
# What the compiler is told of the models: there is one and its moments are all alike, or not.
STEADY, VARYING = (), (0,)


@njit(cache=True, error_model="numpy", forceinline=True)
def _moment(row, m):  # type: ignore[no-untyped-def]
    """Return the moment of a frame, seen from where the recorded vehicle is: that does not matter."""
    x = row[w.X]
    see = Stimuli(
        x, row[w.TIME], row[w.ACCELERATION], row[w.KIND], row[w.OWN_KIND], row[w.LANE],
        row[w.SECOND] - x, row[w.SECOND_SPEED], row[w.ADJACENT], x - row[w.BEHIND],
        row[w.JUMP], row[w.SINCE], row[w.ACCEPTED], row[w.UNTIL_CUT_IN], row[w.UNTIL_OWN], row[w.MEAN_SPEED],
        row[w.NEXT_BESIDE], row[w.ACCELERATION_OF_LATE],
    )  # fmt: skip
    return effect_terms(see, m)


BLANK = EffectTerms(*[0.0] * len(EffectTerms._fields))
ROWS = 9  # of a model's magnitudes: the lane numbers. Where only some drivers have a cause, as many follow, of those without it.


@njit(cache=True, error_model="numpy", forceinline=True)
def _row_of(row, rows):  # type: ignore[no-untyped-def]
    """Return which of so many rows of magnitudes counts in a frame."""
    lane = int(row[w.LANE])
    return lane + ROWS if rows > ROWS and row[w.WITHOUT] > 0.0 else lane


@njit(cache=True, error_model="numpy", forceinline=True)
def _note(moment, of, n):  # type: ignore[no-untyped-def]
    """Note one of several moments side by side, a row for each of its quantities."""
    for number, value in enumerate(literal_unroll(moment)):
        of[number, n] = value


@njit(cache=True, error_model="numpy", forceinline=True)
def _noted(of, n):  # type: ignore[no-untyped-def]
    """Return the moment that was noted."""
    return EffectTerms(
        of[0, n], of[1, n], of[2, n], of[3, n], of[4, n], of[5, n], of[6, n], of[7, n], of[8, n], of[9, n], of[10, n],
        of[11, n], of[12, n], of[13, n], of[14, n], of[15, n], of[16, n], of[17, n], of[18, n], of[19, n],
        of[20, n], of[21, n], of[22, n], of[23, n], of[24, n], of[25, n],
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _remember(seen, gap, speed, rate, models, begin):  # type: ignore[no-untyped-def]
    """Fill the past with what the recorded vehicle did before the start; the last axis is of rollouts side by side."""
    for k in range(begin):
        gap[k] = seen[w.REAR, k] - seen[w.X, k]
        speed[k] = seen[w.V, k]
        rate[k] = seen[w.V, k] - seen[w.SPEED, k]
        if seen[w.SINCE, k] == 0.0:
            _meet(seen[:, k], gap, speed, rate, models, k)


@njit(cache=True, error_model="numpy")
def _meet(row, gap, speed, rate, models, now):  # type: ignore[no-untyped-def]
    """Rewrite the past of those who know where a frame's leader, who is new, was."""
    for n in range(gap.shape[1]):
        if knows_new_leader(models[n if len(models) > 1 else 0, _row_of(row, models.shape[1])]):
            follow_another(gap[:, n], speed[:, n], rate[:, n], now, FRAME_STEP)


@njit(cache=True, nogil=True, error_model="numpy")
def _drive(first, last, seen, driver, theta, models, varies, start, pushed, begin, every, of_law, of_kind, x, v):  # type: ignore[no-untyped-def]
    """Fill ``x`` and ``v``; the last axis of ``theta``, ``start``, ``x`` and ``v`` is of rollouts side by side.

    An array for each quantity, so that the compiler sees loops over rollouts that it can turn into vector instructions;
    ``of_law`` of :func:`idm_sumo.models.laws.as_type` for the same reason, and ``of_kind``, ``STEADY`` or ``VARYING``.
    """
    frames, beside = seen.shape[2], x.shape[2]
    if first == last or beside == 0:
        return
    remembers = models[:, :, slots.NEW_LEADER_KNOWN].sum() > 0.0  # zero models may stand side by side
    law, steady = len(of_law), len(of_kind) == len(STEADY)
    same_driver, same_model = theta.shape[2] == 1, steady or len(models) == 1
    gap, speed, rate = np.empty((frames, beside)), np.empty((frames, beside)), np.empty((frames, beside))
    a, weight, headway, jam, limit = (
        np.empty(beside), np.empty(beside), np.empty(beside), np.empty(beside), np.empty(beside),
    )  # fmt: skip
    here, fast, more = np.empty(beside), np.empty(beside), np.empty(beside)
    then_gap, then_speed, then_rate = np.empty(beside), np.empty(beside), np.empty(beside)
    of = np.empty((len(BLANK), beside))
    moment = _moment(seen[first, :, 0], models[0, 0])  # where none is unlike another, this one is enough
    for n in range(len(models)):
        _note(_moment(seen[first, :, 0], models[n, 0]), of, n)
    for i in range(first, last):
        one, own = seen[i], theta[driver[i]]
        _remember(one, gap, speed, rate, models, begin)
        for n in range(beside):
            who = 0 if same_driver else n
            a[n], headway[n], jam[n], limit[n] = own[0, who], own[2, who], own[3, who], own[4, who]
            weight[n] = idm.closing_weight(own[0, who], own[1, who])
            here[n], fast[n] = one[w.X, begin] + start[0, n], max(one[w.V, begin] + start[1, n], 0.0)
            x[i, 0, n], v[i, 0, n] = here[n], fast[n]
        for now in range(begin, frames - 1):
            row = one[:, now]
            lane = _row_of(row, models.shape[1])
            rear, ahead, second, behind = row[w.REAR], row[w.SPEED], row[w.SECOND], row[w.BEHIND]
            push = pushed[i, now - begin] if pushed.shape[0] > 0 else 0.0
            for n in range(beside):
                gap[now, n] = rear - here[n]
                speed[now, n] = fast[n]
                rate[now, n] = fast[n] - ahead
            if remembers and row[w.SINCE] == 0.0:
                _meet(row, gap, speed, rate, models, now)
            if same_model:
                if not steady:
                    moment = _moment(row, models[0, lane])
                ago, after, share = moment_ago(now, models[0, lane, slots.DELAY], FRAME_STEP)
                own_ago, own_after, own_share = moment_ago(now, own_delay(models[0, lane]), FRAME_STEP)
                in_rate = models[0, lane, slots.OWN_SPEED_IN_RATE]
                for n in range(beside):
                    known, late = (
                        between(speed[own_ago, n], speed[own_after, n], own_share),
                        between(speed[ago, n], speed[after, n], share),
                    )
                    more[n] = acceleration_with_terms(
                        known, approached(between(rate[ago, n], rate[after, n], share), late, known, in_rate),
                        gap_between(gap[ago, n], gap[after, n], share), here[n], second - here[n], here[n] - behind,
                        moment, a[n], weight[n], headway[n], jam[n], 0.0, limit[n], law,
                    )  # fmt: skip
            else:
                for n in range(beside):
                    if varies[n]:
                        _note(_moment(row, models[n, lane]), of, n)
                    ago, after, share = moment_ago(now, models[n, lane, slots.DELAY], FRAME_STEP)
                    then_gap[n] = gap_between(gap[ago, n], gap[after, n], share)
                    late, late_rate = (
                        between(speed[ago, n], speed[after, n], share),
                        between(rate[ago, n], rate[after, n], share),
                    )
                    ago, after, share = moment_ago(now, own_delay(models[n, lane]), FRAME_STEP)
                    then_speed[n] = between(speed[ago, n], speed[after, n], share)
                    then_rate[n] = approached(late_rate, late, then_speed[n], models[n, lane, slots.OWN_SPEED_IN_RATE])
                for n in range(beside):
                    more[n] = acceleration_with_terms(
                        then_speed[n], then_rate[n], then_gap[n], here[n], second - here[n], here[n] - behind,
                        _noted(of, n), a[n], weight[n], headway[n], jam[n], 0.0, limit[n], law,
                    )  # fmt: skip
            for n in range(beside):
                faster = max(fast[n] + (more[n] + push) * FRAME_STEP, 0.0)
                here[n] += 0.5 * (fast[n] + faster) * FRAME_STEP
                fast[n] = faster
            step = now + 1 - begin
            if step % every == 0:
                for n in range(beside):
                    x[i, step // every, n], v[i, step // every, n] = here[n], fast[n]


def side_by_side(
    seen: Floats, driver: Integers, theta: Floats, models: Floats, start: Floats, pushed: Floats, begin: int, every: int
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return positions and speeds of several rollouts of every window, of other drivers, starts or models.

    Parameters
    ----------
    seen, driver, pushed, begin
        As in :func:`drive`.
    theta : float64, shape (drivers, 5, rollouts) or (drivers, 5, 1)
    models : float64, shape (rollouts, rows, slots.COUNT) or (1, rows, slots.COUNT)
        Magnitudes by lane number, :data:`ROWS`, or as many again for drivers without what only some have.
    start : float64, shape (2, rollouts)
    every : int
        Frames between those that are returned.

    Returns
    -------
    float64, shapes (windows, 1 + horizon // every, rollouts)
    """
    beside = start.shape[1]
    filled = _filled(beside)
    models = models[filled] if len(models) > 1 else models
    theta = np.ascontiguousarray(theta[:, :, filled] if theta.shape[2] > 1 else theta)
    start = np.ascontiguousarray(start[:, filled])
    shape = (len(seen), 1 + (seen.shape[2] - begin - 1) // every, len(filled))
    x, v = np.empty(shape), np.empty(shape)
    law = laws.as_type(models[:1, 0, slots.LAW].sum())  # of all of them; there may be none
    varies = _vary(models)
    kind = STEADY if len(models) == 1 and not varies[0] else VARYING
    in_threads(_drive, len(seen), seen, driver, theta, models, varies, start, pushed, begin, every, law, kind, x, v)
    return x[:, :, :beside], v[:, :, :beside]


def _vary(models: Floats) -> npt.NDArray[np.bool_]:
    """Return for each model whether one moment is unlike another by it: by who is around, the time or the lane."""
    by_lane = (models != models[:, :1]).any(axis=(1, 2))
    return np.asarray(by_lane | models[:, 0, slots.OF_SURROUNDINGS].any(axis=1))


def _filled(beside: int) -> Integers:
    """Return the numbers of so many rollouts, the last one again as often as fills up what a processor takes at once."""
    wide = beside if beside % WIDE < WORTH_FILLING else -(-beside // WIDE) * WIDE
    return np.asarray(np.minimum(np.arange(wide), beside - 1))


def drive(
    seen: Floats, driver: Integers, theta: Floats, by_lane: Floats, start: Floats, pushed: Floats, begin: int, every: int = 1
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return positions and speeds of all windows, each of shape ``(windows, horizon + 1)``.

    Parameters
    ----------
    seen : float64, shape (windows, COLUMNS, LEAD + horizon + 1)
    driver : int64, shape (windows,)
    theta : float64, shape (drivers, 5)
    by_lane : float64, shape (rows, slots.COUNT)
        Magnitudes by lane number; see :func:`side_by_side`.
    start : float64, shape (2,)
        Added to the recorded start: m, m/s.
    pushed : float64, shape (windows, horizon) or (0, 0)
        Acceleration (m/s²) added to the driver's own.
    begin : int
        The frame at which the simulation starts.
    every : int
        Frames between those that are returned.
    """
    x, v = side_by_side(seen, driver, theta[:, :, None], by_lane[None], start[:, None], pushed, begin, every)
    return x[:, :, 0], v[:, :, 0]


# What `respond` notes of the base rollout at each step.
BY_T, BY_V0, BASE_A, BASE_V, BASE_X, BY_GAP, BY_V = range(7)


def respond(seen: Floats, driver: Integers, theta: Floats, by_lane: Floats) -> tuple[Floats, Floats]:
    """Return the response of the compared positions to pulses of acceleration, and the base rollout's state.

    Returns
    -------
    response : float64, shape (windows, moments, pulses)
        Metres per m/s² held for one pulse (0.5 s).
    state : float64, shape (windows, horizon, 7)
        Derivatives of the acceleration by log T and log v0 (m/s²), the acceleration, speed and position,
        the derivatives by gap and by own speed.
    """
    steps = seen.shape[2] - w.LEAD - 1
    response = np.zeros((len(seen), steps // w.EVERY, steps // BIN))
    state = np.empty((len(seen), steps, 7))
    in_threads(_respond, len(seen), seen, driver, theta, by_lane, response, state)
    return response, state


# Nine looks at one moment: as it is; a little farther and nearer; faster and slower; with more headway; with more desired speed;
# with the own speed higher and lower that is known sooner than the rest, where it is.
FARTHER = NUDGE * np.array([0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
FASTER = NUDGE * np.array([0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, 0.0])
MORE_HEADWAY = 1.0 + LITTLE * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
MORE_SPEED = 1.0 + LITTLE * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
SOONER = NUDGE * np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0])


@njit(cache=True, nogil=True, error_model="numpy")
def _respond(first, last, seen, driver, theta, by_lane, response, state):  # type: ignore[no-untyped-def]
    steps, pulses = state.shape[1], response.shape[2]
    gap_of, speed_of, rate_of = np.empty((seen.shape[2], 1)), np.empty((seen.shape[2], 1)), np.empty((seen.shape[2], 1))
    gaps, speeds, rates = gap_of[:, 0], speed_of[:, 0], rate_of[:, 0]
    models = by_lane.reshape((1, *by_lane.shape))
    looked = np.empty(len(FARTHER))
    for i in range(first, last):
        one, own = seen[i], theta[driver[i]]
        _remember(one, gap_of, speed_of, rate_of, models, w.LEAD)
        x, v, weight = one[w.X, w.LEAD], one[w.V, w.LEAD], idm.closing_weight(own[0], own[1])
        dx, dv = np.zeros((steps + 1, pulses)), np.zeros((steps + 1, pulses))
        for k in range(steps):
            now = w.LEAD + k
            row = one[:, now]
            m = by_lane[_row_of(row, len(by_lane))]
            moment = _moment(row, m)
            gaps[now], speeds[now], rates[now] = row[w.REAR] - x, v, v - row[w.SPEED]
            if row[w.SINCE] == 0.0:
                _meet(row, gap_of, speed_of, rate_of, models, now)
            ago, after, share = moment_ago(now, m[slots.DELAY], FRAME_STEP)
            gap, rate = gap_between(gaps[ago], gaps[after], share), between(rates[ago], rates[after], share)
            late, in_rate = between(speeds[ago], speeds[after], share), m[slots.OWN_SPEED_IN_RATE]
            ago, after, share = moment_ago(now, own_delay(m), FRAME_STEP)
            speed = between(speeds[ago], speeds[after], share)
            rate = approached(rate, late, speed, in_rate)
            for n in range(len(looked) if m[slots.OWN_SPEED_KNOWN] > 0.0 else len(looked) - 2):
                at = x + FARTHER[n]
                looked[n] = acceleration_with_terms(
                    speed + FASTER[n] + SOONER[n], rate + FASTER[n] + in_rate * SOONER[n], gap - FARTHER[n], at, row[w.SECOND] - at, at - row[w.BEHIND],
                    moment, own[0], weight, own[2] * MORE_HEADWAY[n], own[3], 0.0, own[4] * MORE_SPEED[n], m[slots.LAW],
                )  # fmt: skip
            a = looked[0]
            by_x, by_v = (looked[1] - looked[2]) / (2.0 * NUDGE), (looked[3] - looked[4]) / (2.0 * NUDGE)
            at_once = (looked[7] - looked[8]) / (2.0 * NUDGE) if m[slots.OWN_SPEED_KNOWN] > 0.0 else 0.0
            state[i, k, BY_T], state[i, k, BY_V0] = (looked[5] - a) / LITTLE, (looked[6] - a) / LITTLE
            state[i, k, BASE_A], state[i, k, BASE_V], state[i, k, BASE_X] = a, v, x
            state[i, k, BY_GAP], state[i, k, BY_V] = -by_x, by_v
            then, then_own = k - int(np.rint(m[slots.DELAY] / FRAME_STEP)), k - int(np.rint(own_delay(m) / FRAME_STEP))
            new = v + a * FRAME_STEP
            moving = 1.0 if new > 0.0 else 0.0
            for j in range(min(k // BIN + 1, pulses)):
                change = 1.0 if k // BIN == j else 0.0
                if then >= 0:
                    change += by_x * dx[then, j] + (by_v - at_once) * dv[then, j]
                if then_own >= 0:
                    change += at_once * dv[then_own, j]
                dv[k + 1, j] = (dv[k, j] + change * FRAME_STEP) * moving
                dx[k + 1, j] = dx[k, j] + 0.5 * (dv[k, j] + dv[k + 1, j]) * FRAME_STEP
            x += 0.5 * (v + max(new, 0.0)) * FRAME_STEP
            v = max(new, 0.0)
            if (k + 1) % w.EVERY == 0:
                for j in range(pulses):
                    response[i, (k + 1) // w.EVERY - 1, j] = dx[k + 1, j]


NO_PUSH = np.empty((0, 0))
PLAIN = np.zeros((ROWS, slots.COUNT))


def positions(windows: w.Windows, theta: Floats, by_lane: Floats) -> Floats:
    """Return the simulated positions (m) at the compared moments, shape ``(windows, moments)``."""
    x, _ = drive(windows.seen, windows.driver, theta, by_lane, np.zeros(2), NO_PUSH, w.LEAD, w.EVERY)
    return np.ascontiguousarray(x[:, 1:])


def positions_beside(windows: w.Windows, theta: Floats, by_lane: Floats, start: Floats) -> Floats:
    """Return :func:`positions` of several rollouts, shape ``(windows, moments, rollouts)``; see :func:`side_by_side`."""
    x, _ = side_by_side(windows.seen, windows.driver, theta, by_lane[None], start, NO_PUSH, w.LEAD, w.EVERY)
    return x[:, 1:]


def positions_otherwise(windows: w.Windows, theta: Floats, models: Sequence[Floats]) -> Floats:
    """Return :func:`positions` of the same drivers with several models, shape ``(windows, moments, models)``."""
    start, theta = np.zeros((2, len(models))), theta[:, :, None]
    every = np.stack(models) if models else np.empty((0, *PLAIN.shape))
    x, _ = side_by_side(windows.seen, windows.driver, theta, every, start, NO_PUSH, w.LEAD, w.EVERY)
    return x[:, 1:]
