"""The road during a run: state arrays, who drives next to whom, and what each driver sees."""

from collections import namedtuple

import numpy as np
from numba import njit

from tests.simulators.second import view as w
from tests.simulators.second.laws import S0, T

DT = 0.1  # s, the camera's frame
NEXT, BEHIND, LEFT_NEXT, LEFT_BEHIND, RIGHT_NEXT, RIGHT_BEHIND = range(6)  # columns of the neighbours; -1 is nobody
EYESHOT = 60.0  # m, how far ahead a neighbour in the next lane counts

# drivers: theta (five parameters), length m, kind (class), limit (braking accepted at a lane change, m/s2), urge
# (advantage in m/s that makes a lane change worth it), lag s, phase rad, touched (has effect k), route (place where a
# side is wanted, m) and side (-1 left, 1 right), lane0 (entry lane), due (least time
# headway at the entry, s); state: x, v, a, lane, want,
# wished (since, s), moved (last lane change, s), leader, jump, since, stood, standing, shock, entered, born (step), ou
World = namedtuple(
    "World",
    "theta length kind limit urge lag phase touched route side lane0 due "
    "x v a lane want wished moved leader jump since stood standing shock entered born ou xs vs lanes near",
)


def new_world(drivers, steps):
    """World without traffic for `steps` steps; `drivers` is a dict of the driver columns."""
    n = len(drivers["lane0"])
    state = {name: np.zeros(n) for name in ("x", "v", "a", "wished", "jump", "ou", "standing", "entered")}
    state |= {name: np.full(n, -1e3) for name in ("moved", "since", "stood", "shock")}
    state |= {name: np.zeros(n, np.int64) for name in ("lane", "want", "born")} | {"leader": np.full(n, -1)}
    seen = {"xs": np.zeros((steps, n)), "vs": np.zeros((steps, n)), "lanes": np.zeros((steps, n), np.int8)}
    return World(**drivers, **state, **seen, near=np.full((n, 6), -1))


@njit(cache=True)
def find_neighbours(world, active, lanes):
    """Fill the neighbours of the active vehicles, which are sorted from the front to the back."""
    last = np.full(lanes + 2, -1)
    for n in active:
        lane = world.lane[n]
        world.near[n, NEXT], world.near[n, LEFT_NEXT] = last[lane], last[lane - 1]
        world.near[n, RIGHT_NEXT] = last[lane + 1]
        last[lane] = n
    last[:] = -1
    for n in active[::-1]:
        lane = world.lane[n]
        world.near[n, BEHIND], world.near[n, LEFT_BEHIND] = last[lane], last[lane - 1]
        world.near[n, RIGHT_BEHIND] = last[lane + 1]
        last[lane] = n


@njit(cache=True)
def gap(world, n, ahead):
    """Gap in m from the front of `n` to the rear of `ahead`."""
    return world.x[ahead] - world.length[ahead] - world.x[n] if ahead >= 0 else w.NONE_AHEAD


@njit(cache=True)
def notice_leader(world, n, clock):
    """Note how much gap a new leader took, and when; only what is then short of the time headway counts."""
    now, before = world.near[n, NEXT], world.leader[n]
    if now != before and before >= 0 and now >= 0:
        lost = gap(world, n, before) - gap(world, n, now)
        short = world.theta[n, S0] + world.theta[n, T] * world.v[n] - gap(world, n, now)
        world.jump[n], world.since[n] = max(0.0, min(lost, 1.2 * short)), clock
    world.leader[n] = now


@njit(cache=True)
def see_leader(world, n, step, see):
    """Leader's columns of the view, of now and of one reaction time ago."""
    one = world.near[n, NEXT]
    see[w.S], see[w.V], see[w.VL], see[w.V2] = gap(world, n, one), world.v[n], world.v[n], -1.0
    if one < 0:
        see[w.S_LAG], see[w.V_LAG], see[w.VL_LAG] = see[w.S], see[w.V], see[w.VL]
        return
    see[w.VL], see[w.LENGTH], see[w.CLASS] = world.v[one], world.length[one], world.kind[one]
    for column, back in ((w.AL, 5), (w.AL3, 30)):
        then = max(world.born[one], step - back)
        see[column] = (world.vs[step, one] - world.vs[then, one]) / (DT * max(1, step - then))
    two = world.near[one, NEXT]
    if two >= 0:
        see[w.S2], see[w.V2] = gap(world, one, two), world.v[two]
    then = max(world.born[n], world.born[one], step - int(round(world.lag[n] / DT)))  # noqa: RUF046  (compiled, it is a float)
    see[w.S_LAG] = world.xs[then, one] - world.length[one] - world.xs[then, n]
    see[w.V_LAG], see[w.VL_LAG] = world.vs[then, n], world.vs[then, one]


@njit(cache=True)
def see_side(world, n, ahead, behind, towards, see):
    """Columns of one adjacent lane; `towards` is the wish (-1 or 1) that brings a neighbour there into this lane."""
    if ahead >= 0 and world.x[ahead] - world.x[n] < EYESHOT:
        see[w.SLOWER] = min(see[w.SLOWER], world.v[ahead])
        see[w.FASTER] = max(see[w.FASTER], world.v[ahead])
        rear = world.x[ahead] - world.length[ahead]
        if rear > world.x[n] - 1.0 and rear < world.x[n] + see[w.S]:
            see[w.SLOT] = 1.0
            if world.want[ahead] == towards and rear - world.x[n] < 30.0:
                see[w.YIELD] = 1.0
    for other in (ahead, behind):
        if other >= 0:
            offset = world.x[other] - world.x[n]
            if abs(offset) < abs(see[w.SIDE]):
                see[w.SIDE] = offset
            if world.kind[other] == 1:
                see[w.MOTO] = min(see[w.MOTO], abs(offset))


@njit(cache=True)
def look(world, n, step, clock):
    """View of driver `n` (see `view`); the position is the road's."""
    see = np.zeros(w.COLUMNS)
    see_leader(world, n, step, see)
    see[w.SLOWER], see[w.FASTER], see[w.SIDE], see[w.MOTO] = see[w.V], see[w.V], 1e3, 1e3
    see_side(world, n, world.near[n, LEFT_NEXT], world.near[n, LEFT_BEHIND], 1, see)
    see_side(world, n, world.near[n, RIGHT_NEXT], world.near[n, RIGHT_BEHIND], -1, see)
    behind = world.near[n, BEHIND]
    see[w.REAR] = gap(world, behind, n) if behind >= 0 else w.NONE_AHEAD
    see[w.X], see[w.TIME], see[w.LANE], see[w.PHASE] = world.x[n], clock, world.lane[n], world.phase[n]
    see[w.SINCE], see[w.JUMP] = clock - world.since[n], world.jump[n]
    see[w.WISH] = 1.0 if world.want[n] != 0 else 0.0
    see[w.STOOD], see[w.SHOCK] = clock - world.stood[n], clock - world.shock[n]
    see[w.AGE] = clock - world.entered[n] if world.entered[n] > -1e3 else 0.0
    return see
