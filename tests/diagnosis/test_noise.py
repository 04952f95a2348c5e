"""Noise: what is put in is found again."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import savgol_filter

from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis.chance import Noises, hidden, measured
from idm_sumo.diagnosis.smoother import FARTHEST, local_cubic, posterior_mean
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import WINDOW
from tests.helpers.followers import ERRORS, MOTION, recorded
from tests.simulators.first.files import position_noise


def recording(noise: no.Noise, *, vehicles: int = 60, is_smooth: bool = False) -> Recording:
    rng = np.random.default_rng(3)
    frames = 512
    time = 0.1 * np.arange(frames)
    phase = rng.uniform(0, 6, (vehicles, 1))
    x = 10.0 * time + 12.0 * np.sin(0.25 * time + phase) + noise.draw(vehicles, frames, rng)
    return recorded(x, is_smooth=is_smooth)


def smoothed_noise(variance: float, width: float) -> no.Noise:
    """Return white noise that somebody has smoothed, by a bell between two of those that are looked for."""
    beside = np.argsort(np.abs(no.BELLS - width))[:2]
    shares = np.isin(np.arange(len(no.SMOOTHED)), beside) * 0.5 * variance
    return no.Noise(0.0, np.empty(0), np.empty(0), smoothed=shares)


def variance_after_smoothing(noise: no.Noise) -> np.ndarray:
    drawn = measured(noise, local_cubic(WINDOW), 400, 260, np.random.default_rng(1))
    return np.array([part.std() for part in drawn])


@pytest.mark.parametrize(
    "planted",
    [
        no.Noise(0.09, np.zeros(1), np.array([1.0])),
        no.Noise(0.0, np.array([0.09]), np.array([0.6])),
        no.Noise(0.01, np.array([0.04]), np.array([0.3])),
        smoothed_noise(0.09, 0.17),
        smoothed_noise(0.09, 0.29),
    ],
)
def test_white_correlated_and_smoothed_noise_are_told_apart_by_the_spectrum(planted):
    found = no.measurement_noise(recording(planted))
    np.testing.assert_allclose(variance_after_smoothing(found), variance_after_smoothing(planted), rtol=0.25)


@pytest.mark.parametrize("width", [0.16, 0.3])
def test_noise_that_was_smoothed_before_it_was_recorded_is_found(width):
    """Drawn by other means than ours: scipy's filter over white noise, 30 cm of it."""
    rng = np.random.default_rng(5)
    white = gaussian_filter1d(rng.standard_normal((300, 600)), width / 0.1, axis=1)[:, 44:556]
    given = recording(no.QUIET, vehicles=300)
    moved_by = 0.3 * white / white.std()
    found = no.measurement_noise(given.with_table(given.table.assign(**{c.X: given.table[c.X] + moved_by.ravel()})))
    assert found.deviation == pytest.approx(0.3, rel=0.06)
    bells = found.smoothed[: len(no.BELLS)]
    assert bells @ no.BELLS / bells.sum() == pytest.approx(width, rel=0.15)


def test_noise_that_a_bell_of_another_form_smoothed_is_found():
    given, planted = recording(no.QUIET), position_noise(np.random.default_rng(6), (60, 512), "smoothed", 0.3)
    found = no.measurement_noise(given.with_table(given.table.assign(**{c.X: given.table[c.X] + planted.ravel()})))
    assert found.deviation == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize(
    ("smooth", "window"), [(uniform_filter1d, 5), (uniform_filter1d, 11), (savgol_filter, 11), (savgol_filter, 21)]
)
def test_noise_that_a_moving_average_or_local_cubics_smoothed_is_found(smooth, window):
    """With scipy's filters; before there were shapes for them it came as up to 1.6 times what it was."""
    white = np.random.default_rng(8).standard_normal((100, 600))
    errors = smooth(white, window, axis=1, **({"polyorder": 3} if smooth is savgol_filter else {}))[:, 44:556]
    given = recording(no.QUIET, vehicles=100)
    moved_by = 0.4 * errors / errors.std()
    found = no.measurement_noise(given.with_table(given.table.assign(**{c.X: given.table[c.X] + moved_by.ravel()})))
    assert found.deviation == pytest.approx(0.4, rel=0.06)


def test_a_smooth_recording_has_none():
    quiet = no.measurement_noise(recording(no.Noise(0.0, np.zeros(1), np.ones(1)), is_smooth=True))
    assert quiet.white + quiet.variance.sum() < 1e-4


def test_noise_is_stationary_from_the_first_step():
    drawn = no.Noise(0.0, np.array([0.25]), np.array([5.0])).draw(20_000, 30, np.random.default_rng(0))
    np.testing.assert_allclose(drawn[:, [0, 29]].std(axis=0), 0.5, rtol=0.03)


SMOOTH = no.Noise(
    0.01, np.array([0.2, 0.4]), np.array([0.5, 1.5]), np.array([False, True]), np.full(len(no.SMOOTHED), 0.004)
)


def test_noise_is_drawn_as_its_covariance_says():
    drawn = SMOOTH.draw(40_000, 30, np.random.default_rng(1))
    np.testing.assert_allclose(np.cov(drawn.T), SMOOTH.covariance(30), atol=0.012)


def test_spectrum_and_covariance_say_the_same():
    lags, omega = np.arange(-600, 601), np.linspace(0.05, np.pi, 40)
    along = np.concatenate([(row := SMOOTH.covariance(601)[0])[:0:-1], row])
    np.testing.assert_allclose(SMOOTH.spectrum(omega), np.cos(np.outer(omega, lags)) @ along, rtol=1e-6)


def test_what_is_filtered_twice_has_no_jumps():
    once, twice = (
        no.Noise(0.0, np.array([0.4]), np.array([1.5]), np.array([is_smooth])).draw(2000, 100, np.random.default_rng(2))
        for is_smooth in (False, True)
    )
    assert np.diff(twice, axis=1).std() < 0.3 * np.diff(once, axis=1).std()


def moved(noise: no.Noise, rows: int, frames: int, rng: np.random.Generator) -> np.ndarray:
    """Return positions (m) of vehicles with these accelerations, about a constant speed."""
    return np.cumsum(np.cumsum(noise.draw(rows, frames, rng), axis=1), axis=1) * 0.01


def test_own_motion_is_told_from_measurement_noise():
    rng = np.random.default_rng(4)
    given = recording(ERRORS)
    x = 10.0 * given.table[c.TIME].to_numpy() + (moved(MOTION, 60, 512, rng) + ERRORS.draw(60, 512, rng)).ravel()
    found = no.motion_noise(given.with_table(given.table.assign(**{c.X: x})), ERRORS)
    for window in (21, 41):
        assert hidden_position(found, window) == pytest.approx(hidden_position(MOTION, window), rel=0.3)


def test_motion_without_jumps_is_told_as_such():
    rng = np.random.default_rng(6)
    given, smooth = recording(ERRORS), no.Noise(0.0, np.array([0.6]), np.array([1.5]), np.array([True]))
    x = 10.0 * given.table[c.TIME].to_numpy() + (moved(smooth, 60, 512, rng) + ERRORS.draw(60, 512, rng)).ravel()
    found = no.motion_noise(given.with_table(given.table.assign(**{c.X: x})), ERRORS)
    omega = 2.0 * np.pi * 0.1 * np.array([0.1, 0.16, 0.24, 0.32])
    np.testing.assert_allclose(found.spectrum(omega), smooth.spectrum(omega), rtol=0.45)
    jumping = no.Noise(0.0, np.array([0.6]), np.array([1.5]))
    assert (found.spectrum(omega[2:]) < 0.6 * jumping.spectrum(omega[2:])).all()


@pytest.mark.parametrize("width", [0.18, 0.22, 0.3])
def test_motion_is_found_beneath_noise_that_left_nothing_at_high_frequencies(width):
    """Where the form of the fitted noise says far more than was recorded, it must not say that nothing moved at all."""
    rng = np.random.default_rng(8)
    given = recording(no.QUIET)
    errors = gaussian_filter1d(rng.standard_normal((60, 512)), 10.0 * width, axis=1)
    errors *= 0.34 / errors.std()
    x = 10.0 * given.table[c.TIME].to_numpy() + (moved(MOTION, 60, 512, rng) + errors).ravel()
    given = given.with_table(given.table.assign(**{c.X: x}))
    found = no.motion_noise(given, no.measurement_noise(given))
    omega = 2.0 * np.pi * 0.1 * np.array([0.06, 0.1])
    assert np.abs(np.log(found.spectrum(omega) / MOTION.spectrum(omega))).max() < 0.8


def hidden_position(motion: no.Noise, window: int) -> float:
    quiet = no.Noise(0.0, np.zeros(1), np.ones(1))
    truth, _ = hidden(Noises(quiet, quiet, motion), local_cubic(window), 400, 150, np.random.default_rng(7))
    return float(truth[0].std())


def test_hidden_motion_is_what_smoothing_hides():
    rng = np.random.default_rng(5)
    path = moved(MOTION, 400, 300, rng)
    off = path - savgol_filter(path + ERRORS.draw(400, 300, rng), 21, 3, axis=1)
    truth, shown = hidden(Noises(ERRORS, ERRORS, MOTION), local_cubic(21), 400, 150, rng)
    assert truth[0].std() == pytest.approx(off[:, 10:-10].std(), rel=0.05)
    assert truth[0].shape == shown[0].shape == (400, 150)


def test_a_smoothed_leader_with_what_is_hidden_moves_as_leaders_do():
    rng = np.random.default_rng(8)
    smoother = posterior_mean(ERRORS, MOTION)
    path = moved(MOTION, 1500, 300, rng)
    _, _, shown = smoother.rows(path + ERRORS.draw(1500, 300, rng))
    truth, _ = hidden(Noises(ERRORS, ERRORS, MOTION), smoother, 1500, 300 - 2 * FARTHEST, rng)
    whole = shown[:, FARTHEST:-FARTHEST] + truth[2]
    assert whole.var() == pytest.approx(0.4, rel=0.05)
    assert shown[:, FARTHEST:-FARTHEST].var() < 0.96 * 0.4
    lagged = (whole[:, 3:] * whole[:, :-3]).mean()
    assert lagged == pytest.approx(0.4 * np.exp(-0.3 / 5.0), rel=0.06)


def test_of_leaders_that_were_not_smoothed_nothing_is_hidden():
    truth, shown = hidden(Noises(ERRORS, ERRORS), local_cubic(21), 50, 100, np.random.default_rng(6))
    assert not truth[0].any()
    assert shown[0].std() > 0.0


def test_covariance_is_that_of_what_is_drawn():
    drawn = ERRORS.draw(40_000, 5, np.random.default_rng(2))
    np.testing.assert_allclose(np.cov(drawn.T), ERRORS.covariance(5), atol=0.002)
