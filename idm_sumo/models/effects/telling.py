"""How an effect is told, in engineering units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import NamedTuple

KMH = 3.6  # km/h in a m/s


class Median(NamedTuple):
    """The median driver of a model, to whom sizes refer.

    Attributes
    ----------
    headway : float
        Time headway (s).
    jam_distance : float
        Gap at standstill (m).
    desired_speed : float
        Desired speed (m/s).
    """

    headway: float
    jam_distance: float
    desired_speed: float


Values = Mapping[str, float]
Size = Callable[[Values, Median], str]
NO_SITUATION: Values = MappingProxyType({})


class Telling(NamedTuple):
    """What a person reads of an effect of one magnitude.

    Attributes
    ----------
    symbol : str
        Of the magnitude.
    more, less : str
        What drivers do where it is above and below zero, to follow the word "Drivers".
    when : str
        In what situation, to follow "This happens"; empty for always.
    size : callable
        From the cause's values by symbol, and the median driver, to a size in engineering units.
    advice : str
        What to do in a calibration; one sentence.
    situation : mapping of str to float
        Fields of :class:`~idm_sumo.models.effects.acceleration.Stimuli` with which a picture shows it.
    """

    symbol: str
    more: str
    less: str
    when: str
    size: Size
    advice: str
    situation: Values = NO_SITUATION


def of_headway(symbol: str) -> Size:
    """Return the size of a share of the time headway.

    Parameters
    ----------
    symbol : str
        Of the magnitude.

    Returns
    -------
    callable
        Gives text such as ``time headway 1.4 → 1.9 s``.
    """
    return lambda values, one: f"time headway {one.headway:.2f} → {one.headway * (1.0 + values[symbol]):.2f} s"


def of_acceleration(symbol: str, sign: float = 1.0) -> Size:
    """Return the size of an added acceleration.

    Parameters
    ----------
    symbol : str
        Of the magnitude.
    sign : float
        -1 where the magnitude is a deceleration.

    Returns
    -------
    callable
        Gives text such as ``acceleration lower by 0.12 m/s²``.
    """

    def size(values: Values, _one: Median) -> str:
        added = sign * values[symbol]
        return f"acceleration {'higher' if added > 0.0 else 'lower'} by {abs(added):.2f} m/s²"

    return size


def of_desired_speed(symbol: str) -> Size:
    """Return the size of a share of the desired speed.

    Parameters
    ----------
    symbol : str
        Of the magnitude.

    Returns
    -------
    callable
        Gives text such as ``desired speed 100 → 90 km/h``.
    """

    def size(values: Values, one: Median) -> str:
        before = KMH * one.desired_speed
        return f"desired speed {before:.0f} → {before * (1.0 + values[symbol]):.0f} km/h"

    return size
