"""Lane changes: a wish by advantage or by route, held for a while, and carried out when the gap is accepted."""

# ruff: noqa: NPY002  (compiled code draws from the compiled generator, seeded in `run`)

import numpy as np
from numba import njit

from tests.simulators.second import road
from tests.simulators.second.laws import S0, V0, T, acceleration

LOOKS_PER_S = 0.6  # how often a driver weighs the other lanes
PATIENCE = 20.0  # s, a wish is given up after that
LIMIT = 6.0  # m/s2, braking by the law that nobody asks of himself or others
HARD = 4.0  # m/s2, twice the kinematic braking above which nobody takes a gap
REST = 8.0  # s between two lane changes or wishes


@njit(cache=True)
def prospect(world, n, ahead):
    """Speed in m/s that the driver expects behind that leader: his speed and what the gap has in store."""
    th = world.theta[n]
    if ahead < 0:
        return th[V0]
    spare = min(80.0, road.gap(world, n, ahead)) - th[S0] - th[T] * world.v[n]
    return min(th[V0], world.v[ahead] + 0.1 * spare)


@njit(cache=True)
def form_wish(world, n, clock, lanes, keep_right):
    """Want a side because the route says so or because it is better there by more than the driver's urge."""
    if world.route[n] < world.x[n] and world.side[n] != 0:
        world.want[n], world.wished[n], world.side[n] = world.side[n], clock, 0
    elif np.random.random() < LOOKS_PER_S * road.DT:
        here, best = prospect(world, n, world.near[n, road.NEXT]), world.urge[n]
        for side, column in ((-1, road.LEFT_NEXT), (1, road.RIGHT_NEXT)):
            bias = keep_right * side * (1.0 if world.kind[n] == 3 else 0.3)
            gain = prospect(world, n, world.near[n, column]) - here + bias
            if 1 <= world.lane[n] + side <= lanes and gain > best:
                best, world.want[n], world.wished[n] = gain, side, clock
    if not 1 <= world.lane[n] + world.want[n] <= lanes:
        world.want[n] = 0


@njit(cache=True)
def braking(world, law, n, ahead):
    """Deceleration in m/s2 that `n` would need behind `ahead`; very large if there is no room."""
    s = road.gap(world, n, ahead)
    closing = max(0.0, world.v[n] - world.v[ahead]) if ahead >= 0 else 0.0
    if s < 1.5 + 0.12 * world.v[n] or closing * closing > HARD * (s - 1.0):
        return 99.0
    return -acceleration(law, s, world.v[n], world.v[ahead] if ahead >= 0 else world.v[n], world.theta[n])


@njit(cache=True)
def accepted(world, law, n, short):
    """Whether the driver takes the gap beside; with `short` > 0 still shorter ones, within what brakes can do."""
    column = road.LEFT_NEXT if world.want[n] < 0 else road.RIGHT_NEXT
    limit = min(LIMIT, world.limit[n] + short)
    ahead, behind = world.near[n, column], world.near[n, column + 1]
    return braking(world, law, n, ahead) < limit and (behind < 0 or braking(world, law, behind, n) < limit)


@njit(cache=True)
def change_lanes(world, law, active, clock, lanes, keep_right, short):
    """Form, keep, drop or carry out wishes; one change at most per step, so no two vehicles take one gap."""
    for n in active:
        if clock - world.moved[n] < REST:
            continue
        if world.want[n] == 0:
            form_wish(world, n, clock, lanes, keep_right)
        elif clock - world.wished[n] > PATIENCE:
            world.want[n], world.moved[n] = 0, clock
        elif clock - world.wished[n] > 2.0 and accepted(world, law, n, short):
            world.lane[n] += world.want[n]
            world.want[n], world.moved[n] = 0, clock
            return
