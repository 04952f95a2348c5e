"""One run: entries, perception, response and motion in steps of a frame."""

# ruff: noqa: NPY002  (compiled code draws from the compiled generator, seeded in `run`)

import math

import numpy as np
from numba import njit

from tests.simulators.second import road, view
from tests.simulators.second.lanes import change_lanes
from tests.simulators.second.laws import S0, V0, T
from tests.simulators.second.respond import respond

MEMORY_ROWS = 50_000  # by how many the memory grows
ZONE_TAU = 1.5  # s, how fast vehicles past the section take over the speed that prevails there


@njit(cache=True)
def place(world, n, x, v, step, sigma):
    """Put driver `n` on the road."""
    world.x[n], world.v[n], world.lane[n], world.born[n] = x, v, world.lane0[n], step
    world.entered[n], world.ou[n] = -1e3, sigma * np.random.randn()


@njit(cache=True)
def fill(world, queue, head, speed, length, sigma):
    """Fill the empty road with a queue at about equilibrium, lane by lane."""
    for lane in range(len(queue)):
        x = length - 20.0 * np.random.random()
        while x > 15.0:
            n = queue[lane, head[lane]]
            th = world.theta[n]
            place(world, n, x, min(0.8 * th[V0], speed[lane]), 0, sigma)
            head[lane] += 1
            x -= world.length[n] + th[S0] + th[T] * world.v[n]
            x -= 25.0 * max(0.0, speed[lane] / 12.0 - 1.0) * np.random.random()


@njit(cache=True)
def enter(world, queue, head, free, active, clock, step, sigma):
    """Let the next driver of each lane in when due and when there is room behind the last one."""
    last = np.full(len(queue), -1)
    for n in active:
        last[world.lane[n] - 1] = n
    for lane in range(len(queue)):
        n, ahead = queue[lane, head[lane]], last[lane]
        th, x = world.theta[n], 0.0
        speed = 0.9 * th[V0]
        if ahead >= 0:
            room = world.x[ahead] - world.length[ahead] - x
            needed = th[S0] + th[T] * world.v[ahead]
            speed = min(speed, world.v[ahead] + max(0.0, room - needed) / 6.0)
            if room < needed:
                continue
        if clock >= free[lane] and head[lane] < queue.shape[1] - 1:
            place(world, n, x, speed, step, sigma)
            head[lane] += 1
            free[lane] = clock + world.due[queue[lane, head[lane]]]


@njit(cache=True)
def present(world, length):
    """Drivers on the road, the foremost first."""
    inside = np.flatnonzero((world.lane > 0) & (world.x < length))
    return inside[np.argsort(-world.x[inside])]


@njit(cache=True)
def move(world, active, clock, section):
    """Ballistic step that stops at a standstill, and the notes of standing, hard braking and entering."""
    for n in active:
        before = world.v[n]
        world.v[n] = max(0.0, before + world.a[n] * road.DT)
        world.x[n] += 0.5 * (before + world.v[n]) * road.DT
        world.standing[n] = world.standing[n] + road.DT if world.v[n] < 0.3 else 0.0
        if world.standing[n] > 1.0:
            world.stood[n] = clock
        if world.a[n] < -1.5:
            world.shock[n] = clock
        if world.entered[n] == -1e3 and world.x[n] >= section:
            world.entered[n] = clock


@njit(cache=True)
def decide(world, law, active, step, clock, hidden, prevailing, shape, noise, sums, memory):
    """Accelerations of all drivers: response, driver noise, and the prevailing speed past the section.

    Notes in `memory` what the counted ones saw, and returns how many those were.
    """
    noted = 0
    start, end, zone = shape
    sigma, keep = noise
    inactive = np.zeros(1)
    for n in active:
        see = road.look(world, n, step, clock)
        see[view.X] -= start
        counted = clock >= 0.0 and start <= world.x[n] < end
        if counted:
            memory[noted, 0], memory[noted, 1], memory[noted, 2:] = n, step, see
            noted += 1
        acc = respond(law, see, world.theta[n], hidden, world.touched[n], sums if counted else inactive)
        world.ou[n] = keep * world.ou[n] + sigma * math.sqrt(1.0 - keep * keep) * np.random.randn()
        acc = max(-5.8, acc + world.ou[n])
        if world.x[n] > zone:
            acc = min(acc, max(-2.5, (prevailing[step, world.lane[n] - 1] - world.v[n]) / ZONE_TAU))
        world.a[n] = acc
    return noted


@njit(cache=True)
def run(world, law, queue, hidden, prevailing, shape, length, warm, noise, habits, seed):
    """Simulate; returns sums of squared effects (all, then each) over the states that count, and a memory of these.

    Its rows are driver, step and what the driver saw.

    `shape` is section start, end and the zone's start on the road in m, `warm` the seconds before the recording,
    `noise` the driver noise (m/s2, decay per step), `habits` keep-right bias (m/s) and shorter gaps taken (m/s2).
    """
    np.random.seed(seed)
    lanes, head = len(queue), np.zeros(len(queue), np.int64)
    fill(world, queue, head, prevailing[0], length, noise[0])
    sums, free = np.zeros(1 + len(hidden)), np.full(lanes, -1e3)
    memory, noted = np.empty((0, 2 + view.COLUMNS)), 0
    for step in range(len(prevailing)):
        clock = step * road.DT - warm
        active = present(world, length)
        world.xs[step, active], world.vs[step, active] = world.x[active], world.v[active]
        world.lanes[step, active] = world.lane[active]
        road.find_neighbours(world, active, lanes)
        for n in active:
            road.notice_leader(world, n, clock)
        if noted + len(active) > len(memory):
            memory = np.concatenate((memory, np.empty((MEMORY_ROWS, memory.shape[1]))))
        noted += decide(world, law, active, step, clock, hidden, prevailing, shape, noise, sums, memory[noted:])
        move(world, active, clock, shape[0])
        road.find_neighbours(world, active, lanes)
        change_lanes(world, law, active, clock, lanes, habits[0], habits[1])
        enter(world, queue, head, free, active, clock, step + 1, noise[0])
    return sums, memory[:noted]
