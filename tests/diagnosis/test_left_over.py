"""What the catalogue does not hold: pulses say of a field what the field itself would say; what is planted is found where it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import gls, oscillation, variance
from idm_sumo.diagnosis import left_over as lo
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import pulse_means
from idm_sumo.diagnosis.fit import Fit, fit_drivers, linearise
from idm_sumo.diagnosis.linear_pulses import GUARD, LINEAR
from idm_sumo.diagnosis.pulses import Pulses, pulses_of
from idm_sumo.diagnosis.scans import Stretch
from tests.helpers.followers import followers

START = np.array([1e-4, 1e-4])


@pytest.fixture(scope="module")
def driven() -> tuple[w.Windows, Fit, rg.Grid, rg.Answer]:
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    fit = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=6)
    return windows, fit, rg.grid_of(windows), rg.answer_of(windows, fit, rg.grid_of(windows).pivot)


def test_windows_are_weighed_by_how_calm_they_are(driven):
    windows, fit, _, answer = driven
    expected = linearise(windows, fit).whitener * rg.calm(answer.response)[:, None, None]
    np.testing.assert_allclose(answer.line.whitener, expected)
    assert rg.calm(answer.response).min() < 1.0


def test_pulses_add_up_to_the_score_and_the_gram_matrix_of_a_field(driven):
    windows, fit, _, answer = driven
    pulses = pulses_of(windows, fit, answer)
    number = np.random.default_rng(0).integers(-1, 3, (len(windows.seen), w.HORIZON))
    value = np.random.default_rng(1).standard_normal(number.shape)
    u, gram = pulses.along(number, value, 3)
    line = answer.line
    fields = [np.where(number == k, value, 0.0) for k in range(3)] + [value]
    columns = rg.tamed(answer.response) @ np.stack([pulse_means(field) for field in fields], axis=2)
    form = [n for n, name in enumerate(LINEAR) if name.startswith((*rg.INSTANT, GUARD))]
    nuisance = rg.tamed(answer.response) @ answer.pulses[:, :, form]
    every = np.concatenate([line.jacobian, rg.tamed(nuisance), columns], axis=2)
    error, own, regressors = (line.whitener @ part for part in (line.error[:, :, None], line.jacobian, every))
    direct = gls.scores(error, own, regressors, np.linalg.inv(fit.spread), windows.driver, windows.drivers)
    known = regressors.shape[2] - 4
    direct = direct.without(np.arange(known))
    np.testing.assert_allclose(u.sum(axis=0), direct.u.sum(axis=0)[known:], rtol=1e-5, atol=1e-6 * np.abs(u).max())
    np.testing.assert_allclose(gram, direct.gram[known:, known:], rtol=1e-5, atol=1e-6 * np.abs(gram).max())


@pytest.mark.parametrize(
    ("covariate", "column", "near", "far"),
    [
        ("beside_gap", w.BESIDE_GAP, 1.0, 0.0), ("motorcycles_beside", w.MOTORCYCLES, 2.0, 0.0),
        ("leader_length", w.LENGTH, 6.0, 0.0), ("since_standing", w.SINCE_STANDING, 2.0, 1e6),
        ("since_entry", w.SINCE_ENTRY, 20.0, np.nan), ("since_braking", w.SINCE_BRAKING, 2.0, 1e6),
        ("faster_difference", w.FASTER, 15.0, np.nan), ("nearest_beside", w.NEAREST_BESIDE, -6.0, np.nan),
    ],
)  # fmt: skip
def test_what_is_free_along_a_covariate_is_where_the_recording_shows_it(driven, covariate, column, near, far):
    windows, _, grid, answer = driven
    seen = windows.seen.copy()
    seen[:, column] = far
    there = np.arange(len(seen)) % 3 == 0
    seen[there, column] = near
    shown = replace(windows, seen=seen)
    numbers = [number for family, number in ff.families(shown, answer.state, grid) if family.covariate == covariate]
    assert len(numbers) == 2  # some acceleration, and the headway
    for number in numbers:
        assert (number[there] >= 0).all()
        assert (number[~there] == -1).all()


def test_replicates_and_recording_count_the_same_fields_in_the_same_order(driven):
    windows, fit, grid, answer = driven
    evaluated = lo.evaluate(windows, fit, grid, answer)
    pulses = pulses_of(windows, fit, answer)
    what = ff.contents(pulses.state)
    totals = [
        pulses.along(number, what[family.content], family.count)[0].sum(axis=0)
        for family, number in ff.families(windows, pulses.state, grid)
    ]
    np.testing.assert_allclose(evaluated.totals, np.concatenate(totals), rtol=1e-9, atol=1e-9)


def pushed(windows: w.Windows, fit: Fit, more: np.ndarray) -> w.Windows:
    """Return the windows as driven with some acceleration (m/s²) added in the simulated frames."""
    seen = windows.seen.copy()
    x, v = ro.drive(seen, windows.driver, fit.theta, fit.by_lane, np.zeros(2), more, w.LEAD)
    seen[:, w.X, w.LEAD :], seen[:, w.V, w.LEAD :] = x, v
    return replace(windows, seen=seen)


def strongest(windows: w.Windows, fit: Fit, grid: rg.Grid, quiet: w.Windows) -> lo.LeftOver:
    """Return what says most, against a replicate in which nothing is."""
    replicate = lo.evaluate(quiet, fit, grid, rg.answer_of(quiet, fit, grid.pivot))
    found = lo.left_over(windows, fit, grid, rg.answer_of(windows, fit, grid.pivot), [replicate], [replicate], 1.0)
    return next(one for one in found if one.is_credible)


def test_what_one_place_does_is_found_there(driven):
    windows, fit, grid, _ = driven
    place = windows.seen[:, w.X, w.LEAD : -1]
    found = strongest(pushed(windows, fit, np.where((place > 60.0) & (place < 110.0), -0.3, 0.0)), fit, grid, windows)
    assert found.covariate == "position"
    assert found.position_m == pytest.approx((60.0, 110.0), abs=20.0)
    assert found.time_s is None
    assert found.value == pytest.approx(-0.3, rel=0.4)


@pytest.mark.parametrize("axis", ff.HELD)
def test_a_place_that_acts_for_a_while_is_told_from_one_that_acts_at_all_times(driven, axis):
    seen, fit = driven[0].seen.copy(), driven[1]
    seen[driven[0].driver % 3 > 0, w.TIME] += 60.0
    seen[driven[0].driver % 3 > 1, w.TIME] += 60.0
    windows = replace(driven[0], seen=seen)
    grid, place, time = rg.grid_of(windows), seen[:, w.X, w.LEAD : -1], seen[:, w.TIME, w.LEAD : -1]
    there, then = (place >= 60.0) & (place < 110.0), time > 100.0
    held, ends = (there, (60.0, 110.0)) if axis == "position" else (then, (100.0, 140.0))
    families = ff.inside([ff.Interval(axis, *ends, ff.ACCELERATION, -1.0)])
    replicate = lo.evaluate(windows, fit, grid, rg.answer_of(windows, fit, grid.pivot), families)

    def within(where: np.ndarray) -> lo.LeftOver:
        slowed = pushed(windows, fit, np.where(where, -0.3, 0.0))
        answer = rg.answer_of(slowed, fit, grid.pivot)
        found = lo.left_over(slowed, fit, grid, answer, [replicate], [replicate], 1.0, families)
        return next(one for one in found if one.covariate == ff.WITHIN[axis])

    both, always = within(there & then), within(held)
    assert both.position_m == pytest.approx((60.0, 110.0), abs=20.0)
    assert both.time_s[0] > 60.0
    assert both.time_s[1] > 130.0
    assert both.value < -0.1
    assert abs(both.z) > 2.0 * abs(always.z)


def test_a_pedal_half_left_alone_is_found_by_the_acceleration_that_is_wanted(driven):
    windows, fit, grid, answer = driven
    wanted = answer.state[:, :, ro.BASE_A]
    idle = pushed(windows, fit, np.where(np.abs(wanted) < 0.3, -0.5 * wanted, 0.0))
    replicate = lo.evaluate(windows, fit, grid, answer)
    every = lo.left_over(idle, fit, grid, rg.answer_of(idle, fit, grid.pivot), [replicate], [replicate], 1.0)
    found = next(one for one in every if one.covariate == ff.PEDAL)
    assert found.is_credible
    # Half as much there, or that much more beyond: a driver's own parameters make the one of the other, and rounding chooses.
    assert (found.range, found.value) in [
        ((0.0, 0.3), pytest.approx(-0.5, abs=0.2)),
        ((0.3, 20.0), pytest.approx(0.5, abs=0.2)),
    ]


@pytest.mark.parametrize(("content", "value", "told"), [
    (ff.RESPONSE, 0.5, True), (ff.RESPONSE, 0.01, False), (ff.RESPONSE, 20.0, False), (ff.RESPONSE, -0.5, True),
    (ff.RESPONSE, -1.5, False), (ff.DELAY, 0.8, True), (ff.DELAY, -1.3, False), (ff.ACCELERATION, 20.0, True),
])  # fmt: skip
def test_nobody_answers_many_times_as_strongly_or_the_other_way_round(content, value, told):
    family = ff.Family("position", content, (np.arange(6.0),))
    said = lo.Said(family, Stretch((1,), (3,), 10, 100.0 * value, 100.0), 9.0, 0.0, by_few=False)
    assert lo._named(said, 10).is_credible is told
    assert not lo._named(said._replace(by_few=True), 10).is_credible


@pytest.mark.parametrize(
    ("covariate", "bias", "told"),
    [
        ("position", 0.0, True),
        ("position", 4.0, True),  # the recording says more than the score
        ("position", -2.0, True),
        ("position", -3.0, False),  # most of it is what replicates of drawn drivers do the other way
        ("position and time", -9.0, False),
        ("leader_acceleration", -4.0, True),  # these replicates are of the fitted drivers
    ],
)
def test_what_the_recording_does_not_say_itself_of_where_and_when_is_not_told(covariate, bias, told):
    edges = (np.arange(6.0),) * (2 if covariate == "position and time" else 1)
    stretch = Stretch((1,) * len(edges), (3,) * len(edges), 10, 5.0, 10.0)
    for sign in (1.0, -1.0):
        said = lo.Said(
            ff.Family(covariate, "", edges), stretch._replace(score=5.0 * sign), 9.0 * sign, bias * sign, by_few=False
        )
        assert lo._named(said, 10).is_credible is told


@pytest.mark.parametrize(
    ("covariate", "told"),
    [("position", True), ("position in lane 2", False), ("time in lane 2", False), ("position and time", False)],
)
def test_what_is_looked_at_most_must_be_larger(covariate, told):
    """IDM drivers of SUMO, nothing hidden and next to no noise, held back by 0.05 m/s² in a rectangle, 6.2 standard errors."""
    edges = (np.arange(6.0),) * (2 if covariate == "position and time" else 1)
    stretch = Stretch((1,) * len(edges), (3,) * len(edges), 10, -5.0, 100.0)
    said = lo.Said(ff.Family(covariate, "", edges), stretch, -9.0, 0.0, by_few=False)
    assert lo._named(said, 10).is_credible is told
    assert lo._named(said._replace(stretch=said.stretch._replace(score=-8.0)), 10).is_credible


@pytest.mark.parametrize("platoon", [3, None])
def test_what_one_block_of_neighbours_does_is_not_told(driven, platoon):
    windows, fit, grid, _ = driven
    time = windows.seen[:, w.TIME, w.LEAD : -1]
    block = windows.platoon[windows.driver][:, None]
    more = np.where((platoon is None) | (block == platoon), np.where(np.isfinite(time), -0.4, 0.0), 0.0)
    place = windows.seen[:, w.X, w.LEAD : -1]
    pushed_on = pushed(windows, fit, np.where((place > 60.0) & (place < 110.0), more, 0.0))
    replicate = lo.evaluate(windows, fit, grid, rg.answer_of(windows, fit, grid.pivot))
    found = lo.left_over(pushed_on, fit, grid, rg.answer_of(pushed_on, fit, grid.pivot), [replicate], [replicate], 1.0)
    where = next(one for one in found if one.covariate == "position")
    assert where.is_credible is (platoon is None)


def test_an_own_oscillation_has_a_line_and_noise_of_some_memory_has_none():
    rng = np.random.default_rng(5)
    windows, _ = followers(ro.PLAIN, rng)
    seen = windows.seen.copy()
    each = np.arange(len(seen)) % 3
    seen[:, w.TIME] += 12.0 * each[:, None]
    windows = replace(windows, seen=seen)
    time = seen[:, w.TIME, w.LEAD : -1].reshape(len(seen), -1, ro.BIN).mean(axis=2)
    phase = rng.uniform(0.0, 6.3, windows.drivers)[windows.driver][:, None]

    def power(swing: float) -> np.ndarray:
        noise = rng.standard_normal(time.shape).cumsum(axis=1)
        score = noise + swing * np.sin(2.0 * np.pi * time / 9.0 + phase)
        empty = np.empty(0)
        return oscillation.spectrum(Pulses(windows, empty, score, empty, empty, empty, empty, empty))

    replicates = np.mean([power(0.0).mean(axis=0) for _ in range(6)], axis=0)
    line = oscillation.line(power(4.0), replicates)
    assert line.low < 9.0 < line.high
    assert line.ratio > 2.0
    assert oscillation.line(power(0.0), replicates).z < 4.0


def test_oscillations_of_each_drivers_own_period_have_no_common_line():
    rng, periods = np.random.default_rng(5), oscillation.PERIODS

    def spectra(swing: float, periods_of: np.ndarray) -> np.ndarray:
        noise = rng.exponential(periods, (300, len(periods)))
        off = np.log(periods / periods_of[:, None])
        power = noise + swing * periods * np.exp(-((off / 0.04) ** 2))
        return power / power.sum(axis=1, keepdims=True)

    own = np.exp(rng.uniform(np.log(6.0), np.log(12.0), 300))
    replicates = [spectra(0.0, own) for _ in range(3)]
    mean = np.mean(replicates, axis=(0, 1))
    assert not oscillation.line(spectra(8.0, own), mean).is_strong
    many = oscillation.own_lines(spectra(8.0, own), replicates)
    assert many.is_strong
    assert many.z > 8.0
    nothing = oscillation.own_lines(spectra(0.0, own), replicates)
    assert not nothing.is_strong
    assert abs(nothing.z) < 3.0


def test_oscillations_of_drivers_who_are_seen_for_two_periods_are_a_swell_and_a_slope_is_none():
    rng, periods = np.random.default_rng(5), oscillation.PERIODS

    def spectra(swing: float, slope: float) -> np.ndarray:
        own = np.exp(rng.uniform(np.log(7.0), np.log(11.0), 300))
        width = periods / 20.0  # of a line of who is seen for 20 s
        off = np.log(periods / own[:, None]) / np.maximum(width, 0.05)
        power = rng.exponential(periods ** (1.0 + slope), (300, len(periods))) + swing * periods * np.exp(-(off**2))
        return power / power.sum(axis=1, keepdims=True)

    replicates = [spectra(0.0, 0.0) for _ in range(3)]
    found = oscillation.swell(spectra(1.5, 0.0), replicates)
    assert found.is_strong
    assert found.low < 9.0 < found.high
    assert found.z > 5.0
    for slope in (-0.3, 0.0, 0.3):
        assert not oscillation.swell(spectra(0.0, slope), replicates).is_strong


def test_who_is_around_a_driver_need_not_answer_for_the_looks_of_the_scans():
    def said(covariate: str, looks: int) -> lo.Said:
        family = ff.Family(covariate, ff.ACCELERATION, (np.array([0.5, 99.0]),))
        return lo.Said(family, Stretch((0,), (1,), looks, 10.0, 100.0), 4.5, 0.0, by_few=False)

    looks = lo._looks([said("position", 5000), said("trucks_beside", 1), said("nearest_beside", 20)])
    assert looks == {True: 42, False: 10000}  # each half of the error
    assert lo._named(said("trucks_beside", 1), looks[True]).p < 1e-3 < lo._named(said("position", 5000), looks[False]).p


@pytest.mark.parametrize("period", [4.0, 40.0])
def test_the_end_of_a_spectrum_that_smoothing_bent_is_no_line(period):
    rng = np.random.default_rng(5)
    bent = 1.0 + 3.0 * np.exp(-np.abs(np.log(oscillation.PERIODS / period)) / 0.3)
    found = bent * rng.uniform(0.8, 1.2, (200, len(oscillation.PERIODS)))
    assert oscillation.line(found, np.ones(len(bent))).ratio < oscillation.LEAST_RATIO
    middle = found[:, ::-1] if period == 40.0 else found
    swinging = np.where(np.arange(len(bent)) == 20, 2.5 * middle, middle)
    assert oscillation.line(swinging, np.ones(len(bent))).ratio > oscillation.LEAST_RATIO


def test_a_place_where_drivers_are_unsteady_is_found_by_its_variance_alone():
    rng = np.random.default_rng(6)
    counts = np.full((60, 30), 4.0)
    usual = 1.0 + np.sin(np.arange(30.0) / 5.0) ** 2
    squares = counts * usual * rng.uniform(0.5, 1.5, counts.shape)
    quiet = variance.most_unsteady(variance.Spread(squares, counts), usual, 3)
    assert quiet is not None
    assert quiet.z < 5.0
    squares[:, 10:14] *= 1.6
    found = variance.most_unsteady(variance.Spread(squares, counts), usual, 3)
    assert found is not None
    assert (found.first, found.last) == (10, 14)
    assert found.ratio == pytest.approx(1.6, rel=0.15)
    assert found.z > 8.0


def test_squares_are_counted_by_block_and_bin(driven):
    windows, fit, _, answer = driven
    pulses = pulses_of(windows, fit, answer)
    number = np.zeros((len(windows.seen), w.HORIZON), dtype=np.int64)
    number[:, : w.HORIZON // 2] = -1
    found = variance.spread(pulses, number, 2)
    inside = pulses.variance[:, pulses.score.shape[1] // 2 :] > 0.0
    assert found.counts.sum() == inside.sum()
    assert found.squares.shape == (windows.platoon.max() + 1, 2)
    assert not found.squares[:, 1].any()


def test_where_the_model_brakes_hard_is_not_unsteady_for_that(driven):
    windows, fit, _, answer = driven
    pulses = pulses_of(windows, fit, answer)
    number = np.searchsorted(variance.EFFORT, pulses.state[:, :, ro.BASE_A])
    found = variance.spread(pulses, number, len(variance.EFFORT) + 1)
    some = found.counts.sum(axis=0) > 0
    assert some.sum() > 1
    np.testing.assert_allclose(found.squares.sum(axis=0)[some] / found.counts.sum(axis=0)[some], 1.0)


def one(covariate: str, z: float) -> lo.LeftOver:
    return lo.LeftOver(covariate, (0.0, 1.0), None, None, 1.0, z, 0.0, True)


def test_the_same_thing_is_told_once_and_weak_things_beside_strong_ones_are_not_told():
    found = (
        one("time in lane 2", 16.0),
        one("delay over time in lane 2", -14.0),
        one("lane", 12.0),
        one("position", 6.0),
    )
    assert [told.covariate for told in lo.told(found)] == ["time in lane 2", "lane"]


def test_a_band_that_moves_is_on_the_road_as_long_as_plain_geometry_says():
    path = ff.Path(2.0, (100.0, 700.0), (0.0, 300.0))
    came, left = path.stay(np.array([400.0, 100.0, 950.0]))
    # In the middle of the road in the middle of the time; at its beginning then; one that is nearly past it at the start.
    np.testing.assert_allclose(came, [0.0, 150.0, 0.0])
    np.testing.assert_allclose(left, [300.0, 300.0, 25.0])
    edges = path.bands()
    assert edges[0] >= 100.0 - ff.BAND_BIN
    assert edges[-1] <= 700.0 + ff.BAND_BIN
    place, time = path.swept(390.0, 420.0)
    assert place == (100.0, 700.0)
    assert time == (0.0, 300.0)


@pytest.mark.parametrize("speed", [-5.0, 2.0])
def test_a_band_that_moves_is_found_at_its_speed(driven, speed):
    windows, fit, grid, _ = driven
    seen = windows.seen.copy()
    shift = np.repeat(np.random.default_rng(3).uniform(0.0, 120.0, windows.drivers), len(seen) // windows.drivers)
    seen[:, w.TIME] += shift[:, None]  # driver by driver, or all would be at a place at the same time
    windows = replace(windows, seen=seen)
    grid = rg.grid_of(windows)
    middle = 0.5 * (grid.time[0] + grid.time[-1])
    band = seen[:, w.X, w.LEAD : -1] - speed * (seen[:, w.TIME, w.LEAD : -1] - middle)
    begin = float(np.quantile(band, 0.42))
    pushed_on = pushed(windows, fit, np.where((band > begin) & (band < begin + 40.0), -0.4, 0.0))
    replicate = lo.evaluate(windows, fit, grid, rg.answer_of(windows, fit, grid.pivot))
    found = lo.left_over(pushed_on, fit, grid, rg.answer_of(pushed_on, fit, grid.pivot), [replicate], [replicate], 1.0)
    moving = [one for one in found if one.covariate.startswith(ff.MOVING)]
    assert [one.covariate for one in moving] == [f"{ff.MOVING}{speed:g} m/s"]
    assert moving[0].value < 0.0
    assert moving[0].range[0] < begin + 20.0 < moving[0].range[1]
    assert abs(moving[0].z) > max(abs(one.z) for one in found if one.covariate in ("position", "time"))
    assert moving[0].position_m is not None
    assert moving[0].time_s is not None
