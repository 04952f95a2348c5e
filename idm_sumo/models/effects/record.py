"""What is known of an effect before any data is seen: :class:`Effect` and its :class:`Parameter`."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt


def in_words(value: float, unit: str, digits: int = 3) -> str:
    """Return a number to some digits with its unit, none where that is 1, and "per 10 m/s" where it is "1 per 10 m/s"."""
    said = "" if unit in ("1", "number") else unit.removeprefix("1 ")
    return f"{value:.{digits}g} {said}".rstrip()


class Parameter(NamedTuple):
    """One number of an effect.

    Attributes
    ----------
    symbol, unit : str
    slot : int
        Its place in the flat vector of magnitudes (:mod:`idm_sumo.models.effects.slots`).
    lower, upper : float
        Bounds of every fit.
    typical : float
        A size met in the literature; also the step of a secant.
    """

    symbol: str
    unit: str
    slot: int
    lower: float
    upper: float
    typical: float

    @property
    def is_share(self) -> bool:
        """Whether it is a share, of a time headway for a place or a time, and no acceleration."""
        return self.unit == "1"


@dataclass(frozen=True)
class Effect:
    """One thing that drivers do beyond the IDM.

    Attributes
    ----------
    name : str
        The catalogue's spelling.
    summary : str
        What the driver does, in a few words.
    parameters : tuple of Parameter
        The first is the magnitude: at zero the effect is not there. Empty for what is not behaviour.
    instead : Parameter or None
        A magnitude of another kind, which may act in place of the first.
    must_see : tuple of str
        Fields of :class:`~idm_sumo.models.effects.acceleration.Sight` (beside gap and leader's speed) that a
        recording must show for the effect to be testable.
    confusable_with : tuple of str
        Catalogue names.
    source : str
    hindsight : bool
        Whether it rests on what comes later in the recording: a replay can have it, a forecast cannot.
    sumo : str or None
        How plain SUMO can express it; None where only the Python-driven loop can.
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]
    must_see: tuple[str, ...]
    confusable_with: tuple[str, ...]
    source: str
    sumo: str | None = None
    hindsight: bool = False
    instead: Parameter | None = None

    @property
    def every(self) -> tuple[Parameter, ...]:
        """All parameters, of whatever form."""
        return self.parameters if self.instead is None else (*self.parameters, self.instead)

    def named_by(self, symbols: Container[str]) -> tuple[Parameter, ...]:
        """Return the parameters of the form that some symbols speak of, its magnitude first."""
        if self.instead is None or self.instead.symbol not in symbols:
            return self.parameters
        return (self.instead, *self.parameters[1:])

    def acting(self, m: npt.NDArray[np.float64]) -> tuple[Parameter, ...]:
        """Return the parameters of the form that acts in a vector of magnitudes, its magnitude first."""
        return self.named_by({p.symbol for p in self.every if m[p.slot] != 0.0})
