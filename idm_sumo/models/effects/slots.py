"""Positions in the vector of magnitudes; zeros are the IDM."""

DELAY = 0  # s
SECOND_LEADER = 1  # 1
RELAXATION = 2  # 1
RELAXATION_TIME = 3  # s
ASYMMETRY = 4  # 1
LEADER_CLASS = 5  # 1
SPEED_HEADWAY = 6  # 1 per 10 m/s
PIVOT_SPEED = 7  # m/s
BAND = 8  # m/s
HYSTERESIS = 9  # 1
FRICTION = 10  # 1/s
PLACE = 11  # m/s^2
PLACE_BEGIN = 12  # m
PLACE_END = 13  # m
PERIOD = 14  # 1
PERIOD_BEGIN = 15  # s
PERIOD_END = 16  # s
DESIRED_SPEED = 17  # 1
DESIRED_SPEED_LANE = 18  # number, 0 for every lane
OWN_CLASS = 19  # 1
MEMORY = 20  # 1
PRESSURE = 21  # m/s^2
COURTESY = 22  # 1
PRE_INSERTION = 23  # 1
OWN_SPEED_KNOWN = 24  # 1
SECOND_SPEED_ONLY = 25  # 1
NEW_LEADER_KNOWN = 26  # 1
HEADWAY_ACCEPTED = 27  # 1
PLACE_HEADWAY = 28  # 1
BAND_TAKEN = 29  # 1
PERIOD_DRIFT = 30  # 1
FRICTION_NEXT = 31  # 1
HYSTERESIS_OF_LATE = 32  # 1
COURTESY_BRAKING = 33  # m/s^2
PRE_INSERTION_BRAKING = 34  # m/s^2
LAW = 35  # number of the car-following law in `idm_sumo.models.laws`
REACTION_CHANGE = 36  # s, added to `idm_sumo.models.laws.REACTION`
LEADER_CLASS_DISTANCE = 37  # m
OWN_SPEED_IN_RATE = 38  # 1
CREDIT_LIMITED = 39  # 1
DESIRED_SPEED_ACROSS = 40  # number of lanes, 0 where all are alike

COUNT = 41

# Effects that depend on the surroundings or the time. With all of these zero the terms are the same at every moment.
OF_SURROUNDINGS = (
    SECOND_LEADER,
    RELAXATION,
    LEADER_CLASS,
    LEADER_CLASS_DISTANCE,
    HYSTERESIS,
    FRICTION,
    PERIOD,
    PERIOD_DRIFT,
    DESIRED_SPEED,
    OWN_CLASS,
    MEMORY,
    COURTESY,
    COURTESY_BRAKING,
    PRE_INSERTION,
    PRE_INSERTION_BRAKING,
)
