"""Effects in the model: put there, taken out again, and what they leave to compete for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.fit import Fit, improve
from idm_sumo.diagnosis.library import Library, magnitude_of
from idm_sumo.diagnosis.rollout import ROWS
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models.effects import BY_NAME, Parameter
from idm_sumo.models.effects.form import Form

Floats = npt.NDArray[np.float64]

STEPS = 4  # of a fit to changed magnitudes


@dataclass(frozen=True)
class Placed:
    """An effect that is in the model.

    Attributes
    ----------
    name : str
    form : Form
    edges : mapping of str to (float, float)
        From where to where along each axis.
    lane : int
        The only lane, 0 for all.
    value, error : float
        Magnitude, and its standard error.
    """

    name: str
    form: Form
    edges: Mapping[str, tuple[float, float]]
    lane: int
    value: float
    error: float = np.nan

    @property
    def magnitude(self) -> Parameter:
        """Its first parameter."""
        return magnitude_of(pl.Group(self.name, self.form))

    @property
    def at_bound(self) -> bool:
        """Whether its magnitude is at a bound of what is searched."""
        first = self.magnitude
        return not first.lower < self.value < first.upper

    def is_like(self, other: Placed) -> bool:
        """Return whether another one is of the same form, place and time."""
        return (self.name, self.form, self.lane, dict(self.edges)) == (
            other.name, other.form, other.lane, dict(other.edges),
        )  # fmt: skip


def placed_of(library: Library, hypothesis: int, value: float, now: Sequence[Placed]) -> Placed:
    """Return a hypothesis with a magnitude, as an effect to put into the model."""
    group = library.group_of(hypothesis)
    assert group.form is not None
    first = magnitude_of(group)
    value = float(np.clip(value, first.lower, first.upper))
    if group.present:
        there = next(one for one in now if one.name == group.name)
        return replace(there, value=value)
    return Placed(group.name, group.form, library.edges(hypothesis), group.lane, value)


def with_effects(base: Fit, effects: Sequence[Placed], plan: pl.Plan) -> Fit:
    """Return the fit with these effects, and no others, in its magnitudes; the drivers not yet refitted."""
    by_lane = base.by_lane.copy()
    for effect in BY_NAME.values():
        for parameter in effect.all_parameters:
            by_lane[:, parameter.slot] = 0.0
    of_recording = {
        "mean_speed": plan.speed,
        "lanes": float(max(plan.lanes)),
        "begin": plan.span[0],
        "end": plan.span[1],
    }
    for one in effects:
        lane = int(one.edges["lane"][0] + 0.5) if "lane" in one.edges else one.lane
        rows = np.arange(len(by_lane)) % ROWS == lane if one.lane else np.ones(len(by_lane), bool)
        by_lane[rows, one.form.slot] = one.value
        for slot, value in one.form.fixed:
            by_lane[rows, slot] = value
        for slot, name in one.form.of_recording:
            by_lane[rows, slot] = of_recording[name]
        ends = (float(lane),) if "lane" in one.edges else one.edges.get(one.form.along, ())
        for slot, end in zip(one.form.bounds, ends, strict=True):
            by_lane[rows, slot] = end
    return replace(base, by_lane=by_lane, rolled=None)


def refitted(windows: Windows, fit: Fit) -> Fit:
    """Return the fit with drivers, population and noise adapted to its magnitudes.

    Likelihoods are compared of fits that have taken equally many steps from the same one: the noise's covariance goes on
    changing a little at every step, which says nothing of what was put into the model.
    """
    for _ in range(STEPS):
        fit = improve(windows, fit)
    return fit


def present_columns(plan: pl.Plan, effects: Sequence[Placed]) -> list[int]:
    """Return the numbers of the columns of effects in the model."""
    first = {group.name: group.first for group in plan.groups if group.present}
    return [first[one.name] for one in effects]


def whole_score(evidence: Evidence, effects: Sequence[Placed]) -> Floats:
    """Return the scores as if no effect were in the model yet: what is in it competes anew."""
    if not effects:
        return evidence.score
    columns = present_columns(evidence.plan, effects)
    return np.asarray(evidence.score + evidence.gram[:, columns] @ np.array([one.value for one in effects]))
