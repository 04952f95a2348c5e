"""What is asked of a recording: groups of columns, each of an effect, of a free field, or of the law."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import windows as w
from idm_sumo.models.effects.form import POSITION, TIME, Form

Floats = npt.NDArray[np.float64]

WIDTH = {POSITION: 16.0, TIME: 12.0}  # m, s: of the bins of a catalogued place or time
MOST_BINS, FREE_BINS, BLOCKS, QUANTILES = 48, 16, 6, 4
# of them; of a free one; of each side of a rectangle; of a covariate
MOVING = f"{POSITION} and {TIME}, moving at "  # how the axes of bands that move along the road are named
MISFIT, SWING = "misfit", "swing"  # names of the law's own misfit and of drivers' own swings
PERIODS = np.geomspace(4.0, 30.0, 24)  # s, of swings


def _powers() -> tuple[tuple[int, int, int], ...]:
    """Return exponents of speed, approach rate and gap; linear terms are the driver's own parameters."""
    each = itertools.product(range(4), range(4), range(4))
    return tuple((a, b, c) for a, b, c in each if 2 <= a + b + c <= 3)


BASIS = _powers()


class Axis(NamedTuple):
    """Bins along one covariate."""

    name: str
    edges: Floats

    @property
    def is_scanned(self) -> bool:
        """Whether it is of places or times, which are looked through from one end to the other."""
        return self.name in WIDTH or self.name.startswith(MOVING)


@dataclass(frozen=True)
class Group:
    """Columns that belong together: one, or one for each bin.

    Attributes
    ----------
    name : str
        Effect, empty for a free field, :data:`MISFIT` for the law's, :data:`SWING` for drivers' own.
    form : Form or None
        Of an effect.
    content : str
        What is different in a free field.
    axes : tuple of Axis
        Along which it is cut.
    lane : int
        The only lane, 0 for all.
    period : int
        The only period, -1 for all.
    present : bool
        Whether the effect is in the model already: a column for a little more of it.
    first : int
        Number of the first column.
    """

    name: str
    form: Form | None = None
    content: str = ""
    axes: tuple[Axis, ...] = ()
    lane: int = 0
    period: int = -1
    present: bool = False
    first: int = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of bins along each axis."""
        return tuple(len(axis.edges) - 1 for axis in self.axes)

    @property
    def count(self) -> int:
        """Number of columns."""
        if self.name == MISFIT:
            return len(BASIS) + 1
        return 2 * len(PERIODS) if self.name == SWING else int(np.prod(self.shape, dtype=np.int64))

    @property
    def of_lane(self) -> bool:
        """Whether it is an effect that acts everywhere in one lane only."""
        return bool(self.lane) and not self.axes

    @property
    def is_secant(self) -> bool:
        """Whether its column is a difference of rollouts of its own: what it does at its size a little of it does not say."""
        return self.form is not None and self.form.field is None and not self.of_lane

    @property
    def competes(self) -> bool:
        """Whether there are hypotheses about it."""
        return self.name not in (MISFIT, SWING)

    @property
    def is_free(self) -> bool:
        """Whether it belongs to no effect."""
        return not self.name


@dataclass(frozen=True)
class Plan:
    """All columns of a recording, the same for its replicates."""

    groups: tuple[Group, ...]
    speed: float
    lanes: tuple[int, ...]
    span: tuple[float, float]

    @property
    def count(self) -> int:
        """Number of columns."""
        return sum(group.count for group in self.groups)

    def only(self, groups: Iterable[Group]) -> Plan:
        """Return the plan of some of the groups, numbered anew."""
        groups = list(groups)
        begins = np.cumsum([0, *(group.count for group in groups)])
        return replace(self, groups=tuple(replace(g, first=int(n)) for g, n in zip(groups, begins, strict=False)))

    def of(self, name: str) -> npt.NDArray[np.int64]:
        """Return the numbers of the columns of a name."""
        return np.array([k for g in self.groups if g.name == name for k in range(g.first, g.first + g.count)], np.int64)


def periods_of(windows: w.Windows) -> int:
    """Return the number of periods."""
    return len(np.unique(windows.period))


def coarser(edges: Floats, most: int) -> Floats:
    """Return at most so many even bins over the same length."""
    return np.linspace(edges[0], edges[-1], min(most + 1, len(edges)))
