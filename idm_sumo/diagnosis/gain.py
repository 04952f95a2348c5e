"""What the extended model is better by, on drivers that neither named nor fitted it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit, for_rollouts
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.rollout import drive

Floats = npt.NDArray[np.float64]
RESAMPLES = 2000
METRICS = ("ade_m", "fde_m", "log_gap", "speed_mps", "collisions")
LEAST_ADE = 1e-3  # m


@dataclass(frozen=True)
class Errors:
    """Errors of the rollouts, one number a driver (means over its windows)."""

    ade_m: Floats
    fde_m: Floats
    log_gap: Floats
    speed_mps: Floats
    collisions: Floats
    residual: Floats  # recorded minus simulated position at the compared moments, by window


def errors(windows: w.Windows, fit: Fit) -> Errors:
    """Return the errors of closed-loop rollouts with each driver's own parameters."""
    x, v = drive(windows.seen, windows.driver, fit.theta, fit.by_lane, np.zeros(2), np.empty((0, 0)), w.LEAD)
    seen = windows.seen[:, :, w.LEAD :]
    off, gap = seen[:, w.X] - x, seen[:, w.REAR] - x

    def by_driver(value: npt.ArrayLike) -> Floats:
        count = np.bincount(windows.driver, minlength=windows.drivers)
        return np.asarray(np.bincount(windows.driver, np.asarray(value), windows.drivers) / np.maximum(count, 1))

    recorded = seen[:, w.REAR] - seen[:, w.X]
    return Errors(
        by_driver(np.abs(off[:, 1:]).mean(1)), by_driver(np.abs(off[:, -1])),
        by_driver(np.abs(np.log(np.maximum(gap, 0.1) / np.maximum(recorded, 0.1)))[:, 1:].mean(1)),
        by_driver(np.abs(seen[:, w.V, 1:] - v[:, 1:]).mean(1)), by_driver((gap <= 0.0).any(1).astype(np.float64)),
        off[:, w.EVERY :: w.EVERY],
    )  # fmt: skip


def driven(windows: w.Windows, fit: Fit, *, known: bool = False) -> Errors:
    """Return the errors of a model with drivers fitted to their positions alike; ``known`` if they are those of the fit."""
    return errors(windows, for_rollouts(windows, fit, known=known))


def compare(
    metric: str,
    base: Floats,
    extended: Floats,
    block: npt.NDArray[np.int64],
    rng: np.random.Generator,
    *,
    held_out: bool,
) -> Gain:
    """Return base and extended mean and the interval of their difference, platoon blocks resampled."""
    difference = base - extended
    _, number = np.unique(block, return_inverse=True)
    total, count = np.bincount(number, difference), np.bincount(number).astype(np.float64)
    chosen = rng.integers(0, len(total), (RESAMPLES, len(total)))
    means = total[chosen].sum(axis=1) / count[chosen].sum(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return Gain(
        metric,
        float(base.mean()),
        float(extended.mean()),
        float(difference.mean()),
        (float(low), float(high)),
        len(base),
        held_out,
    )


def typical(ade_m: Floats) -> Floats:
    """Return the logarithms of drivers' average displacement errors (m).

    A few drivers at the edge of stability err by many times as much as others, and what a cause does to those is no reason for or
    against it; the mean of the logarithms is that of the typical driver.
    """
    return np.log(np.maximum(ade_m, LEAST_ADE))


def typical_gain(
    base: Floats, extended: Floats, block: npt.NDArray[np.int64], rng: np.random.Generator, *, held_out: bool
) -> Gain:
    """Return the share of a driver's ADE that is spared, the typical one, and its interval."""
    spared, all_of_it = typical(base) - typical(extended), np.ones(len(base))
    return compare("share_of_ade", all_of_it, all_of_it - spared, block, rng, held_out=held_out)


def all_gains(
    base: Errors, extended: Errors, block: npt.NDArray[np.int64], rng: np.random.Generator, *, held_out: bool = True
) -> tuple[Gain, ...]:
    """Return the gains by every metric, the ADE first."""
    names = {
        "ade_m": "ade_m",
        "fde_m": "fde_m",
        "log_gap": "log_gap",
        "speed_mps": "speed_mps",
        "collisions": "collisions",
    }
    return tuple(
        compare(label, getattr(base, name), getattr(extended, name), block, rng, held_out=held_out)
        for name, label in names.items()
    )


def folds_of(block: npt.NDArray[np.int64], count: int, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Return the fold of each driver: blocks of neighbours stay together."""
    _, number = np.unique(block, return_inverse=True)
    return np.asarray(rng.permutation(np.arange(number.max() + 1) % count)[number])


def by_folds(windows: w.Windows, fits: Sequence[Fit], fold: npt.NDArray[np.int64]) -> Errors:
    """Return the errors of every driver, driven by the fit in which its fold had no part."""
    parts = [np.flatnonzero(fold == k) for k in range(len(fits))]
    each = [driven(windows.of_drivers(part), fit) for part, fit in zip(parts, fits, strict=True) if len(part)]
    order = np.argsort(np.concatenate(parts))
    residual = np.empty((len(windows.seen), each[0].residual.shape[1]))
    for part, one in zip((part for part in parts if len(part)), each, strict=True):
        residual[np.isin(windows.driver, part)] = one.residual
    joined = {name: np.concatenate([getattr(one, name) for one in each])[order] for name in METRICS}
    return Errors(**joined, residual=residual)


def lower_bound(gain: Gain, level: float) -> float:
    """Return the one-sided bound of a gain at a level of confidence."""
    return float(gain.difference - norm.ppf(level) * gain.standard_error)
