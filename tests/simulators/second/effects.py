"""The effects of the catalogue: each bends what a driver sees or is (`inputs`), or the acceleration (`output`).

Form 0 is the usual one, form 1 another functional form of the same effect.
"""

import math

from numba import njit

from tests.simulators.second import view as w
from tests.simulators.second.laws import S0, V0, T

CATALOGUE = (
    "reaction_delay", "multi_leader_anticipation", "lane_change_relaxation", "acceleration_asymmetry",
    "leader_class", "speed_dependent_headway", "perception_threshold", "hysteresis", "adjacent_lane_friction",
    "location", "time_of_day", "desired_speed", "follower_pressure", "pre_insertion", "courtesy_yielding",
)  # fmt: skip
USUAL_FORMS = {  # where the usual form leaves something open
    "multi_leader_anticipation": "(1 - w) law(gap, v1) + w law(mean of the gap and the leader's own gap, v2)",
    "lane_change_relaxation": "jump is the gap lost, at most 1.2 times what the new gap is short of s0 + T v; "
    "credit at most 0.7 T v",
    "speed_dependent_headway": "T (1 + gamma (v - v_mean) / 10 m/s)",
    "hysteresis": "T (1 + eta tanh(leader's acceleration / 0.5 m/s2))",
    "adjacent_lane_friction": "v_adjacent of the slower of the next vehicles ahead (60 m) in the lanes beside",
    "pre_insertion": "T (1 + delta) while the driver wants another lane, until the change or 20 s later",
    "courtesy_yielding": "-c while a vehicle beside the gap (30 m) wants into it",
    "desired_speed": "v0 (1 + delta) in one lane",
}
OTHER_FORMS = {
    "reaction_delay": "gap and leader's speed of t - tau, own speed of now, tau gamma-distributed over drivers",
    "multi_leader_anticipation": "leader's speed replaced by (1 - w) v1 + w v2, the gap untouched",
    "lane_change_relaxation": "gap credit falls linearly to zero within 2 tau_r",
    "acceleration_asymmetry": "smooth switch: a (1 - gamma (1 + tanh(a / 0.3)) / 2)",
    "leader_class": "constant extra distance behind trucks, 15 theta m, instead of a factor of T",
    "speed_dependent_headway": "smooth step of T at the mean speed, 0.5 gamma tanh((v - vm) / 3 m/s)",
    "perception_threshold": "soft edges: approach rate less band tanh(rate / band)",
    "hysteresis": "T shifts with the leader's mean acceleration over 3 s",
    "adjacent_lane_friction": "only beyond a difference of 2 m/s, 1.5 times as steep, saturating 6 m/s later",
    "location": "cosine bump of the same height",
    "time_of_day": "T grows as a ramp over the interval and stays there",
    "desired_speed": "desired speed falls linearly from the left lane to the right one",
    "follower_pressure": "exponential in the rear gap, c exp(-gap / 8 m)",
    "pre_insertion": "constant extra distance of 12 delta m instead of a factor of T",
    "courtesy_yielding": "T grows by 0.8 c s2/m instead of a constant deceleration",
}
DELAY, MULTI, RELAX, ASYMMETRY, TRUCK, SPEED, BAND, LOOP = range(8)  # in the order of the catalogue
FRICTION, PLACE, CLOCK, WANTED, PRESSED, MERGE, YIELDS = range(8, 15)


@njit(cache=True)
def gap_credit(e, see, th):
    """Gap in m that a driver overlooks after the leader changed: `P` is kappa, `Q` the relaxation time.

    Nobody overlooks more than the moving part of the desired gap, so a queue that stops is still respected.
    """
    usual = e[w.FORM] == 0
    left = math.exp(-see[w.SINCE] / e[w.Q]) if usual else max(0.0, 1.0 - see[w.SINCE] / (2.0 * e[w.Q]))
    return min(e[w.P] * see[w.JUMP] * left, 0.7 * th[T] * see[w.V])


@njit(cache=True)
def headway_factor(e, see):
    """Factor on the time headway of the effects that are one, else 1."""
    kind, usual, p = e[w.KIND], e[w.FORM] == 0, e[w.P]
    if kind == SPEED:
        off = see[w.V] - e[w.Q]
        return max(0.3, 1.0 + (p * off / 10.0 if usual else 0.5 * p * math.tanh(off / 3.0)))
    if kind == LOOP:
        return 1.0 + p * (math.tanh(see[w.AL] / 0.5) if usual else math.tanh(see[w.AL3] / 0.5))
    if kind == CLOCK and usual:
        return 1.0 + (p if e[w.T1] <= see[w.TIME] < e[w.T2] else 0.0)
    if kind == CLOCK:
        return 1.0 + p * min(1.0, max(0.0, (see[w.TIME] - e[w.T1]) / (e[w.T2] - e[w.T1])))
    if usual and ((kind == TRUCK and see[w.CLASS] == 3) or (kind == MERGE and see[w.WISH] > 0)):
        return 1.0 + p
    if kind == YIELDS and not usual and see[w.YIELD] > 0:
        return 1.0 + 0.8 * p
    return 1.0


@njit(cache=True)
def approach_left(e, approach):
    """Approach rate in m/s that a driver with a dead band still perceives."""
    if e[w.FORM] == 0:
        return 0.0 if abs(approach) < e[w.P] else approach
    return approach - e[w.P] * math.tanh(approach / e[w.P])


@njit(cache=True)
def see_late(e, see):
    """Replace what the driver sees by what was one reaction time ago."""
    see[w.S], see[w.VL] = see[w.S_LAG], see[w.VL_LAG]
    if e[w.FORM] == 0:
        see[w.V] = see[w.V_LAG]


@njit(cache=True)
def inputs(e, see, th):
    """Bend the view and the parameters in place, before the law is asked."""
    kind, usual = e[w.KIND], e[w.FORM] == 0
    if kind == DELAY:
        see_late(e, see)
    elif kind == MULTI and see[w.V2] >= 0.0:
        if usual:
            see[w.WEIGHT] = e[w.P]
        else:
            see[w.VL] = (1.0 - e[w.P]) * see[w.VL] + e[w.P] * see[w.V2]
    elif kind == RELAX:
        see[w.S] += gap_credit(e, see, th)
    elif kind == BAND:
        see[w.VL] = see[w.V] - approach_left(e, see[w.V] - see[w.VL])
    elif kind == WANTED:
        th[V0] *= 1.0 + e[w.P] * (1.0 if usual else (see[w.LANE] - 1.0) / max(1.0, e[w.Q] - 1.0))
    elif kind == TRUCK and not usual and see[w.CLASS] == 3:
        th[S0] += 15.0 * e[w.P]
    elif kind == MERGE and not usual and see[w.WISH] > 0:
        th[S0] += 12.0 * e[w.P]
    th[T] *= headway_factor(e, see)


@njit(cache=True)
def bump(e, x):
    """Shape of a place: 1 inside, or a cosine bump that is 1 in the middle."""
    if x < e[w.X1] or x >= e[w.X2]:
        return 0.0
    return 1.0 if e[w.FORM] == 0 else 0.5 - 0.5 * math.cos(2.0 * math.pi * (x - e[w.X1]) / (e[w.X2] - e[w.X1]))


@njit(cache=True)
def output(e, see, acc):
    """Acceleration in m/s2 after the effect, from the one the law gave."""
    kind, usual, p = e[w.KIND], e[w.FORM] == 0, e[w.P]
    if kind == ASYMMETRY:
        switch = (1.0 if acc > 0.0 else 0.0) if usual else 0.5 + 0.5 * math.tanh(acc / 0.3)
        return acc * (1.0 - p * switch)
    if kind == FRICTION:
        ahead = max(0.0, see[w.V] - see[w.SLOWER])
        return acc - p * (ahead if usual else 1.5 * min(6.0, max(0.0, ahead - 2.0)))
    if kind == PLACE:
        return acc + p * bump(e, see[w.X])
    if kind == PRESSED:
        return acc + p * (max(0.0, 1.0 - see[w.REAR] / 15.0) if usual else math.exp(-see[w.REAR] / 8.0))
    if kind == YIELDS and usual and see[w.YIELD] > 0:
        return acc - p
    return acc
