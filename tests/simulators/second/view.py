"""What a driver sees at one moment, as columns of one array, and how an effect is written down."""

from dataclasses import dataclass, field

import numpy as np

(
    S,  # gap, m
    V,  # own speed, m/s
    VL,  # leader's speed, m/s
    AL,  # leader's acceleration over the last half second, m/s2
    AL3,  # leader's mean acceleration over the last three seconds, m/s2
    LENGTH,  # leader's length, m
    CLASS,  # leader's class (1 motorcycle, 2 car, 3 truck, 0 nobody)
    S2,  # the leader's own gap, m
    V2,  # second leader's speed, m/s; negative without one
    REAR,  # gap behind, m
    X,  # position in the section, m
    TIME,  # time in the recording, s
    LANE,  # lane, 1 is leftmost
    SINCE,  # time since the leader changed, s
    JUMP,  # gap lost when the leader changed, m
    SLOWER,  # speed of the slower neighbour ahead in an adjacent lane, m/s; own speed without one
    FASTER,  # the same of the faster neighbour
    SIDE,  # signed distance of the closest neighbour's front, m
    MOTO,  # distance to the closest motorcycle in an adjacent lane, m
    SLOT,  # 1 where a neighbour drives beside the gap ahead
    YIELD,  # 1 where a neighbour ahead wants into the gap ahead
    WISH,  # 1 while the driver wants another lane
    S_LAG,  # gap to the present leader one reaction time ago, m
    V_LAG,  # own speed then, m/s
    VL_LAG,  # leader's speed then, m/s
    STOOD,  # time since the driver last stood, s
    SHOCK,  # time since the driver last braked harder than 1.5 m/s2, s
    AGE,  # time since the driver entered the section, s
    PHASE,  # driver's own phase, rad
    WEIGHT,  # share of the second leader in the response (written by an effect)
) = range(30)
COLUMNS = 30
NONE_AHEAD = 500.0  # m, the gap of a driver without a leader

KIND, FORM, P, Q, X1, X2, T1, T2, ONLY = range(9)  # columns of an effect in the simulation


@dataclass
class Effect:
    """One thing hidden in a recording.

    `code` and `form` choose the formula (form 0 is the usual one); `p` and `q` are its numbers. `position` (m) and
    `time` (s) bound it, `lane` 0 is every lane, `share` is the part of the drivers who have it. `lag` (s) is the
    reaction time, and with `lag_spread` drivers differ in it.
    """

    name: str
    code: int
    form: int
    p: float
    q: float = 0.0
    size: str = "mid"
    symbols: dict = field(default_factory=dict)
    position: tuple = (-1e6, 1e6)
    time: tuple = (-1e6, 1e6)
    lane: int = 0
    share: float = 1.0
    lag: float = 0.0
    lag_spread: float = 0.0

    def row(self):
        """Numbers for the simulation, in the order of the constants above."""
        return [self.code, self.form, self.p, self.q, *self.position, *self.time, self.lane]


def rows_of(hidden):
    """Numbers of all hidden effects for the simulation, one row each; no rows of nothing."""
    return np.array([effect.row() for effect in hidden], float).reshape(len(hidden), ONLY + 1)
