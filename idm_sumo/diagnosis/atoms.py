"""Atoms: what a little of each effect does to the rollouts, one column each.

What adds to the acceleration, or changes the time headway or the desired speed, goes through the linear response to pulses;
what is not linear near zero (delay, second leader, relaxation, dead band) is a secant at several sizes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import free_fields
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
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

    ``low`` and ``high`` bound a bin of place, time or, for a free field, of its covariate.
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


GUARD = "form:"  # begins the names of what another car-following model underneath would look like
INSTANT = ("acceleration_asymmetry", "speed_dependent_headway", "perception_threshold")


def form_fields(windows: w.Windows, state: Floats, pivot: float) -> list[Floats]:
    """Return smooth accelerations of speed, gap and approach rate, second order: the form of the car-following itself."""
    seen = windows.seen[:, w.LEAD : -1]
    v = state[:, :, ro.BASE_V]
    speed, closing = (v - pivot) / SPEED_UNIT, (v - seen[:, :, w.SPEED]) / 3.0
    gap = np.log(np.maximum(seen[:, :, w.REAR] - state[:, :, ro.BASE_X], 1.0) / (2.0 + 1.2 * v))
    return [speed * speed, closing * closing, speed * closing, gap * gap, gap * speed, gap * closing]


def edges_of(values: Floats, width: float) -> Floats:
    """Return bin edges of about ``width`` that cover the values."""
    low, high = float(values.min()), float(values.max())
    return np.linspace(low, high + 1e-9, max(2, round((high - low) / width) + 1))


def binned(values: Floats, edges: Floats) -> Iterable[tuple[float, float, npt.NDArray[np.bool_]]]:
    """Yield low and high edge of each bin and where the values are in it."""
    number = np.digitize(values, edges) - 1
    for k in range(len(edges) - 1):
        yield edges[k], edges[k + 1], number == k


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


def build(windows: w.Windows, fit: Fit, simulated: Floats, grid: Grid) -> tuple[list[Atom], Floats, Floats, Floats]:
    """Return the atoms, their columns ``(windows, moments, atoms)``, the response to pulses and the base state."""
    response, state = ro.respond(windows.seen, windows.driver, fit.theta, fit.by_lane)
    seen = windows.seen[:, w.LEAD : -1]
    atoms, fields = [], []
    for name, field in linear_fields(windows, state, grid.pivot).items():
        atoms.append(Atom(name))
        fields.append(pulse_means(field))
    for lane in grid.lanes if len(grid.lanes) > 1 else []:
        atoms.append(Atom("desired_speed", lane=int(lane)))
        fields.append(pulse_means(state[:, :, ro.BY_V0] * (seen[:, :, w.LANE] == lane)))
    for low, high, inside in binned(np.clip(state[:, :, ro.BASE_X], grid.place[0], grid.place[-1] - 1e-6), grid.place):
        atoms.append(Atom("location", low=low, high=high))
        fields.append(pulse_means(inside.astype(np.float64)))
    for low, high, inside in binned(seen[:, :, w.TIME], grid.time):
        atoms.append(Atom("time_of_day", low=low, high=high))
        fields.append(pulse_means(inside * state[:, :, ro.BY_T]))
    for number, field in enumerate(form_fields(windows, state, grid.pivot)):
        atoms.append(Atom(f"{GUARD}{number}"))
        fields.append(pulse_means(field))
    for name, low, high, field in free_fields.fields(windows, state, grid.place, grid.time, grid.lanes):
        atoms.append(Atom(free_fields.FREE + name, low=low, high=high))
        fields.append(pulse_means(field))
    columns = [response @ np.stack(fields, axis=2)]
    for atom in (*SECANT_ATOMS, *local_atoms(fit.by_lane)):
        moved = ro.positions(windows, fit.theta, with_atom(fit.by_lane, atom))
        atoms.append(atom)
        columns.append(((moved - simulated) / atom.size)[:, :, None])
    return atoms, np.concatenate(columns, axis=2), response, state


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
