"""The US-101 study section in numbers: the only place that knows its geometry."""

import numpy as np
import numpy.typing as npt

FOOT = 0.3048  # m, exactly
FRAME_STEP = 0.1  # s

LANE_WIDTH = 12 * FOOT
MAIN_LANES = 5
AUXILIARY_LANE = 6
ON_RAMP_LANE = 7
OFF_RAMP_LANE = 8

SECTION_LENGTH = 2100 * FOOT
ON_RAMP_X = 578 * FOOT  # the Ventura on-ramp joins
OFF_RAMP_X = 1276 * FOOT  # the Cahuenga off-ramp leaves

SPEED_LIMIT = 55 * 0.44704  # m/s, 55 mph

# What is assumed of a vehicle whose size was not recorded (median of labelled US-101 cars).
CAR_LENGTH = 15.5 * FOOT
CAR_WIDTH = 6.4 * FOOT


def lane_center(lane: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the ``y`` (m) of the middle of each lane, 1 leftmost."""
    return -(np.asarray(lane, dtype=np.float64) - 0.5) * LANE_WIDTH


def lane_at(y: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """Return the main lane, 1 to 5, that holds lateral position ``y`` (m); clipped at the edges."""
    index = np.floor(-np.asarray(y, dtype=np.float64) / LANE_WIDTH).astype(np.int64) + 1
    return np.clip(index, 1, MAIN_LANES)
