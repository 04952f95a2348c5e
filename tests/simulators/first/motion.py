"""The compiled loop over time: entries, car-following with effects, lane changes, exits."""

# ruff: noqa: NPY002  (compiled code draws from the compiled generator, seeded in `run`)

from __future__ import annotations

import numpy as np
from numba import njit

from tests.simulators.first import behaviour as act

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
def look_aside(i, form, order, on, x, v, acc, lane, length, seen):  # type: ignore[no-untyped-def]
    """Fill the slower adjacent lane's speed, whether a truck is alongside, and braking two lanes over.

    In the third form the slower one counts of those who are next ahead there, who is the last of the order.
    """
    total, count = np.zeros(2), np.zeros(2)
    seen[act.BESIDE_V], seen[act.TRUCK_BESIDE], seen[act.BRAKING_ACROSS] = np.nan, 0.0, 0.0
    for j in order:
        side = lane[j] - lane[i]
        if form == act.THIRD and on[j] and abs(side) == 1 and 0.0 <= x[j] - x[i] < 60.0:
            total[(side + 1) // 2], count[(side + 1) // 2] = v[j], 1
        if on[j] and abs(side) == 1 and abs(x[j] - x[i]) < 30.0:
            if form != act.THIRD:
                total[(side + 1) // 2] += v[j]
                count[(side + 1) // 2] += 1
            if length[j] > 8.0 and x[j] + 2.0 > x[i] - 5.0 and x[j] - length[j] < x[i] + 2.0:
                seen[act.TRUCK_BESIDE] = 1.0
        if on[j] and abs(side) == 2 and 0.0 < x[j] - x[i] < 40.0 and acc[j] < -1.0:
            seen[act.BRAKING_ACROSS] = 1.0
    for side in range(2):
        if count[side] > 0 and not total[side] / count[side] >= seen[act.BESIDE_V]:
            seen[act.BESIDE_V] = total[side] / count[side]


@njit(cache=True)
def look_ahead(i, ahead, behind, x, v, acc, length, kind, seen):  # type: ignore[no-untyped-def]
    """Fill what the leader, the second leader and the follower show."""
    j, back = ahead[i], behind[i]
    seen[act.REAR], seen[act.AHEAD_V], seen[act.AHEAD_ACC], seen[act.AHEAD_TRUCK] = np.nan, np.nan, 0.0, 0.0
    seen[act.SECOND_REACH], seen[act.SECOND_V], seen[act.TAIL] = np.nan, np.nan, np.nan
    if j >= 0:
        seen[act.REAR], seen[act.AHEAD_V], seen[act.AHEAD_ACC] = x[j] - length[j], v[j], acc[j]
        seen[act.AHEAD_TRUCK] = 1.0 if kind[j] == 3 else 0.0
        two = ahead[j]
        if two >= 0:
            seen[act.SECOND_REACH], seen[act.SECOND_V] = x[two] - length[two] - length[j], v[two]
    if back >= 0:
        seen[act.TAIL] = x[back] + length[i]


@njit(cache=True)
def run(  # type: ignore[no-untyped-def]
    seed, model, form, theta, length, kind, lane, affected, effects, where, special_lane, only_lane, caps, section,
    before, after, frames, warm, lanes, noise, changing, log,
):  # fmt: skip
    """Return positions, speeds (NaN outside the section) and lanes (-1), each of shape (vehicles, frames).

    ``log``, if not empty, shape (vehicles, frames, SEEN), is filled with what each driver saw.
    """
    np.random.seed(seed)
    n = len(length)
    X, V, K = np.full((n, frames), np.nan), np.full((n, frames), np.nan), np.full((n, frames), np.int8(-1))
    x, v, on, acc = np.full(n, -1e9), np.zeros(n), np.zeros(n, np.bool_), np.zeros(n)
    ahead, behind, before_ahead = np.full(n, -1), np.full(n, -1), np.full(n, -2)
    drift, gap_was = np.zeros(n), np.full(n, 1e9)
    sees = np.zeros((n, act.SEEN))
    sees[:, act.MEAN_V], sees[:, act.SINCE], sees[:, act.BESIDE_V] = 12.0, 1e9, np.nan
    past_s, past_v, past_d = np.full((n, LAGS), 1e9), np.zeros((n, LAGS)), np.zeros((n, LAGS))
    past_x = np.full((n, LAGS), -1e9)
    target, planned, changed, courteous = np.full(n, -1), np.zeros(n), np.full(n, -1e9), np.zeros(n, np.bool_)
    frozen, phase, freezes = np.zeros(n), np.random.rand(n) * 6.283, np.random.rand(n)
    queue, tail = np.zeros(lanes, np.int64), np.full(lanes, -1)
    limit_factor, enters = np.ones(lanes), lane.copy()
    limit_factor[special_lane] -= effects[act.LIMIT]
    none = np.zeros_like(effects)
    look_beside = effects[act.FRICTION] > 0 or effects[act.BESIDE] > 0 or effects[act.ACROSS] > 0
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
                past_s[i], past_v[i], past_x[i] = room, fast, -before
                queue[k] += 1
        order = np.argsort(-x)
        order = order[on[order]]
        neighbours(order, on, x, lane, lanes, ahead, behind)
        slot = step % LAGS
        for i in order:
            e = effects if affected[i] and (only_lane < 0 or lane[i] == only_lane) else none
            j, seen = ahead[i], sees[i]
            look_ahead(i, ahead, behind, x, v, acc, length, kind, seen)
            if look_beside:
                look_aside(i, form, order, on, x, v, acc, lane, length, seen)
            s = seen[act.REAR] - x[i] if j >= 0 else 1e9
            dv = v[i] - v[j] if j >= 0 else 0.0
            seen[act.SINCE] += DT
            if j != before_ahead[i] and before_ahead[i] != -2:
                seen[act.JUMP], seen[act.SINCE] = max(min(gap_was[i], 60.0) - s, 0.0), 0.0
                seen[act.ACCEPTED_T] = max(s - theta[i, 4], 0.0) / max(v[i], 2.0)
            before_ahead[i], gap_was[i] = j, s
            past_s[i, slot], past_v[i, slot], past_d[i, slot], past_x[i, slot] = s, v[i], dv, x[i]
            seen[act.IN_TIME] = act.ramp(t, where[2], where[3], 20.0 if form == act.OTHER else 0.1)
            if form == act.THIRD:  # drifts all the time
                seen[act.IN_TIME] = step / frames - 1.0
            seen[act.AHEAD_SLOW_ACC] += DT / 1.0 * (seen[act.AHEAD_ACC] - seen[act.AHEAD_SLOW_ACC])
            seen[act.MEAN_V] += DT / 40.0 * (v[i] - seen[act.MEAN_V])
            seen[act.UNREST] += DT / 15.0 * ((2.5 if abs(acc[i]) > 0.8 else 0.0) - seen[act.UNREST])
            seen[act.COURTEOUS], seen[act.PREPARING] = courteous[i], target[i] >= 0
            period = 6.0 + 6.0 * (7.0 * phase[i] % 1.0) if form == act.THIRD else 9.0  # every driver's own
            seen[act.SPECIAL_LANE], seen[act.ANGLE] = lane[i] == special_lane, 6.283 * t / period + phase[i]
            if log.size and step > 0 and step % 2 == 1:
                log[i, step // 2] = seen
            delay = e[act.DELAY] + e[act.LATE] * (seen[act.IN_TIME] > 0.5)
            own = v[i]
            if delay > 0.0:
                ago = (slot - round(delay / DT)) % LAGS
                s, dv = past_s[i, ago], past_d[i, ago]
                if form == act.THIRD and j >= 0:  # where the leader of now was then, whoever was followed
                    s, dv = past_x[j, ago] - length[j] - past_x[i, ago], past_v[i, ago] - past_v[j, ago]
                own = v[i] if form == act.OTHER else past_v[i, ago]
            new = act.respond(
                model, form, e, theta[i], limit_factor[lane[i]], kind[i] == 3, seen, where, x[i], v[i], own, s, dv
            )  # fmt: skip
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
