"""Names of the columns of a :class:`~idm_sumo.recordings.recording.Recording`, one constant each.

Coordinates are right-handed and the same as in the SUMO network and in the bicycle model:
``x`` runs downstream from the start of the section, ``y`` to the left, and the left edge of
lane 1 is ``y = 0``, so every lane has negative ``y``. The reference point of a vehicle is
the centre of its front bumper, as in NGSIM and in SUMO.
"""

PERIOD = "period"  # label of the recording period; vehicle numbers are unique within one
VEHICLE = "vehicle"  # number of the vehicle
FRAME = "frame"  # number of the frame, FRAME_STEP apart
TIME = "time"  # s, since 1970 (UTC) for NGSIM, since the start of the run for SUMO
X = "x"  # m, downstream, front bumper
Y = "y"  # m, to the left, front bumper's centre
SPEED = "speed"  # m/s, along the road
ACCELERATION = "acceleration"  # m/s^2, along the road
HEADING = "heading"  # rad, 0 along the road, positive to the left
LENGTH = "length"  # m, NaN where not recorded
WIDTH = "width"  # m, NaN where not recorded
CLASS = "vehicle_class"  # MOTORCYCLE, CAR or TRUCK, 0 not recorded
LANE = "lane"  # 1 leftmost; side lanes by their numbers of the recording's road
LEADER = "leader"  # number of the recorded leader, 0 for none or not recorded
HEADWAY = "headway"  # m, own front to the leader's front, NaN for none or not recorded

# Beside them in the table of a smoothed recording: positions (m) before smoothing, so that what was seen at a frame can
# be told without what came after it.
RAW_X, RAW_Y = "raw_x", "raw_y"

FRAME_STEP = 0.1  # s between frames

MOTORCYCLE, CAR, TRUCK = 1, 2, 3  # vehicle classes, as in NGSIM

KEYS = (PERIOD, VEHICLE, FRAME)
ALL = (
    PERIOD, VEHICLE, FRAME, TIME, X, Y, SPEED, ACCELERATION, HEADING,
    LENGTH, WIDTH, CLASS, LANE, LEADER, HEADWAY,
)  # fmt: skip
