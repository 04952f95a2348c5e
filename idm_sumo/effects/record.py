"""What is known of an effect before any data is seen: :class:`Effect` and its :class:`Parameter`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class Parameter(NamedTuple):
    """One number of an effect.

    Attributes
    ----------
    symbol, unit : str
    slot : int
        Its place in the flat vector of magnitudes (:mod:`idm_sumo.effects.slots`).
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
    must_see : tuple of str
        Fields of :class:`~idm_sumo.effects.acceleration.Sight` (beside gap and leader's speed) that a
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
