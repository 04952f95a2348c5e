"""Fits of drivers: as good as careful references, and a status for whatever cannot be fitted."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate, hierarchical, identifiability, kernel, pooled, reference, solver, status
from idm_sumo.calibration.chunks import chunks, with_needed_traffic
from idm_sumo.calibration.hierarchical import ROUNDS
from idm_sumo.calibration.problem import prepare
from idm_sumo.calibration.search import Search
from idm_sumo.models import idm
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car, recording
from tests.helpers.known_drivers import known_drivers, scenes_of

NAMES = list(idm.IDMParameters._fields)


@pytest.fixture(scope="module")
def known():
    """Drivers that are not quite the IDM: their recorded positions are noisy."""
    return known_drivers(60, noise=0.2, seed=11)


@pytest.fixture(scope="module")
def fits(known):
    return calibrate(known[0])


def test_every_window_has_its_row_and_its_own_figures(known, fits):
    scenes, _ = known
    assert fits["vehicle"].tolist() == scenes.vehicle.tolist()
    assert set(fits["status"]) <= {status.OK, status.NOT_CONVERGED}
    theta = fits[NAMES].to_numpy()
    driven = drive_idm(scenes, theta)
    ade = np.hypot(driven.x[:, 1:] - scenes.x[:, 10:], driven.y[:, 1:] - scenes.y[:, 10:]).mean(axis=1)
    assert fits["ade_m"].to_numpy() == pytest.approx(ade, rel=1e-9)
    assert np.all((theta >= idm.LOWER) & (theta <= idm.UPPER))
    assert (fits["frames"] == 100).all()


def test_no_driver_is_worse_than_by_the_papers_solver(known, fits):
    reference_fits = calibrate(known[0].subset(np.arange(25)), search=Search("l-bfgs-b", starts=5, seed=1))
    ours, theirs = fits["objective"].to_numpy()[:25], reference_fits["objective"].to_numpy()
    assert (ours <= 1.01 * theirs + 0.01).all()
    assert (ours < theirs - 1e-4).any()


def test_the_truth_is_no_better_than_the_fit(known, fits):
    scenes, theta = known
    truth = kernel.costs(prepare(scenes), kernel.to_search(theta)[:, None], 0.0)[:, 0]
    assert (fits["objective"] <= truth + 0.01).all()


def test_the_same_again_whatever_the_chunks(known, fits):
    scenes = known[0]
    pd.testing.assert_frame_equal(calibrate(scenes), fits)
    halves = [calibrate(scenes.subset(part)) for part in (np.arange(30), np.arange(30, 60))]
    pd.testing.assert_frame_equal(pd.concat(halves, ignore_index=True), fits)


def test_two_processes_give_the_same(known, fits):
    done = []
    table = calibrate(known[0], jobs=2, progress=lambda stage, n, total: done.append((stage, n, total)))
    pd.testing.assert_frame_equal(table, fits)
    assert done == [("calibration", 30, 60), ("calibration", 60, 60)]


def test_dask_workers_give_the_same(known, fits):
    joblib = pytest.importorskip("joblib")
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None)
    with cluster, distributed.Client(cluster), joblib.parallel_config(backend="dask"):
        table = calibrate(known[0], jobs=2)
    pd.testing.assert_frame_equal(table, fits)


def test_a_chunk_carries_only_its_traffic():
    cars = [Car(n, x=40.0 * n, lane=2 + n % 2, speed=9.0, first_frame=1 + 30 * n, frames=130) for n in range(1, 6)]
    scenes = build_scenes(recording(*cars), Window())
    theta = (1.0, 1.5, 1.2, 2.0, 0.5)
    for piece, part in chunks(scenes, 1):
        assert len(part.traffic.x) < len(scenes.traffic.x)
        whole = drive_idm(scenes.subset(np.arange(piece.start, piece.stop)), theta)
        assert np.array_equal(drive_idm(part, theta).x, whole.x)
    assert len(with_needed_traffic(scenes).traffic.x) <= len(scenes.traffic.x)


@pytest.mark.parametrize("objective", ["gap", "speed", "log-gap"])
@pytest.mark.parametrize("loss", [None, "huber", "soft-l1"])
def test_every_objective_finds_noiseless_drivers(objective, loss):
    scenes, theta = known_drivers(6, seconds=30, seed=3)
    table = calibrate(scenes, objective=objective, loss=loss)
    assert table["ade_m"].max() < 0.1
    assert np.median(np.abs(table["a"] - theta[:, 0])) < 0.05


def test_a_robust_loss_shrugs_off_a_gap_that_was_mismeasured():
    scenes, _ = known_drivers(60, seconds=30, seed=4)
    x = scenes.x.copy()
    x[:, 100:115] += 12.0
    spoilt = replace(scenes, x=x)
    plain, robust = (calibrate(spoilt, objective="gap", loss=loss) for loss in (None, "huber"))
    masked = calibrate(
        spoilt, mask=np.broadcast_to(~((np.arange(x.shape[1]) >= 100) & (np.arange(x.shape[1]) < 115)), x.shape)
    )
    clean = calibrate(scenes)
    off = [np.median(np.abs(t["a"] - clean["a"])) for t in (plain, robust, masked)]
    assert off[1] < 0.8 * off[0]
    assert off[2] < 0.02
    assert (masked["frames"] == 285).all()


def _windows(**changes):
    """Return ten ordinary windows of which number 3 is changed."""
    scenes, _ = known_drivers(10, seed=6)
    n, frames = scenes.x.shape
    leader_x, leader_speed = np.full((n, frames), np.nan), np.zeros((n, frames))
    leader_x = scenes.x + scenes.headway
    leader_speed = np.gradient(leader_x, 0.1, axis=1)
    x, v = scenes.x.copy(), scenes.speed.copy()
    for name, value in changes.items():
        {"x": x, "v": v, "leader_x": leader_x}[name][3] = value(locals())
    return scenes_of(x, v, leader_x, leader_speed, Window())


NAN_FROM = np.where(np.arange(110) < 15, 1.0, np.nan)
EVERY_OTHER = np.where(np.arange(110) // 3 % 2 == 0, 0.0, 15.0)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"v": lambda w: 0.0 * w["v"][3], "x": lambda w: 0 * w["x"][3] + w["x"][3, 0]}, status.STANDING),
        ({"leader_x": lambda w: np.nan}, status.NO_LEADER),
        ({"leader_x": lambda w: w["leader_x"][3] + EVERY_OTHER}, status.JUMPS),
        ({"leader_x": lambda w: w["x"][3] + 2.0}, status.OVERLAP),
        ({"x": lambda w: w["x"][3] * NAN_FROM}, status.TOO_FEW),
        ({"x": lambda w: np.nan}, status.START_MISSING),
        ({"v": lambda w: np.nan}, status.START_MISSING),
    ],
)
def test_degenerate_windows_have_a_status_and_their_neighbours_do_not_mind(changes, expected):
    table = calibrate(_windows(**changes))
    others = np.arange(10) != 3
    assert len(table) == 10
    assert table["status"][3] == expected
    undisturbed = calibrate(_windows())
    pd.testing.assert_frame_equal(table[others], undisturbed[others])
    fitted = np.isfinite(table.loc[3, NAMES].to_numpy(dtype=float)).all()
    assert fitted == (expected not in status.WITHOUT_FIT)
    assert np.isfinite(table.loc[3, "ade_m"]) == fitted


def test_one_frame_and_no_window_at_all():
    scenes, _ = known_drivers(3, seed=6)
    one_frame = calibrate(replace(scenes, window=Window(horizon=1)))
    assert (one_frame["status"] == status.TOO_FEW).all()
    assert one_frame[NAMES].isna().all(axis=None)
    none = calibrate(scenes.subset(np.arange(0)))
    assert len(none) == 0
    assert list(none) == list(one_frame)


def test_a_hole_in_the_recording_does_not_count():
    scenes, _ = known_drivers(5, seed=8)
    x = scenes.x.copy()
    x[:, 40:60] = np.nan
    table = calibrate(replace(scenes, x=x))
    assert (table["frames"] == 80).all()
    assert table["ade_m"].max() < 0.05


def test_without_a_leader_only_the_acceleration_can_be_known():
    frames, v0 = 110, 24.5872
    v = np.empty((1, frames))
    v[:, 0] = 5.0
    for k in range(frames - 1):
        v[:, k + 1] = v[:, k] + 0.1 * 1.3 * (1 - (v[:, k] / v0) ** 4)
    x = np.concatenate([[[0.0]], 0.1 * np.cumsum(v[:, :-1], axis=1)], axis=1)
    row = calibrate(scenes_of(x, v, np.full_like(x, np.nan), np.zeros_like(x), Window())).iloc[0]
    assert row["status"] == status.NO_LEADER
    assert row["a"] == pytest.approx(1.3, rel=0.01)
    assert {"b", "T", "d0", "d1"} <= set(row["undetermined"].split(","))


def test_bounds_and_flat_directions_are_named(known, fits):
    lower, upper = np.array(idm.LOWER), np.array(idm.UPPER)
    for row, at in zip(fits[NAMES].to_numpy(), fits["at_bound"], strict=True):
        near = np.minimum(row - lower, upper - row) <= 1e-3 * (upper - lower)
        assert at == ",".join(np.array(NAMES)[near])
    assert all(
        set(a.split(",")) <= set(u.split(",")) for a, u in zip(fits["at_bound"], fits["undetermined"], strict=True) if a
    )
    problem = prepare(known[0])
    flat = identifiability.along_flat_direction(problem, kernel.to_search(fits[NAMES]), shares=(0.1, 0.3))
    step = flat[flat["share"] == 0.1]["increase"].dropna()
    random = kernel.to_search(fits[NAMES]) + 0.1 * (kernel.UPPER - kernel.LOWER) / np.sqrt(5)
    across = (
        kernel.costs(problem, np.clip(random, kernel.LOWER, kernel.UPPER)[:, None].copy(), 0.0)[:, 0]
        - fits["objective"]
    )
    assert step.median() < 0.1 * across.median()


def test_one_set_for_all_is_the_best_one_set(known, fits):
    scenes, _ = known
    together = pooled(scenes)
    problem = prepare(scenes)

    def mean_ade(theta):
        z = np.broadcast_to(kernel.to_search(theta), (len(scenes), 1, 5)).copy()
        return kernel.costs(problem, z, 0.0).mean()

    best = mean_ade(together)
    assert fits["objective"].mean() < best < mean_ade(idm.TEXTBOOK)
    assert best <= min(mean_ade(theta) for theta in fits[NAMES].to_numpy())
    assert best <= mean_ade(fits[NAMES].mean().to_numpy())
    assert pooled([scenes.subset(np.arange(20)), scenes.subset(np.arange(20, 60))]) == pytest.approx(together, rel=1e-6)


def test_pooling_needs_somebody():
    scenes, _ = known_drivers(3, seed=6)
    with pytest.raises(InputError, match="pooled calibration: no window"):
        pooled(replace(scenes, x=np.full_like(scenes.x, np.nan)))


def test_the_hierarchy_learns_the_population_and_helps_its_drivers():
    rng = np.random.default_rng(2)
    theta = np.exp(rng.normal(np.log([1.3, 1.8, 1.2, 2.0, 1.0]), [0.25, 0.25, 0.2, 0.2, 0.1], (150, 5)))
    scenes, _ = known_drivers(150, noise=0.2, seed=12, drivers=np.clip(theta, idm.LOWER, idm.UPPER))
    alone = calibrate(scenes)
    drawn, population = hierarchical(scenes)
    assert population.drivers == 150
    assert population.rounds < ROUNDS  # it settled
    assert population.typical() == pytest.approx(np.median(theta, axis=0), rel=0.35, abs=0.6)
    error = [np.abs(np.log(t[["a", "b", "T", "d0"]] / theta[:, :4])).mean().mean() for t in (alone, drawn)]
    assert error[1] < 0.6 * error[0]
    assert (drawn["ade_m"] >= alone["ade_m"] - 0.02).all()
    assert drawn["ade_m"].mean() < alone["ade_m"].mean() + 0.1
    assert drawn["drawn"].between(0.0, 1.0).all()


def test_a_driver_of_whom_little_is_seen_is_drawn_more():
    scenes, _ = known_drivers(40, noise=0.2, seed=13)
    _, population = hierarchical(scenes)
    long, _ = hierarchical(scenes, population=population)
    short, _ = hierarchical(replace(scenes, window=Window(horizon=20)), population=population)
    assert (short["drawn"] > long["drawn"]).mean() > 0.9
    one, same = hierarchical(scenes.subset(np.array([4])), population=population)
    assert same is population
    assert one[NAMES].to_numpy() == pytest.approx(long.loc[[4], NAMES].to_numpy(), rel=1e-6)
    with pytest.raises(InputError, match="1 windows can be fitted"):
        hierarchical(scenes.subset(np.array([4])))


def test_the_reference_minimises_the_same_objective():
    scenes, _ = known_drivers(2, noise=0.1, seed=14)
    problem, which = prepare(scenes), np.arange(2)
    ours = solver.fit_all(problem, which, solver.design_of_starts(solver.STARTS))[1]
    z, value = reference.l_bfgs_b(problem, which, starts=3, derivatives=True)
    assert kernel.costs(problem, z[:, None].copy(), 0.0)[:, 0] == pytest.approx(value, abs=1e-9)
    assert (ours <= 1.01 * value + 0.01).all()


@pytest.mark.parametrize(
    "wrong",
    [{"objective": "rmse"}, {"mask": np.ones(3, dtype=bool)}, {"desired_speed": np.ones(2)}],
)
def test_user_mistakes_are_one_line(known, wrong):
    with pytest.raises(InputError, match=next(iter(wrong))) as caught:
        calibrate(known[0], **wrong)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("options", [{"solver": "newton"}, {"starts": 0}])
def test_an_impossible_search_is_refused_in_one_line(options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        Search(**options)


def test_real_drivers_are_fitted_as_well_as_by_the_papers_solver(shared_data):
    from idm_sumo.recordings.cleaning import clean
    from idm_sumo.recordings.reading import read_recording
    from idm_sumo.recordings.smoothing import smooth

    recorded = read_recording(shared_data / "us101_raw_subset.parquet")
    cleaned = clean(recorded.of_period(recorded.periods[0]))
    scenes = build_scenes(smooth(cleaned), Window())
    some = scenes.subset(np.arange(0, len(scenes), 4))
    ours, paper = calibrate(some), calibrate(some, search=Search("l-bfgs-b", starts=5))
    assert len(ours) > 60
    good = ours["objective"] <= 1.01 * paper["objective"] + 0.01
    assert good.mean() >= 0.95
    bound = ours["at_bound"].str.split(",").explode().isin(NAMES).sum() / ours[NAMES].size
    assert 0.2 < bound < 0.7
