"""The compiled loop over time: entries, car-following with effects, lane changes, exits."""

# ruff: noqa: NPY002  (compiled code draws from the compiled generator, seeded in `run`)

from __future__ import annotations

import numpy as np
from numba import njit

from tests.planting import behaviour as act

DT = 0.05  # s; a frame is two steps
LAGS = 32  # remembered steps: 1.6 s


@njit(cache=True)
def neighbours(order, on, x, lane, lanes, ahead, behind):  # type: ignore[no-untyped-def]
    """Fill who is directly ahead and behind in the own lane, -1 for nobody."""
    last = np.full(lanes, -1)
    for i in order:
        if on[i]:
            ahead[i], behind[i] = last[lane[i]], -1
            if last[lane[i]] >= 0:
                behind[last[lane[i]]] = i
            last[lane[i]] = i


@njit(cache=True)
def around(i, target, order, on, x, lane):  # type: ignore[no-untyped-def]
    """Return who would be ahead of and behind ``i`` in another lane."""
    front, rear = -1, -1
    for j in order:
        if on[j] and lane[j] == target and j != i:
            if x[j] >= x[i]:
                front = j
            else:
                rear = j
                break
    return front, rear


@njit(cache=True)
def adjacent(i, order, on, x, v, lane, lanes, length):  # type: ignore[no-untyped-def]
    """Return the mean speed in the slower lane beside (NaN for none), and whether a truck is alongside."""
    total, count = np.zeros(2), np.zeros(2)
    truck = False
    for j in order:
        side = lane[j] - lane[i]
        if on[j] and abs(side) == 1 and abs(x[j] - x[i]) < 30.0:
            total[(side + 1) // 2] += v[j]
            count[(side + 1) // 2] += 1
            truck = truck or (length[j] > 8.0 and x[j] + 2.0 > x[i] - 5.0 and x[j] - length[j] < x[i] + 2.0)
    slowest = np.nan
    for side in range(2):
        if count[side] > 0:
            mean = total[side] / count[side]
            if not mean >= slowest:
                slowest = mean
    return slowest, truck


@njit(cache=True)
def run(  # type: ignore[no-untyped-def]
    seed, model, other, theta, length, kind, lane, affected, effects, where, special_lane, only_lane, caps, section,
    before, after, frames, warm, lanes, noise, changing,
):  # fmt: skip
    """Return positions, speeds (NaN outside the section) and lanes (-1), each of shape (vehicles, frames)."""
    np.random.seed(seed)
    n = len(length)
    X, V, K = np.full((n, frames), np.nan), np.full((n, frames), np.nan), np.full((n, frames), np.int8(-1))
    x, v, on, acc = np.full(n, -1e9), np.zeros(n), np.zeros(n, np.bool_), np.zeros(n)
    ahead, behind, before_ahead = np.full(n, -1), np.full(n, -1), np.full(n, -2)
    drift, slow_acc, mean_v = np.zeros(n), np.zeros(n), np.full(n, 12.0)
    jump, since, gap_was = np.zeros(n), np.full(n, 1e9), np.full(n, 1e9)
    past_s, past_v, past_d = np.full((n, LAGS), 1e9), np.zeros((n, LAGS)), np.zeros((n, LAGS))
    target, planned, changed, courteous = np.full(n, -1), np.zeros(n), np.full(n, -1e9), np.zeros(n, np.bool_)
    frozen, phase, freezes = np.zeros(n), np.random.rand(n) * 6.283, np.random.rand(n)
    queue, tail = np.zeros(lanes, np.int64), np.full(lanes, -1)
    limit_factor, enters = np.ones(lanes), lane.copy()
    limit_factor[special_lane] -= effects[act.LIMIT]
    none = np.zeros_like(effects)
    look_beside = effects[act.FRICTION] > 0 or effects[act.BESIDE] > 0
    keep = np.exp(-DT / 1.4)
    for step in range(-warm, 2 * frames):
        t = step * DT
        for k in range(lanes):  # who waits at the entry
            while queue[k] < n and enters[queue[k]] != k:
                queue[k] += 1
            i, j = queue[k], tail[k]
            room = 1e9 if j < 0 or not on[j] else x[j] - length[j] + before
            fast = 14.0 if room > 200 else min(v[j] + 0.5, 14.0)
            if i < n and room > theta[i, 4] + 1.0 + theta[i, 1] * fast:
                x[i], v[i], on[i], tail[k] = -before, fast, True, i
                past_s[i], past_v[i] = room, fast
                queue[k] += 1
        order = np.argsort(-x)
        order = order[on[order]]
        neighbours(order, on, x, lane, lanes, ahead, behind)
        slot = step % LAGS
        for i in order:
            e = effects if affected[i] and (only_lane < 0 or lane[i] == only_lane) else none
            j = ahead[i]
            s = x[j] - length[j] - x[i] if j >= 0 else 1e9
            dv = v[i] - v[j] if j >= 0 else 0.0
            since[i] += DT
            if j != before_ahead[i] and before_ahead[i] != -2:
                shorter = min(gap_was[i], 60.0) - s
                jump[i], since[i] = max(shorter, 0.0), 0.0
            before_ahead[i], gap_was[i] = j, s
            past_s[i, slot], past_v[i, slot], past_d[i, slot] = s, v[i], dv
            in_time = act.ramp(t, where[2], where[3], 20.0 if other else 0.1)
            delay = e[act.DELAY] + e[act.LATE] * (in_time > 0.5)
            own = v[i]
            if delay > 0.0:
                ago = (slot - round(delay / DT)) % LAGS
                s, dv = past_s[i, ago], past_d[i, ago]
                own = v[i] if other else past_v[i, ago]
            leader_acc = acc[j] if j >= 0 else 0.0
            slow_acc[i] += DT / 1.0 * (leader_acc - slow_acc[i])
            mean_v[i] += DT / 40.0 * (v[i] - mean_v[i])
            T = act.headway(
                theta[i, 1], own, e, other, leader_acc, slow_acc[i], j >= 0 and kind[j] == 3, kind[i] == 3, mean_v[i],
                in_time, courteous[i], target[i] >= 0,
            )  # fmt: skip
            v0, a, b, s0 = theta[i, 0] * limit_factor[lane[i]], theta[i, 2], theta[i, 3], theta[i, 4]
            if other and e[act.TRUCK_AHEAD] > 0.0 and j >= 0 and kind[j] == 3:
                s0 += e[act.TRUCK_AHEAD] * theta[i, 1] * 9.0
            seen = act.dead(dv, e[act.BAND], other)
            room = s + act.credit(e, jump[i], since[i], other)
            new = act.base_acceleration(model, own, room, seen, v0, T, a, b, s0)
            if e[act.SECOND] > 0.0 and j >= 0 and ahead[j] >= 0:
                two = ahead[j]
                w = e[act.SECOND]
                if other:
                    new = act.base_acceleration(model, own, room, own - (1 - w) * v[j] - w * v[two], v0, T, a, b, s0)
                else:
                    far = 0.5 * (x[two] - length[two] - x[i] - length[j])
                    new = (1 - w) * new + w * act.base_acceleration(model, own, far, own - v[two], v0, T, a, b, s0)
            if e[act.ASYM] > 0.0 and new > 0.0:
                new *= 1.0 - e[act.ASYM] * (min(1.0, new / 0.3) if other else 1.0)
            if e[act.PLACE] > 0.0:
                new -= e[act.PLACE] * act.ramp(x[i], where[0], where[1], 30.0 if other else 0.1)
            if look_beside:
                beside, truck = adjacent(i, order, on, x, v, lane, lanes, length)
                if beside == beside and v[i] > beside:
                    new -= e[act.FRICTION] * (3.0 * np.tanh((v[i] - beside) / 3.0) if other else v[i] - beside)
                if truck:
                    new -= e[act.BESIDE]
            if e[act.PRESSURE] > 0.0 and behind[i] >= 0:
                rear = x[i] - length[i] - x[behind[i]]
                new += e[act.PRESSURE] * max(0.0, 1.0 - rear / 15.0)
            if lane[i] == special_lane:
                new -= e[act.ENFORCE] * in_time
            new += e[act.THROTTLE] * np.sin(6.283 * t / 9.0 + phase[i])
            if freezes[i] < e[act.DISTRACT] and frozen[i] < 3.0 and x[i] > where[0]:
                frozen[i] += DT
                new = max(acc[i] if frozen[i] > DT else new, 0.0)  # foot held, eyes elsewhere
            drift[i] = keep * drift[i] + np.sqrt(1 - keep * keep) * noise * np.random.randn()
            new += drift[i]
            if x[i] > section + 20.0:
                new = min(new, (caps[lane[i], step + warm] - v[i]) / 1.5)
            real = x[j] - length[j] - x[i] if j >= 0 else 1e9
            if real < 1.0 or (j >= 0 and v[i] > v[j] and (v[i] - v[j]) ** 2 / (2 * max(real - 0.5, 0.2)) > 6.0):
                new = -8.0  # nobody drives into another
            acc[i] = min(max(new, -8.0), 4.0)
        for i in order:
            stop = -v[i] / acc[i] if acc[i] < 0.0 and v[i] + acc[i] * DT < 0.0 else DT
            x[i] += v[i] * stop + 0.5 * acc[i] * stop * stop
            v[i] = max(0.0, v[i] + acc[i] * DT)
            j = ahead[i]
            if j >= 0 and x[i] > x[j] - length[j] - 0.1 and not x[i] > x[j]:
                x[i], v[i] = max(x[i] - v[i] * DT, x[j] - length[j] - 0.1 - 0.2), min(v[i], v[j])
            if x[i] > section + after:
                on[i] = False
        courteous[:] = False
        for i in order:
            if not on[i]:
                continue
            if target[i] < 0:
                if kind[i] == 3 or t - changed[i] < 8.0 or x[i] < -120.0 or np.random.rand() > 0.12 * changing * DT:
                    continue
                aim = lane[i] + (1 if np.random.rand() < 0.5 else -1)
                if aim < 0 or aim >= lanes:
                    continue
                front, _ = around(i, aim, order, on, x, lane)
                now = v[ahead[i]] if ahead[i] >= 0 else 25.0
                then = v[front] if front >= 0 else 25.0
                if then > now - 0.5 + np.random.rand():
                    target[i], planned[i] = aim, t
                continue
            front, rear = around(i, target[i], order, on, x, lane)
            if rear >= 0 and effects[act.COURTESY] > 0.0:
                courteous[rear] = True
            if t - planned[i] < 2.0:
                continue
            room_front = x[front] - length[front] - x[i] if front >= 0 else 1e9
            room_rear = x[i] - length[i] - x[rear] if rear >= 0 else 1e9
            closing = max(0.0, v[rear] - v[i]) if rear >= 0 else 0.0
            if (
                room_front > 2.5 + 0.25 * v[i] + 1.5 * max(0.0, v[i] - (v[front] if front >= 0 else 99.0))
                and room_rear > 2.5 + 0.25 * (v[rear] if rear >= 0 else 0.0) + 2.0 * closing
            ):
                lane[i], changed[i] = target[i], t
                target[i] = -1
                order = np.argsort(-x)
                order = order[on[order]]
                neighbours(order, on, x, lane, lanes, ahead, behind)
                break  # one a step: the others look again in a moment
            if t - planned[i] > 7.0:
                target[i] = -1
        if step >= 0 and step % 2 == 0:
            k = step // 2
            for i in order:
                if on[i] and 0.0 <= x[i] <= section:
                    X[i, k], V[i, k], K[i, k] = x[i], v[i], lane[i]
    return X, V, K
