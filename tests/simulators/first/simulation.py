"""Multi-lane traffic: who is where at every frame, without any measurement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tests.simulators.first import in_sumo
from tests.simulators.first.behaviour import INDEX, SEEN
from tests.simulators.first.motion import DT, run
from tests.simulators.first.plans import FORMS, MODELS, Plan

WARM_UP = 120.0  # s
SPARE = 60  # vehicles a lane that come and go before
LEAST = 900  # frames: a long road is full from the start
BEFORE, AFTER = 250.0, 220.0  # m of road outside the recorded section
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Planted:
    """True traffic of a plan: arrays ``(vehicles, frames)``, NaN (lane -1) outside the section."""

    plan: Plan
    x: Floats
    v: Floats
    lane: npt.NDArray[np.int8]
    length: Floats
    kind: npt.NDArray[np.int64]
    theta: Floats
    affected: npt.NDArray[np.bool_]
    sights: npt.NDArray[np.float32]  # what each driver saw, shape (vehicles, frames, SEEN); empty unless asked for


def simulate(chosen: Plan, *, remember: bool = False) -> Planted:
    """Simulate a plan. The recording ends early once ``drivers`` vehicles have been on the section (not before 90 s).

    ``remember`` keeps what each driver saw, for :func:`tests.simulators.first.truth.achievable`.
    """
    rng = np.random.default_rng([chosen.seed, 1])
    by_sumo = chosen.underlying.startswith(in_sumo.SUMO)
    n = int(chosen.drivers * 1.5) + (in_sumo.SPARE if by_sumo else SPARE) * chosen.lanes
    kind = rng.choice([1, 2, 3], size=n, p=[0.01, 0.99 - chosen.trucks, chosen.trucks])
    length = np.where(kind == 3, rng.uniform(9.0, 18.0, n), np.where(kind == 1, 2.2, rng.normal(4.6, 0.4, n)))
    lane = rng.integers(chosen.lanes, size=n)
    trucks = kind == 3
    lane[trucks] = chosen.lanes - 1 - rng.integers(min(2, chosen.lanes), size=trucks.sum())
    theta = _people(rng, n, chosen.spread, kind)
    effects = np.zeros(len(INDEX))
    for name, size in chosen.effects.items():
        effects[INDEX[name]] = size
    affected = rng.random(n) < chosen.share
    frames = int(chosen.minutes * 600) + 1
    caps = _downstream(rng, chosen, int((chosen.minutes * 60 + WARM_UP) / DT) + 2)
    where = np.array([*chosen.place, *chosen.time])
    log = np.zeros((n, frames, SEEN) if remember else (0, 0, 0), dtype=np.float32)
    if by_sumo:
        x, v, lanes = in_sumo.run(chosen, length, kind, theta, caps)
        return _ended(
            Planted(chosen, x, v, lanes, length, kind, theta, affected, np.zeros((0, 0, 0), dtype=np.float32))
        )
    x, v, lanes = run(
        int(rng.integers(2**31)), MODELS.index(chosen.underlying), FORMS.index(chosen.form), theta, length, kind,
        lane.astype(np.int64), affected, effects, where, chosen.lane, chosen.only_lane, caps, chosen.length,
        BEFORE, AFTER, frames, int(WARM_UP / DT), chosen.lanes, chosen.driver_noise, chosen.lane_changes, log,
    )  # fmt: skip
    return _ended(Planted(chosen, x, v, lanes, length, kind, theta, affected, log))


def _people(rng: np.random.Generator, n: int, spread: float, kind: npt.NDArray[np.int64]) -> Floats:
    """Draw ``v0, T, a, b, s0`` a driver."""
    middle = np.array([30.0, 1.25, 1.2, 1.8, 2.2])
    wide = spread * np.array([0.4, 1.0, 1.0, 1.0, 1.0])
    theta = middle * np.exp(wide * rng.standard_normal((n, 5)) - 0.5 * wide**2)
    theta[kind == 3] *= [0.8, 1.15, 0.7, 1.0, 1.3]
    return np.asarray(theta)


def _downstream(rng: np.random.Generator, chosen: Plan, steps: int) -> Floats:
    """Return the speed (m/s) that the road behind the section allows, shape (lanes, steps): its waves run upstream."""
    middle, swing = {"light": (24.0, 3.0), "moderate": (13.0, 5.0), "congested": (8.0, 4.5)}[chosen.density]
    t = np.arange(steps) * DT
    caps = np.empty((chosen.lanes, steps))
    common = [(rng.uniform(45, 150), rng.uniform(0, 6.3), rng.uniform(0.4, 0.7)) for _ in range(3)]
    for lane in range(chosen.lanes):
        late, own = rng.normal(0, 4.0), rng.uniform(30, 90)
        wave = sum(w * np.sin(6.283 * (t - late) / period + phase) for period, phase, w in common)
        wave = wave + 0.3 * np.sin(6.283 * t / own + rng.uniform(0, 6.3))
        caps[lane] = np.maximum(middle + 0.8 * lane * (chosen.lanes > 1) * -0.5 + swing * wave, 0.8)
    return caps


def _ended(p: Planted) -> Planted:
    """Cut off what comes after the last wanted driver's arrival, and forget who never arrived."""
    seen = np.isfinite(p.x)
    first = np.where(seen.any(axis=1), seen.argmax(axis=1), p.x.shape[1])
    arrivals = np.sort(first)
    last = int(arrivals[p.plan.drivers]) if p.plan.drivers < len(arrivals) else p.x.shape[1]
    last = min(max(last, LEAST), p.x.shape[1])
    keep = first < last
    order = np.flatnonzero(keep)[np.argsort(first[keep], kind="stable")]
    return Planted(p.plan, p.x[order, :last], p.v[order, :last], p.lane[order, :last], p.length[order], p.kind[order],
                   p.theta[order], p.affected[order],
                   p.sights[order, :last] if p.sights.size else p.sights)  # fmt: skip
