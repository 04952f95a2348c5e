"""How long a relaxation lasts: a time that is off, and the share with it, are put right."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.chance import Noises
from idm_sumo.diagnosis.fit import Fit, fit_drivers, improve
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.noise import QUIET
from idm_sumo.diagnosis.recovery import SOONEST, best_times, is_over_at_once, recovered
from idm_sumo.models.effects import slots
from tests.helpers.followers import followers

BOTH = [slots.RELAXATION, slots.RELAXATION_TIME]


def relaxing(share: float, time: float) -> w.Windows:
    """Return windows, every other one after a cut-in some time ago, driven with a relaxation."""
    windows, theta = followers(ro.PLAIN, np.random.default_rng(7))
    seen, frames = windows.seen.copy(), windows.seen.shape[2]
    ago = 0.5 * (np.arange(len(seen)) % 16)
    seen[::2, w.JUMP] = 8.0
    seen[:, w.SINCE] = ago[:, None] + 0.1 * np.arange(frames)
    planted = ro.PLAIN.copy()
    planted[:, BOTH] = share, time
    seen[:, w.X], seen[:, w.V] = ro.drive(seen, windows.driver, theta, planted, np.zeros(2), ro.NO_PUSH, 0)
    return replace(windows, seen=seen)


def after_three(windows: w.Windows, share: float, time: float) -> Fit:
    begin = ro.PLAIN.copy()
    begin[:, BOTH] = share, time
    subject = Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True)
    fit = fit_drivers(windows, begin, np.array([1e-4, 1e-4]), rounds=8)
    for _ in range(3):
        fit = improve(windows, recovered(subject, fit))
    return fit


@pytest.mark.parametrize("begin", [(0.9, 6.0), (0.4, 20.0)])
def test_a_time_that_is_off_and_the_share_with_it_are_put_right(begin):
    fit = after_three(relaxing(0.6, 11.0), *begin)
    np.testing.assert_allclose(fit.by_lane[0, BOTH], (0.6, 11.0), rtol=0.2)


@pytest.mark.parametrize(
    ("name", "time", "is_over"),
    [("lane_change_relaxation", 0.7 * SOONEST, True), ("lane_change_relaxation", 1.3 * SOONEST, False),
     ("hysteresis", 0.7 * SOONEST, False)],
)  # fmt: skip
def test_a_recovery_that_is_over_at_once_is_told(name, time, is_over):
    windows = relaxing(0.6, 11.0)
    there = ro.PLAIN.copy()
    there[:, BOTH] = 0.3, time
    assert is_over_at_once(name, fit_drivers(windows, there, np.array([1e-4, 1e-4]), rounds=0)) is is_over


def test_without_a_relaxation_nothing_is_moved():
    windows = relaxing(0.6, 11.0)
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    assert recovered(Subject(windows, Noises(QUIET, QUIET), rg.grid_of(windows), True), fit) is fit


def test_what_another_time_gains_is_what_both_columns_fit_better_by():
    rng = np.random.default_rng(3)
    columns, residual = rng.standard_normal((50, 3)), rng.standard_normal(50)
    gain, more = best_times(columns.T @ residual, columns.T @ columns, 0, [1, 2])
    for other, found, share in zip((1, 2), gain, more, strict=True):
        rest = residual - columns[:, other]
        (best,), _, _, _ = np.linalg.lstsq(columns[:, :1], rest)
        alone = np.linalg.lstsq(columns[:, :1], residual)[1][0]
        left = np.sum((rest - columns[:, 0] * best) ** 2)
        assert (found, share) == pytest.approx((0.5 * (alone - left), best))
