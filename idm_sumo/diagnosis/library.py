"""The library of hypotheses: effect, form, where or when, lane; each a mix of columns with a prior and a typical size."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis.settings import Settings
from idm_sumo.models.effects import BY_NAME, Parameter

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

WIDEST = 0.6  # of the bins of road or time: a wider interval is the rest, with the other sign
NARROWEST = {"position": 3, "time": 3}  # bins of a catalogued place or time
OF_LANES = 0.2  # of an effect's prior: that it is in one lane only


@dataclass(frozen=True)
class Library:
    """All hypotheses.

    Attributes
    ----------
    plan : Plan
    group : int64, shape (hypotheses,)
        Number of the group of columns.
    bins : tuple of tuples of (int, int)
        First and last bin (exclusive) along each axis.
    mix : sparse, shape (hypotheses, columns)
    family : int64, shape (hypotheses,)
        Number in ``names``.
    names : tuple of str
        Effects, and free fields as ``content over covariate``.
    size, selection : float64, shape (hypotheses,)
        Typical magnitude; magnitude that others' choices make.
    lower, upper : float64, shape (hypotheses,)
        Bounds of the magnitude.
    within : float64, shape (hypotheses,)
        Prior within the family; sums to one in each.
    prior : float64, shape (names,)
        Of each family; sums to one.
    """

    plan: pl.Plan
    group: Integers
    bins: tuple[tuple[tuple[int, int], ...], ...]
    mix: csr_matrix
    family: Integers
    names: tuple[str, ...]
    size: Floats
    selection: Floats
    lower: Floats
    upper: Floats
    within: Floats
    prior: Floats

    def group_of(self, number: int) -> pl.Group:
        """Return the columns that a hypothesis is a mix of."""
        return self.plan.groups[int(self.group[number])]

    def is_free(self, number: int) -> bool:
        """Return whether a hypothesis belongs to no effect."""
        return self.group_of(number).is_free

    def is_linear(self, number: int) -> bool:
        """Return whether a little of a hypothesis says what much of it does."""
        form = self.group_of(number).form
        return form is None or form.field is not None

    def best_of_forms(self, each: Floats) -> list[int]:
        """Return the hypotheses that are likeliest within their forms; minus infinity is of those that are not asked."""
        form = np.array([str(self.group_of(n).form.fixed) if np.isfinite(each[n]) else "" for n in range(len(each))])  # type: ignore[union-attr]
        return [int(np.argmax(np.where(form == one, each, -np.inf))) for one in dict.fromkeys(form) if one]

    def edges(self, number: int) -> dict[str, tuple[float, float]]:
        """Return from where to where a hypothesis lies along each axis."""
        axes = self.group_of(number).axes
        return {
            axis.name: (float(axis.edges[a]), float(axis.edges[b]))
            for axis, (a, b) in zip(axes, self.bins[number], strict=True)
        }


def magnitude_of(group: pl.Group) -> Parameter:
    """Return the parameter whose size a group of an effect gives."""
    assert group.form is not None
    return next(p for p in BY_NAME[group.name].all_parameters if p.slot == group.form.slot)


def family_name(group: pl.Group) -> str:
    """Return the effect, or what is free over which covariates."""
    if group.name:
        return group.name
    return f"{group.content} over {' and '.join(axis.name for axis in group.axes)}"


def library_of(plan: pl.Plan, settings: Settings) -> Library:
    """Return every hypothesis that the columns can express."""
    groups = [n for n, group in enumerate(plan.groups) if group.competes]
    names = tuple(dict.fromkeys(family_name(plan.groups[n]) for n in groups))
    rows, cols, of, bins, weight = [], [], [], [], []
    count = 0
    for n in groups:
        group = plan.groups[n]
        each = list(_stretches(group))
        for stretch, members in each:
            rows += [count] * len(members)
            cols += members.tolist()
            of.append(n)
            bins.append(stretch)
            weight.append((OF_LANES if group.lane and not group.is_free else 1.0) / len(each))
            count += 1
    group_of = np.array(of, np.int64)
    family = np.array([names.index(family_name(plan.groups[n])) for n in of], np.int64)
    within = np.array(weight)
    within /= np.bincount(family, within, len(names))[family]
    mix = csr_matrix((np.ones(len(rows)), (rows, cols)), shape=(count, plan.count))
    typical = np.array([_typical(plan.groups[n]) for n in of]).reshape(-1, 4)
    free = np.array([name not in BY_NAME for name in names])
    prior = np.where(free, settings.free / max(free.sum(), 1), (1.0 - settings.free) / max((~free).sum(), 1))
    size, selection, lower, upper = typical.T
    return Library(
        plan, group_of, tuple(bins), mix, family, names, size, selection, lower, upper, within, prior / prior.sum()
    )  # fmt: skip


def _typical(group: pl.Group) -> tuple[float, float, float, float]:
    """Return typical size, what others' choices make, and bounds of a group's magnitude."""
    if group.is_free:
        size = ff.TYPICAL[group.content][1]
        return size, 0.0, -6.0 * size, 6.0 * size
    parameter = magnitude_of(group)
    assert group.form is not None
    return parameter.typical, group.form.selection, parameter.lower, parameter.upper


def _stretches(group: pl.Group):  # type: ignore[no-untyped-def]
    """Yield the intervals or rectangles of a group's bins, and the columns in each."""
    numbers = group.first + np.arange(group.count).reshape(group.shape or (1,))
    if not group.axes:
        yield (), numbers.ravel()
        return
    for stretch in itertools.product(*(_intervals(axis, not group.is_free) for axis in group.axes)):
        yield stretch, numbers[tuple(slice(a, b) for a, b in stretch)].ravel()


def _intervals(axis: pl.Axis, catalogued: bool) -> list[tuple[int, int]]:
    count = len(axis.edges) - 1
    scanned = axis.is_scanned
    least = min(NARROWEST[axis.name], count) if scanned and catalogued else 1
    most = 1 if axis.name == "lane" else max(1, int(WIDEST * count) if scanned else count - 1)
    return [(a, b) for a in range(count) for b in range(a + least, min(a + max(most, least), count) + 1)]
