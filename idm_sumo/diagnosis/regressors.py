"""Regressors: what a little of each effect does to the rollouts, one column each.

What adds to the acceleration, or changes the time headway or the desired speed, goes through the linear response to pulses;
what is not linear near zero (delay, second leader, relaxation, dead band) is a secant at several sizes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import edges_of, numbered, response_by_bin
from idm_sumo.diagnosis.fit import Fit, Linear, linearise
from idm_sumo.diagnosis.linear_pulses import GUARD, LINEAR, MOVING, OF_LATE, OF_NEXT, YIELDING, linear_pulses
from idm_sumo.diagnosis.rolled import STEP
from idm_sumo.models.effects import CATALOGUE, slots
from idm_sumo.models.effects.desired_speed import rank
from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

PLACE_BIN, TIME_BIN = 16.0, 12.0  # m, s
FALLS_OVER = 3  # lanes, from which on what falls from lane to lane is more than one lane's
MOST_BINS = 64  # of a long road or recording: edges are sharpened later
RECOVERIES = (9.0, 16.0)  # s, of a relaxation, from which it is refined; faster is what another law does after a cut-in
# What a driver may know who is late: its own speed at once, where a new leader was, and, of its own speed, how fast it closes in.
KNOWN = ((slots.OWN_SPEED_KNOWN, 1.0), (slots.NEW_LEADER_KNOWN, 1.0), (slots.OWN_SPEED_IN_RATE, 1.0))
# Effect, slot and sizes of its magnitude, further values that it fixes.
SECANTS: tuple[tuple[str, int, tuple[float, ...], tuple[tuple[int, float], ...]], ...] = (
    ("reaction_delay", slots.DELAY, (0.2, 0.6), ()),
    ("multi_leader_anticipation", slots.SECOND_LEADER, (0.2,), ()),
    ("perception_threshold", slots.BAND, (0.4, 0.9), ()),
    ("perception_threshold", slots.BAND, (0.5,), ((slots.BAND_TAKEN, 1.0),)),
    ("reaction_delay", slots.DELAY, (0.5,), (KNOWN[0],)),
    ("reaction_delay", slots.DELAY, (0.4,), (KNOWN[1],)),
    ("reaction_delay", slots.DELAY, (0.5,), (KNOWN[0], KNOWN[1])),
    ("reaction_delay", slots.DELAY, (0.5,), (KNOWN[0], KNOWN[2])),
    ("reaction_delay", slots.DELAY, (0.5,), KNOWN),
    ("multi_leader_anticipation", slots.SECOND_LEADER, (0.2,), ((slots.SECOND_SPEED_ONLY, 1.0),)),
    ("leader_class", slots.LEADER_CLASS_DISTANCE, (3.0,), ()),
    *(("lane_change_relaxation", slots.RELAXATION, (0.5,), ((slots.RELAXATION_TIME, s),)) for s in RECOVERIES),
    (
        "lane_change_relaxation",
        slots.RELAXATION,
        (0.5,),
        ((slots.RELAXATION_TIME, 15.0), (slots.HEADWAY_ACCEPTED, 1.0)),
    ),
    ("lane_change_relaxation", slots.RELAXATION, (0.5,), ((slots.RELAXATION_TIME, 16.0), (slots.CREDIT_LIMITED, 1.0))),
)


@dataclass(frozen=True)
class Regressor:
    """One column: the effect's name, the size it stands for (1 where it is linear), further values it fixes.

    ``low`` and ``high`` bound a bin of place or time.
    """

    name: str
    size: float = 1.0
    fixed: tuple[tuple[int, float], ...] = ()
    lane: int = 0
    low: float = np.nan
    high: float = np.nan


NOTHING = 1e-9  # m per unit of a magnitude
LONGEST_COLUMN = 3.0  # times the ninetieth percentile over the windows
MOST_ANSWERED = 1.5  # times the median window's answer to pulses, from which on a window's errors count less


def tamed(columns: Floats) -> Floats:
    """Return the columns ``(windows, moments, regressors)``, shortened by :func:`taming`."""
    return np.asarray(columns * taming(columns)[:, None, :])


def taming(columns: Floats) -> Floats:
    """Return factors ``(windows, regressors)`` that leave no window's column longer than a few times what nine of ten with any effect have.

    Where a simulated vehicle nearly hits its leader, a little more of anything moves it by kilometres: without a limit a handful
    of such windows would be all the information there is.
    """
    size = np.zeros((columns.shape[0], columns.shape[2]))
    in_threads(_measure, len(columns), columns, size)
    usual = [float(np.percentile(one[one > NOTHING], 90)) if (one > NOTHING).any() else 1.0 for one in size.T]
    return np.asarray(np.minimum(1.0, LONGEST_COLUMN * np.array(usual) / np.maximum(size, NOTHING)))


@njit(cache=True, nogil=True, error_model="numpy")
def _measure(first, last, columns, size):  # type: ignore[no-untyped-def]
    for i in range(first, last):
        for k in range(columns.shape[1]):
            for n in range(columns.shape[2]):
                size[i, n] = max(size[i, n], abs(columns[i, k, n]))


INSTANT = ("acceleration_asymmetry", "speed_dependent_headway", "perception_threshold")
FORM = [n for n, name in enumerate(LINEAR) if name.startswith((*INSTANT, GUARD))]  # laws of the moment that are linear


@dataclass(frozen=True)
class Grid:
    """What the regressors of a recording share with those of its replicates: bin edges, lanes, pivot speed (m/s)."""

    place: Floats
    time: Floats
    lanes: Floats
    pivot: float


def grid_of(windows: w.Windows) -> Grid:
    """Return the grid of a recording."""
    seen = windows.seen[:, :, w.LEAD : -1]
    return Grid(
        edges_of(seen[:, w.X], PLACE_BIN, MOST_BINS), edges_of(seen[:, w.TIME], TIME_BIN, MOST_BINS),
        np.unique(seen[:, w.LANE]), float(seen[:, w.V].mean()),
    )  # fmt: skip


class Answer(NamedTuple):
    """Rollouts at a fit.

    Their linear model, their response to pulses of acceleration, their state by frame, and the linear effects' pulses in it.
    """

    line: Linear
    response: Floats
    state: Floats
    pulses: Floats


def answer_of(windows: w.Windows, fit: Fit, pivot: float) -> Answer:
    """Return what the rollouts of windows do at a fit; ``pivot`` (m/s) of :class:`Grid`."""
    response, state = ro.respond(windows.seen, windows.driver, fit.theta, fit.by_lane)
    line = linearise(windows, fit)
    line = replace(line, whitener=line.whitener * calm(response)[:, None, None])
    return Answer(line, response, state, linear_pulses(windows.seen, state, pivot))


def calm(response: Floats) -> Floats:
    """Return factors ``(windows,)`` by which errors of windows that answer pulses much more than usual count less.

    A driver's own noise is such pulses, and what it leaves in a window is in proportion to the answer, while the covariance of what
    windows leave is pooled. Where drivers are at the edge of stability (late ones, say) a few windows would be most of the information
    there is, with errors far beyond those that they are credited with.
    """
    size = np.sqrt((response**2).sum(axis=(1, 2)))
    return np.asarray(np.minimum(1.0, MOST_ANSWERED * np.median(size) / np.maximum(size, NOTHING)))


def build(windows: w.Windows, fit: Fit, answer: Answer, grid: Grid) -> tuple[list[Regressor], Floats]:
    """Return the regressors and their columns ``(windows, moments, regressors)``."""
    secants = [*SECANT_REGRESSORS, *local_regressors(fit.by_lane)]
    return _columns(windows, fit, answer, range(len(LINEAR)), grid, _scans(windows, answer.state, grid), secants)


def build_local(
    windows: w.Windows, fit: Fit, answer: Answer, grid: Grid, more: Sequence[Regressor] = ()
) -> tuple[list[Regressor], Floats]:  # fmt: skip
    """Return, as :func:`build`, the accepted magnitudes' own regressors only, and the car-following's form; and more secants."""
    return _columns(windows, fit, answer, FORM, grid, [], [*local_regressors(fit.by_lane), *more])


class Scan(NamedTuple):
    """Regressors of bins, each frame's bin (-1 for none), and the acceleration there (m/s² per unit; None for one)."""

    regressors: list[Regressor]
    number: Integers
    value: Floats | None


def _scans(windows: w.Windows, state: Floats, grid: Grid) -> list[Scan]:
    """Return lanes, what falls from lane to lane, places and times, bin by bin."""
    seen = windows.seen[:, :, w.LEAD : -1]
    place = numbered(np.clip(state[:, :, ro.BASE_X], grid.place[0], grid.place[-1] - 1e-6), grid.place)
    time = numbered(seen[:, w.TIME], grid.time)
    lanes = grid.lanes if len(grid.lanes) > 1 else grid.lanes[:0]
    lane = np.searchsorted(grid.lanes, seen[:, w.LANE]) if len(lanes) else np.full(time.shape, -1)
    by_place = [Regressor("location", low=low, high=high) for low, high in itertools.pairwise(grid.place)]
    of_headway = [replace(regressor, fixed=((slots.PLACE_HEADWAY, 1.0),)) for regressor in by_place]
    by_time = [Regressor("time_of_day", low=low, high=high) for low, high in itertools.pairwise(grid.time)]
    by_v0 = state[:, :, ro.BY_V0]
    return [
        Scan([Regressor("desired_speed", lane=int(number)) for number in lanes], lane, by_v0),
        *([_across(seen[:, w.LANE], by_v0, lanes[-1])] if len(lanes) >= FALLS_OVER else []),
        Scan(by_place, place, None),
        Scan(of_headway, place, state[:, :, ro.BY_T]),
        *([] if w.several_periods(windows) else [Scan(by_time, time, state[:, :, ro.BY_T])]),
    ]


def _across(lane: Floats, by_v0: Floats, lanes: float) -> Scan:
    """Return the desired speed that falls from the leftmost lane to the rightmost."""
    regressor = Regressor(
        "desired_speed", fixed=((slots.DESIRED_SPEED, 1.0), (slots.DESIRED_SPEED_ACROSS, float(lanes)))
    )
    return Scan([regressor], np.zeros(lane.shape, dtype=np.int64), by_v0 * rank(lane, lanes))


def _columns(
    windows: w.Windows, fit: Fit, answer: Answer, linear: Sequence[int], grid: Grid, scans: list[Scan], secants: list[Regressor]
) -> tuple[list[Regressor], Floats]:  # fmt: skip
    """Return linear regressors, scans and secants, and the columns of all."""
    companions = {
        LINEAR.index("speed_dependent_headway"): ((slots.SPEED_HEADWAY, 1.0), (slots.PIVOT_SPEED, grid.pivot)),
        OF_LATE: ((slots.HYSTERESIS, 1.0), (slots.HYSTERESIS_OF_LATE, 1.0)),
        OF_NEXT: ((slots.FRICTION, 1.0), (slots.FRICTION_NEXT, 1.0)),
        YIELDING: ((slots.COURTESY_BRAKING, 1.0),),
        MOVING: ((slots.PRE_INSERTION_BRAKING, 1.0),),
    }
    regressors = [Regressor(LINEAR[n], fixed=companions.get(n, ())) for n in linear]
    count = len(regressors) + sum(len(scan.regressors) for scan in scans) + len(secants)
    columns = np.zeros((*answer.response.shape[:2], count))
    columns[:, :, : len(regressors)] = answer.response @ answer.pulses[:, :, list(linear)]
    for scan in scans:
        response_by_bin(answer.response, scan.number, scan.value, columns[:, :, len(regressors) :])
        regressors += scan.regressors
    moved = ro.positions_otherwise(
        windows, fit.theta, [with_regressor(fit.by_lane, regressor) for regressor in secants]
    )
    moved -= answer.line.simulated[:, :, None]
    np.divide(moved, [regressor.size for regressor in secants], out=columns[:, :, len(regressors) :])
    return [*regressors, *secants], columns


# Of effects that are not linear near zero.
SECANT_REGRESSORS = tuple(
    Regressor(name, size, ((slot, size), *more)) for name, slot, sizes, more in SECANTS for size in sizes
)
LOCAL = "local:"  # marks an regressor that is a small step of a magnitude already accepted
OTHERWISE = "otherwise:"  # marks one that is an accepted magnitude with another companion


def local_regressors(by_lane: Floats) -> list[Regressor]:
    """Return a small step for each accepted magnitude, linear or not."""
    regressors = []
    for effect in CATALOGUE:
        if not effect.parameters:
            continue
        first = effect.acting(by_lane[0])[0]
        value = by_lane[0, first.slot]
        if value != 0.0:
            size = _small_step(first.slot, value, first.typical)
            fixed = [(first.slot, size)]
            if first.slot == slots.RELAXATION:
                fixed.append((slots.RELAXATION_TIME, float(by_lane[0, slots.RELAXATION_TIME])))
            regressors.append(Regressor(LOCAL + effect.name, size, tuple(fixed)))
    return regressors


def _small_step(slot: int, value: float, typical: float) -> float:
    """Return a small step of a magnitude; of a desired speed the one by which drivers' own are moved, who make up for it."""
    return STEP * (1.0 + value) if slot == slots.DESIRED_SPEED else 0.25 * max(abs(value), 0.5 * typical)


def with_regressor(by_lane: Floats, regressor: Regressor) -> Floats:
    """Return the magnitudes with the regressor's on top (added to the accepted magnitude, where it acts; companions set)."""
    moved = by_lane.copy()
    for number, (slot, value) in enumerate(regressor.fixed):
        moved[:, slot] = moved[:, slot] + acts(by_lane, slot) * value if number == 0 else value
    return moved


def acts(by_lane: Floats, slot: int) -> npt.NDArray[np.bool_]:
    """Return the lanes in which a magnitude acts, all if none: it is new."""
    there: npt.NDArray[np.bool_] = by_lane[:, slot] != 0.0
    return there if there.any() else np.ones_like(there)
