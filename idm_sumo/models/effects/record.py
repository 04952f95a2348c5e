"""The record of an effect, and of its parameters."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.models.effects.form import Form
from idm_sumo.models.effects.telling import Telling


def format_quantity(value: float, unit: str, digits: int = 3) -> str:
    """Format a number with its unit.

    A unit of 1 is not shown, and "1 per 10 m/s" is written "per 10 m/s".

    Parameters
    ----------
    value : float
        Number.
    unit : str
        Unit as in :class:`Parameter`.
    digits : int
        Significant digits.

    Returns
    -------
    str
        Text such as ``0.4 s``.
    """
    said = "" if unit in ("1", "number") else unit.removeprefix("1 ")
    return f"{value:.{digits}g} {said}".rstrip()


class Parameter(NamedTuple):
    """One parameter of an effect.

    Attributes
    ----------
    symbol, unit : str
        Spelling in files; ``1`` for a number without unit.
    slot : int
        Position in the flat vector of magnitudes (:mod:`idm_sumo.models.effects.slots`).
    lower, upper : float
        Bounds of every fit.
    typical : float
        A value met in the literature; also the step of numerical derivatives.
    """

    symbol: str
    unit: str
    slot: int
    lower: float
    upper: float
    typical: float

    @property
    def is_share(self) -> bool:
        """Whether it is a share rather than an acceleration."""
        return self.unit == "1"


@dataclass(frozen=True)
class Effect:
    """A deviation of drivers from the IDM.

    Attributes
    ----------
    name : str
        Name in the catalogue.
    summary : str
        What the driver does, in a few words.
    parameters : tuple of Parameter
        The first is the magnitude; at zero the effect is absent. Empty for what is not behaviour.
    required_stimuli : tuple of str
        Fields of :class:`~idm_sumo.models.effects.acceleration.Stimuli`, beside gap and the leader's speed,
        that a recording must hold for the effect to be testable.
    confusable_with : tuple of str
        Names of effects that look alike.
    source : str
        Literature.
    sumo : str or None
        How plain SUMO can express it; None where only the loop driven from Python can.
    hindsight : bool
        Whether it depends on what comes later in the recording. Then a replay can use it, a forecast cannot.
    alternative : Parameter or None
        A magnitude of another kind, which may act in place of the first.
    forms : tuple of Form
        In which a diagnosis looks for it; empty if it cannot.
    between : bool
        Whether it differs between drivers more than within one, so that fitted drivers carry part of it.
    untestable : str
        Why recordings of this kind cannot show it, if they cannot.
    told : tuple of Telling
        How it is told to a person, one for each magnitude.
    """

    name: str
    summary: str
    parameters: tuple[Parameter, ...]
    required_stimuli: tuple[str, ...]
    confusable_with: tuple[str, ...]
    source: str
    sumo: str | None = None
    hindsight: bool = False
    alternative: Parameter | None = None
    forms: tuple[Form, ...] = ()
    between: bool = False
    untestable: str = ""
    told: tuple[Telling, ...] = ()

    @property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """All parameters, of both forms."""
        return self.parameters if self.alternative is None else (*self.parameters, self.alternative)

    def named_by(self, symbols: Container[str]) -> tuple[Parameter, ...]:
        """Return the parameters of the form that symbols name.

        Parameters
        ----------
        symbols : container of str
            Symbols of the parameters in use.

        Returns
        -------
        tuple of Parameter
            The magnitude first.
        """
        if self.alternative is None or self.alternative.symbol not in symbols:
            return self.parameters
        return (self.alternative, *self.parameters[1:])

    def acting(self, m: npt.NDArray[np.float64]) -> tuple[Parameter, ...]:
        """Return the parameters of the form that is active.

        Parameters
        ----------
        m : float64, shape (slots.COUNT,)
            Magnitudes of the effects.

        Returns
        -------
        tuple of Parameter
            The magnitude first.
        """
        return self.named_by({p.symbol for p in self.all_parameters if m[p.slot] != 0.0})
