"""The road as compiled kernels of features take it."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.evaluation.risk import LENGTH_SCALE, WIDTH_SCALE
from idm_sumo.roads import Road

Floats = npt.NDArray[np.float64]


class Ground(NamedTuple):
    """Numbers of a road.

    Attributes
    ----------
    markings : float64, shape (lanes + 1,)
        ``y`` of the lanes' edges from left to right (m).
    middles, widths : float64, shape (lanes,)
        ``y`` of each lane's middle, and its width (m).
    width : float
        Of all lanes together (m).
    speed_limit : float
        m/s.
    full_risk : float
        Risk of two cars of usual size in the same place, where the collision feature is -1.
    """

    markings: Floats
    middles: Floats
    widths: Floats
    width: float
    speed_limit: float
    full_risk: float

    @classmethod
    def of(cls, road: Road) -> Ground:
        """Return the numbers of a road.

        Parameters
        ----------
        road : Road

        Returns
        -------
        Ground
        """
        lanes = np.arange(1, road.main_lanes + 1)
        full_risk = 1.0 / (4.0 * pi * LENGTH_SCALE * road.car_length * WIDTH_SCALE * road.car_width)
        markings = np.array(road.markings)
        return cls(markings, road.lane_center(lanes), road.lane_width(lanes), road.width, road.speed_limit, full_risk)
