"""Atoms: what a little of each effect does to the rollouts, one column each.

What adds to the acceleration, or changes the time headway or the desired speed, goes through the linear response to pulses;
what is not linear near zero (delay, second leader, relaxation, dead band) is a secant at several sizes.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import edges_of, numbered, pulses_by_bin
from idm_sumo.diagnosis.fit import Fit, Linear, linearise
from idm_sumo.effects import CATALOGUE, slots
from idm_sumo.effects.courtesy_yielding import NOTICE
from idm_sumo.effects.follower_pressure import REACH
from idm_sumo.effects.hysteresis import SATURATION
from idm_sumo.effects.leader_class import TRUCK
from idm_sumo.effects.speed_dependent_headway import SPEED_UNIT

Floats = npt.NDArray[np.float64]

PLACE_BIN, TIME_BIN = 16.0, 12.0  # m, s
SECANTS: tuple[tuple[str, int, tuple[float, ...]], ...] = (
    ("reaction_delay", slots.DELAY, (0.2, 0.4, 0.8)),
    ("multi_leader_anticipation", slots.SECOND_LEADER, (0.2,)),
    ("perception_threshold", slots.BAND, (0.3, 0.6, 1.0)),
)
RECOVERIES = (5.0, 10.0, 18.0)  # s, of the relaxation's secants
RELAXATION_SIZE = 0.5


@dataclass(frozen=True)
class Atom:
    """One column: the effect's name, the size it stands for (1 where it is linear), further values it fixes.

    ``low`` and ``high`` bound a bin of place or time.
    """

    name: str
    size: float = 1.0
    fixed: tuple[tuple[int, float], ...] = ()
    lane: int = 0
    low: float = np.nan
    high: float = np.nan


def pulse_means(field: Floats) -> Floats:
    """Return the means over pulses of a field by frame; shape ``(windows, horizon)`` to ``(windows, pulses)``."""
    return np.ascontiguousarray(field.reshape(len(field), -1, ro.BIN).mean(axis=2))


def linear_fields(windows: w.Windows, state: Floats, pivot: float) -> dict[str, Floats]:
    """Return for each linear effect the acceleration (m/s²) per unit of its magnitude, shape ``(windows, horizon)``."""
    seen = windows.seen[:, w.LEAD : -1]
    by_t, v, x, a = (state[:, :, n] for n in (ro.BY_T, ro.BASE_V, ro.BASE_X, ro.BASE_A))
    adjacent = np.where(np.isfinite(seen[:, :, w.ADJACENT]), seen[:, :, w.ADJACENT], np.inf)
    rear = np.where(np.isfinite(seen[:, :, w.BEHIND]), x - seen[:, :, w.BEHIND], np.inf)
    pressure = np.where(rear < REACH, np.minimum(1.0 - rear / REACH, 1.0), 0.0)
    return {
        "acceleration_asymmetry": -np.maximum(a, 0.0),
        "leader_class": by_t * (seen[:, :, w.KIND] == TRUCK),
        "speed_dependent_headway": by_t * (v - pivot) / SPEED_UNIT,
        "hysteresis": by_t * np.tanh(np.nan_to_num(seen[:, :, w.ACCELERATION]) / SATURATION),
        "adjacent_lane_friction": -np.maximum(v - adjacent, 0.0),
        "vehicle_class": by_t * (seen[:, :, w.OWN_KIND] == TRUCK),
        "follower_pressure": pressure,
        "courtesy_yielding": by_t * (seen[:, :, w.UNTIL_CUT_IN] < NOTICE),
        "pre_insertion": by_t * (seen[:, :, w.UNTIL_OWN] < NOTICE),
    }


NOTHING = 1e-9  # m per unit of a magnitude
LONGEST_COLUMN = 3.0  # times the ninetieth percentile over the windows


def tamed(columns: Floats) -> Floats:
    """Return the columns, no window's longer than a few times what nine of ten of those with any effect have.

    Where a simulated vehicle nearly hits its leader, a little more of anything moves it by kilometres: without a limit a handful
    of such windows would be all the information there is.
    """
    size = np.abs(columns).max(axis=1)
    usual = [float(np.percentile(one[one > NOTHING], 90)) if (one > NOTHING).any() else 1.0 for one in size.T]
    limit = LONGEST_COLUMN * np.array(usual)
    return np.asarray(columns * np.minimum(1.0, limit / np.maximum(size, NOTHING))[:, None, :])


GUARD = "form:"  # begins the names of what another car-following model underneath would look like
INSTANT = ("acceleration_asymmetry", "speed_dependent_headway", "perception_threshold")


def form_fields(windows: w.Windows, state: Floats, pivot: float) -> list[Floats]:
    """Return smooth accelerations of speed, gap and approach rate, second order: the form of the car-following itself."""
    seen = windows.seen[:, w.LEAD : -1]
    v = state[:, :, ro.BASE_V]
    speed, closing = (v - pivot) / SPEED_UNIT, (v - seen[:, :, w.SPEED]) / 3.0
    gap = np.log(np.maximum(seen[:, :, w.REAR] - state[:, :, ro.BASE_X], 1.0) / (2.0 + 1.2 * v))
    return [speed * speed, closing * closing, speed * closing, gap * gap, gap * speed, gap * closing]


@dataclass(frozen=True)
class Grid:
    """What the atoms of a recording share with those of its twins: bin edges, lanes, pivot speed (m/s)."""

    place: Floats
    time: Floats
    lanes: Floats
    pivot: float


def grid_of(windows: w.Windows) -> Grid:
    """Return the grid of a recording."""
    seen = windows.seen[:, w.LEAD : -1]
    return Grid(
        edges_of(seen[:, :, w.X], PLACE_BIN), edges_of(seen[:, :, w.TIME], TIME_BIN), np.unique(seen[:, :, w.LANE]),
        float(seen[:, :, w.V].mean()),
    )  # fmt: skip


class Answer(NamedTuple):
    """Rollouts at a fit: their linear model, their response to pulses of acceleration, their state by frame."""

    line: Linear
    response: Floats
    state: Floats


def answer_of(windows: w.Windows, fit: Fit) -> Answer:
    """Return what the rollouts of windows do at a fit."""
    return Answer(linearise(windows, fit), *ro.respond(windows.seen, windows.driver, fit.theta, fit.by_lane))


def build(windows: w.Windows, fit: Fit, answer: Answer, grid: Grid) -> tuple[list[Atom], Floats]:
    """Return the atoms and their columns ``(windows, moments, atoms)``."""
    blocks = [*_linear(windows, answer.state, grid), *_scanned(windows, answer.state, grid)]
    return _with_secants(windows, fit, answer, (*SECANT_ATOMS, *local_atoms(fit.by_lane)), blocks)


def build_local(windows: w.Windows, fit: Fit, answer: Answer, grid: Grid) -> tuple[list[Atom], Floats]:
    """Return, as :func:`build`, the accepted magnitudes' own atoms only, and the car-following's form."""
    every = _linear(windows, answer.state, grid)
    blocks = [block for block in every if block[0][0].name.startswith((*INSTANT, GUARD))]
    return _with_secants(windows, fit, answer, local_atoms(fit.by_lane), blocks)


Block = tuple[list[Atom], Floats]  # atoms, and their accelerations as means over pulses (windows, pulses, atoms)


def _linear(windows: w.Windows, state: Floats, grid: Grid) -> list[Block]:
    """Return the effects that add to the acceleration, and the car-following's form."""
    fields = linear_fields(windows, state, grid.pivot)
    form = {f"{GUARD}{n}": field for n, field in enumerate(form_fields(windows, state, grid.pivot))}
    pivot = ((slots.SPEED_HEADWAY, 1.0), (slots.PIVOT_SPEED, grid.pivot))
    fixed = {"speed_dependent_headway": pivot}
    return [
        ([Atom(name, fixed=fixed.get(name, ()))], pulse_means(field)[:, :, None])
        for name, field in {**fields, **form}.items()
    ]


def _scanned(windows: w.Windows, state: Floats, grid: Grid) -> list[Block]:
    """Return lanes, places and times, bin by bin."""
    seen = windows.seen[:, w.LEAD : -1]
    place = numbered(np.clip(state[:, :, ro.BASE_X], grid.place[0], grid.place[-1] - 1e-6), grid.place)
    time = numbered(seen[:, :, w.TIME], grid.time)
    lanes = grid.lanes if len(grid.lanes) > 1 else grid.lanes[:0]
    lane = np.searchsorted(grid.lanes, seen[:, :, w.LANE]) if len(lanes) else np.full(time.shape, -1)
    by_lane = [Atom("desired_speed", lane=int(number)) for number in lanes]
    by_place = [Atom("location", low=low, high=high) for low, high in itertools.pairwise(grid.place)]
    by_time = [Atom("time_of_day", low=low, high=high) for low, high in itertools.pairwise(grid.time)]
    return [
        (by_lane, pulses_by_bin(lane, len(by_lane), state[:, :, ro.BY_V0])),
        (by_place, pulses_by_bin(place, len(by_place))),
        (by_time, pulses_by_bin(time, len(by_time), state[:, :, ro.BY_T])),
    ]


def _with_secants(
    windows: w.Windows, fit: Fit, answer: Answer, secants: Iterable[Atom], blocks: list[Block]
) -> tuple[list[Atom], Floats]:
    """Return linear atoms and secants, and the columns of both."""
    atoms = [atom for block in blocks for atom in block[0]]
    columns = [answer.response @ np.concatenate([block[1] for block in blocks], axis=2)]
    for atom in secants:
        moved = ro.positions(windows, fit.theta, with_atom(fit.by_lane, atom))
        atoms.append(atom)
        columns.append(((moved - answer.line.simulated) / atom.size)[:, :, None])
    return atoms, np.concatenate(columns, axis=2)


def _secant_atoms() -> tuple[Atom, ...]:
    """Return the atoms of effects that are not linear near zero."""
    atoms = [Atom(name, size, ((slot, size),)) for name, slot, sizes in SECANTS for size in sizes]
    for recovery in RECOVERIES:
        fixed = ((slots.RELAXATION, RELAXATION_SIZE), (slots.RELAXATION_TIME, recovery))
        atoms.append(Atom("lane_change_relaxation", RELAXATION_SIZE, fixed))
    return tuple(atoms)


SECANT_ATOMS = _secant_atoms()
LOCAL = "local:"  # marks an atom that is a small step of a magnitude already accepted


def local_atoms(by_lane: Floats) -> list[Atom]:
    """Return a small step for each accepted magnitude, linear or not."""
    atoms = []
    for effect in CATALOGUE:
        if not effect.parameters:
            continue
        first = effect.parameters[0]
        value = by_lane[0, first.slot]
        if value != 0.0:
            size = 0.25 * max(abs(value), 0.5 * first.typical)
            fixed = [(first.slot, size)]
            if first.slot == slots.RELAXATION:
                fixed.append((slots.RELAXATION_TIME, float(by_lane[0, slots.RELAXATION_TIME])))
            atoms.append(Atom(LOCAL + effect.name, size, tuple(fixed)))
    return atoms


def with_atom(by_lane: Floats, atom: Atom) -> Floats:
    """Return the magnitudes with the atom's on top (added to the accepted magnitude; companions set)."""
    moved = by_lane.copy()
    for number, (slot, value) in enumerate(atom.fixed):
        moved[:, slot] = moved[:, slot] + value if number == 0 else value
    return moved
