"""Effects that the catalogue does not list; codes from 100, one formula each, strength in `P`."""

import math

from numba import njit

from tests.simulators.second import view as w
from tests.simulators.second.laws import S0, T

FIRST = 100
# name, what drivers do, covariate that shows it, strength to begin with
IDEAS = (
    ("late_beside_accident", "beside an accident on the other side some drivers react late", "position x lag", 1.0),
    ("slow_start", "after standing a driver accelerates weakly for six seconds", "time since standing", 0.6),
    ("motorcycle_beside", "more headway while a motorcycle is near in the next lane", "distance to a motorcycle", 0.6),
    ("brake_lights", "brakes at the leader's brake lights whatever the gap", "leader's acceleration < -0.5", 0.6),
    ("attention_cycle", "headway swings with a period of 24 s, each driver in an own phase", "time, per driver", 0.4),
    ("tired_in_section", "headway grows with the time spent in the section", "time since entry", 0.6),
    ("long_car_ahead", "keeps away from long cars (vans), trucks or not, by metres", "leader's length > 5.2 m", 5.0),
    ("drawn_along", "accelerates beside a faster lane", "speed of the next lane less own, > 0", 0.08),
    ("staggering", "shuns driving abreast: falls back or passes", "offset of the closest neighbour", 0.5),
    ("pedal_dead_zone", "leaves the pedal alone while little acceleration is called for", "wanted acceleration", 0.45),
    ("shower", "a shower crosses the section; in it drivers hold back", "position x time, moving band", 0.5),
    ("shaken", "keeps more headway for 15 s after hard braking", "time since own braking < -1.5", 0.5),
    ("closes_the_door", "follows closer while a neighbour drives beside the gap", "neighbour beside the gap", 0.35),
    ("glare", "sun in the eyes in a place for a while: holds back there and then", "position x time rectangle", 0.5),
)  # fmt: skip
NAMES = tuple(idea[0] for idea in IDEAS)
ACCIDENT, START, MOTORCYCLE, LIGHTS, CYCLE, TIRED, LONG_CAR = range(FIRST, FIRST + 7)  # in the order of the ideas
DRAWN, STAGGER, PEDAL, SHOWER, SHAKEN, DOOR, GLARE = range(FIRST + 7, FIRST + 14)
CYCLE_S = 24.0  # s, period of attention
TIRED_S = 50.0  # s in the section until the headway has grown in full
SHOWER_M = 70.0  # m, half width of the shower


@njit(cache=True)
def headway_factor(e, see):
    """Factor on the time headway of the effects that are one, else 1."""
    kind, p = e[w.KIND], e[w.P]
    if kind == MOTORCYCLE:
        return 1.0 + p * max(0.0, 1.0 - (see[w.MOTO] / 40.0) ** 2)
    if kind == CYCLE:
        return 1.0 + p * math.sin(2.0 * math.pi * see[w.TIME] / CYCLE_S + see[w.PHASE])
    if kind == TIRED:
        return 1.0 + p * min(1.0, max(0.0, see[w.AGE] / TIRED_S))
    if kind == SHAKEN:
        return 1.0 + p * (1.0 if see[w.SHOCK] < 15.0 else 0.0)
    if kind == DOOR:
        return max(0.3, 1.0 - p * see[w.SLOT])
    return 1.0


@njit(cache=True)
def inputs(e, see, th):
    """Bend the view and the parameters in place, before the law is asked."""
    kind = e[w.KIND]
    if kind == ACCIDENT and e[w.X1] <= see[w.X] < e[w.X2]:
        see[w.S], see[w.V], see[w.VL] = see[w.S_LAG], see[w.V_LAG], see[w.VL_LAG]
    elif kind == LONG_CAR and see[w.LENGTH] > 5.2:
        th[S0] += e[w.P]
    th[T] *= headway_factor(e, see)


@njit(cache=True)
def holding_back(e, see):
    """Deceleration in m/s2 by place and time: a moving shower, or glare in a rectangle."""
    if e[w.KIND] == SHOWER:
        middle = e[w.X1] + (e[w.X2] - e[w.X1]) * (see[w.TIME] - e[w.T1]) / (e[w.T2] - e[w.T1])
        return e[w.P] if abs(see[w.X] - middle) < SHOWER_M else 0.0
    here = e[w.X1] <= see[w.X] < e[w.X2] and e[w.T1] <= see[w.TIME] < e[w.T2]
    return e[w.P] if here else 0.0


@njit(cache=True)
def output(e, see, acc):
    """Acceleration in m/s2 after the effect, from the one the law gave."""
    kind, p = e[w.KIND], e[w.P]
    if kind == START and see[w.STOOD] < 6.0 and acc > 0.0:
        return acc * (1.0 - p)
    if kind == LIGHTS and see[w.AL] < -0.5 and see[w.S] < 40.0:
        return acc - p
    if kind == DRAWN:
        return acc + p * max(0.0, see[w.FASTER] - see[w.V])
    if kind == STAGGER and abs(see[w.SIDE]) < 8.0:
        return acc - p if see[w.SIDE] > 0.0 else acc + 0.6 * p
    if kind == PEDAL and abs(acc) < p:
        return 0.0
    return acc - holding_back(e, see) if kind in (SHOWER, GLARE) else acc
