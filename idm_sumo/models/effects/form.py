"""The forms in which a diagnosis looks for an effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

POSITION, TIME, LANE = "position", "time", "lane"  # along which an effect may be confined


class Moments(NamedTuple):
    """What drivers did and saw, arrays of shape ``(windows, frames)``.

    Attributes
    ----------
    by_headway, by_desired_speed : float64 array
        Derivatives of the simulated acceleration by the logarithms of time headway and desired speed (m/s²).
    acceleration, speed, position, gap : float64 array
        Simulated (m/s², m/s, m, m).
    time : float64 array
        Since the first frame of the period (s).
    leader_speed, leader_acceleration, leader_acceleration_mean : float64 array
        Of the leader; the last is the mean of the last seconds (m/s, m/s²).
    leader_class, own_class, lane : float64 array
        As in the recording.
    adjacent_speed, next_adjacent_speed, rear_gap, until_cut_in, until_own_change : float64 array
        As in :class:`~idm_sumo.models.effects.acceleration.Stimuli`.
    mean_speed, lanes, begin, end : float
        Mean speed (m/s), number of lanes, first and last time (s) of the recording.
    """

    by_headway: Floats
    by_desired_speed: Floats
    acceleration: Floats
    speed: Floats
    position: Floats
    gap: Floats
    time: Floats
    leader_speed: Floats
    leader_acceleration: Floats
    leader_acceleration_mean: Floats
    leader_class: Floats
    own_class: Floats
    lane: Floats
    adjacent_speed: Floats
    next_adjacent_speed: Floats
    rear_gap: Floats
    until_cut_in: Floats
    until_own_change: Floats
    mean_speed: float
    lanes: float
    begin: float
    end: float


@dataclass(frozen=True)
class Form:
    """One form of an effect.

    Attributes
    ----------
    slot : int
        Of the magnitude in :mod:`idm_sumo.models.effects.slots`.
    field : callable or None
        From :class:`Moments` to the acceleration (m/s²) for a unit of the magnitude; None where the effect is not
        linear near zero.
    size : float
        Magnitude at which the effect is compared with none, where it is not linear.
    fixed : tuple of (int, float)
        Slots and values of the companion parameters.
    of_recording : tuple of (int, str)
        Slots of companions that are attributes of :class:`Moments`: ``mean_speed``, ``lanes``, ``begin`` or ``end``.
    along : str
        ``position``, ``time`` or ``lane`` if the effect is confined to a part of it, else empty.
    bounds : tuple of int
        Slots of that part's begin and end, or of the lane.
    selection : float
        Magnitude (standard deviation) that the choices of other drivers make where the effect is absent.
    """

    slot: int
    field: Callable[[Moments], Floats] | None = None
    size: float = 1.0
    fixed: tuple[tuple[int, float], ...] = ()
    of_recording: tuple[tuple[int, str], ...] = ()
    along: str = ""
    bounds: tuple[int, ...] = ()
    selection: float = 0.0
