r"""Sizes by driving: how likely the recording is with an effect at each size, all drivers adapted to it.

A column says what a little of an effect does. At the size of a real one drivers absorb and give back what no straight line does, so
that what is in the model is judged by its likelihood at the size reached, less the slope that null replicates show.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.diagnosis.model import Placed, refitted, with_effects
from idm_sumo.diagnosis.windows import Windows

Floats = npt.NDArray[np.float64]

State = tuple[float, Fit, tuple[Placed, ...]]  # log-likelihood, fit, and the effects in it

FIRST, GROWTH, MOST, SHORT = 0.5, 2.0, 16.0, 0.25
# size tried first, of the typical one; then its multiples: by, to, or less
BETTER = 0.5  # of a log-likelihood: less is no reason to go on
NEARER = 0.2  # of a size, by which it is moved once others are beside it


@dataclass(frozen=True)
class Driven:
    """Effects at their likeliest sizes, the last one judged.

    Attributes
    ----------
    effects : tuple of Placed
    total : float
        Log-likelihood over that without the last effect, less what null replicates show.
    slope : float
        Of what they show, by the last effect's size.
    """

    effects: tuple[Placed, ...]
    total: float
    slope: float

    @property
    def last(self) -> Placed:
        """The effect that is judged."""
        return self.effects[-1]


@dataclass(frozen=True)
class Road:
    """A recording, and a fit from which drivers adapt to whatever effects are put into the model."""

    windows: Windows
    start: Fit
    plan: pl.Plan

    def fitted(self, effects: Sequence[Placed]) -> Fit:
        """Return drivers, population and noise fitted beside some effects."""
        return refitted(self.windows, with_effects(self.start, effects, self.plan))

    def driven(self, effects: Sequence[Placed]) -> tuple[Floats, Fit]:
        """Return how likely each driver is with some effects, and the fit."""
        fit = self.fitted(effects)
        return log_likelihood(self.windows, fit), fit

    def sized(self, rest: Sequence[Placed], one: Placed, slope: float, without: Floats) -> Driven:
        """Return an effect at its likeliest size beside others; how likely drivers are without it is known."""

        def at(value: float) -> float:
            likely, _ = self.driven([*rest, replace(one, value=value)])
            return float((likely - without).sum()) - slope * value

        curve = _climbed(at, one)
        best = max((value for value in curve if value), key=lambda value: curve[value])
        return Driven((*rest, replace(one, value=best)), curve[best], slope)

    def likeliest(self, rest: Sequence[Placed], forms: Sequence[tuple[Placed, float]], without: Floats) -> int:
        """Return which of several forms of an effect, each with its size and slope, is likeliest as it is driven."""
        if len(forms) == 1:
            return 0
        total = [float((self.driven([*rest, one])[0] - without).sum()) - slope * one.value for one, slope in forms]
        return int(np.argmax(total))

    def together(self, effects: Sequence[Placed], slopes: Sequence[float]) -> tuple[Fit, tuple[Placed, ...]]:
        """Return effects at their likeliest sizes once all are in the model, each moved in turn."""
        effects = tuple(effects)
        likely, fit = self.driven(effects)
        now: State = (float(likely.sum()), fit, effects)
        for n, slope in enumerate(slopes if len(effects) > 1 else ()):
            now = self._moved(n, slope, now)
        return now[1], now[2]

    def _moved(self, number: int, slope: float, now: State) -> State:
        """Return one effect nearer to its likeliest size beside the others."""
        effects, one = now[2], now[2][number]
        states, curve = {one.value: now}, {one.value: now[0] - slope * one.value}
        for value in (_within(one, (1.0 - NEARER) * one.value), _within(one, (1.0 + NEARER) * one.value), None):
            value = _within(one, _top(curve)) if value is None else value
            if value not in states:
                moved = (*effects[:number], replace(one, value=value), *effects[number + 1 :])
                likely, fit = self.driven(moved)
                states[value] = float(likely.sum()), fit, moved
                curve[value] = states[value][0] - slope * value
        return states[max(curve, key=lambda value: curve[value])]


def _within(one: Placed, value: float) -> float:
    first = one.magnitude
    return float(np.clip(value, first.lower, first.upper))


def _climbed(at: Callable[[float], float], one: Placed) -> dict[float, float]:
    """Return the curve of the likelihood over sizes: doubled as long as it rises, then where a parabola has its top."""
    step = FIRST * one.magnitude.typical * (float(np.sign(one.value)) or 1.0)
    curve, last = {0.0: 0.0}, 0.0
    value = _within(one, step)
    curve[value] = at(value)
    if curve[value] < 0.0:
        value = _within(one, SHORT * step)
        curve[value] = at(value)
    else:
        while value not in (last, MOST * step) and curve[value] >= curve[last] - BETTER:
            last, value = value, _within(one, GROWTH * value)
            curve.setdefault(value, at(value))
    for _ in range(2):
        value = _within(one, _top(curve))
        if min(abs(value - other) for other in curve) < 0.03 * max(abs(value), 0.1 * one.magnitude.typical):
            break
        curve[value] = at(value)
    return curve


def _around(curve: dict[float, float], best: float) -> tuple[Floats, Floats]:
    """Return the best size with its neighbours, and their likelihoods."""
    sizes = sorted(curve)
    middle = min(max(sizes.index(best), 1), len(sizes) - 2) if len(sizes) > 2 else 0
    chosen = np.array(sizes[max(middle - 1, 0) : middle + 2])
    return chosen, np.array([curve[value] for value in chosen])


def _top(curve: dict[float, float]) -> float:
    """Return where the parabola through the best size and its neighbours has its top."""
    best = max(curve, key=lambda value: curve[value])
    sizes, heights = _around(curve, best)
    if len(sizes) < 3:
        return best
    bend, tilt, _ = np.polyfit(sizes - best, heights, 2)
    if bend >= 0.0:
        return best
    return float(np.clip(best - 0.5 * tilt / bend, sizes[0], sizes[-1]))
