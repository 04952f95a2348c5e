"""What predicting from one second is worth: share of the way from pooled to oracle, and honest intervals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.model_selection import GroupKFold, cross_val_predict

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.kernel import to_search
from idm_sumo.evaluation.metrics import displacement
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import Prediction, RolloutPredictor, first_second
from idm_sumo.prediction.basis import plain
from idm_sumo.prediction.driver_prediction import LEARNING_STEP
from idm_sumo.prediction.noise import ResidualNoise
from idm_sumo.recordings import columns as c
from idm_sumo.roads import road
from idm_sumo.scenes.windows import Scenes, Window
from idm_sumo.simulation.rollout import Trajectories, drive_constant_velocity, drive_idm

from ..drivers import Drivers
from ..settings import Settings
from ..source import Source

Floats = npt.NDArray[np.float64]

TEST_STEP = 60
MOST_DRIVERS = 300  # to learn from
RESAMPLES = 2000
TREES, SMALLEST_LEAF = 60, 5
SECONDS = (1, 3, 5, 10)
FOLDS = 5


@dataclass(frozen=True)
class Learned:
    """The predictor and the training windows it was fitted to."""

    windows: Drivers
    predictor: RolloutPredictor


def learn(source: Source, settings: Settings, window: Window) -> Learned:
    """Fit the predictor to windows all along the training drivers' way."""
    drivers, _ = source.drivers(source.train, "train", replace(window, every=LEARNING_STEP))
    rng = np.random.default_rng(settings.seed)
    windows = Drivers(tuple(some_drivers(scenes, rng) for scenes in drivers.scenes))
    predictor = RolloutPredictor(desired_speed=settings.desired_speed, seed=settings.seed)
    return Learned(windows, predictor.fit(list(windows.scenes)))


def some_drivers(scenes: Scenes, rng: np.random.Generator, most: int = MOST_DRIVERS) -> Scenes:
    """Return the windows of at most so many drivers."""
    vehicles = np.unique(scenes.vehicle)
    if len(vehicles) <= most:
        return scenes
    return scenes.subset(np.isin(scenes.vehicle, rng.choice(vehicles, most, replace=False)))


def test_windows(source: Source, settings: Settings) -> Drivers:
    """Return windows at entry and every six seconds along the test drivers' way."""
    return source.drivers(source.test, "test", replace(settings.window, every=TEST_STEP))[0]


def tables(
    test: Drivers, settings: Settings, learned: Learned, neighbours: Callable[[pd.DataFrame, int], Floats]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the share of the distance closed and the intervals' coverage, on the :func:`test_windows`.

    ``neighbours`` is the paper's prediction from driving codes and a number of neighbours.
    """
    pooled = learned.predictor.pooled_
    theta = learned.predictor.predict(_first_seconds(test))
    driven = {"idm_pooled": test.drive(pooled), "idm_rollout": test.drive(theta)}
    driven["idm_prediction"] = test.drive(neighbours(test.code(settings.observed), settings.neighbours))
    driven["idm_oracle"] = test.drive(np.concatenate([fits_or(s, pooled, settings.desired_speed) for s in test.scenes]))
    errors = {name: np.concatenate([_ade(s, t) for s, t in zip(test.scenes, found, strict=True)])
              for name, found in driven.items()}  # fmt: skip
    for name, with_leader in (("black_box_first_second", False), ("black_box_with_leaders_path", True)):
        errors[name] = _black_box(learned.windows, test, pooled, with_leader=with_leader)
    at_fault = {name: test.score(found)["at_fault"].to_numpy() for name, found in driven.items()}
    return _shares(test, errors, at_fault), _coverage(learned, test, driven)


def explained(learned: Learned, fits: pd.DataFrame, drivers: Drivers) -> pd.DataFrame:
    """Return how much of the variance of each fitted parameter the first second explains in drivers left out.

    Extra trees on the same first second, five folds by driver, in search coordinates; at or below 0 it says nothing.
    """
    theta = fits[list(IDMParameters._fields)].to_numpy(np.float64)
    seen = _first_seconds(drivers).to_numpy(np.float64)
    usable = np.isfinite(theta).all(axis=1) & np.isfinite(seen).all(axis=1)
    keys = drivers.keys()[usable].groupby([c.PERIOD, c.VEHICLE]).ngroup().to_numpy()
    parts = min(FOLDS, len(np.unique(keys)))
    if parts < 2:
        return pd.DataFrame({"parameter": IDMParameters._fields, "r2": np.nan})
    z, inputs = to_search(theta[usable]), plain(seen[usable], learned.predictor.pooled_)
    model = ExtraTreesRegressor(TREES, min_samples_leaf=SMALLEST_LEAF, random_state=0)
    found = cross_val_predict(model, inputs, z, groups=keys, cv=GroupKFold(parts))
    r2 = 1.0 - ((z - found) ** 2).sum(axis=0) / np.maximum(((z - z.mean(axis=0)) ** 2).sum(axis=0), 1e-12)
    return pd.DataFrame({"parameter": IDMParameters._fields, "r2": r2, "drivers": len(z)})


def fits_or(scenes: Scenes, pooled: IDMParameters, desired_speed: float) -> Floats:
    """Return the parameters fitted to each window, the pooled ones where there is no fit."""
    theta = calibrate(scenes, desired_speed=desired_speed)[list(IDMParameters._fields)].to_numpy(np.float64)
    return np.where(np.isfinite(theta), theta, np.asarray(pooled))


def _first_seconds(drivers: Drivers) -> pd.DataFrame:
    return pd.concat([first_second(s) for s in drivers.scenes], ignore_index=True)


def _twin(scenes: Scenes, name: str) -> Floats:
    values: Floats = getattr(scenes, name)
    return values[:, scenes.start : scenes.start + scenes.window.horizon + 1]


def _ade(scenes: Scenes, driven: Trajectories) -> Floats:
    return np.asarray(displacement(scenes, driven).mean(axis=1))


def _black_box(train: Drivers, test: Drivers, pooled: IDMParameters, *, with_leader: bool) -> Floats:
    """Return the ADE of the pooled rollout corrected by extra trees, window by window."""
    model = ExtraTreesRegressor(TREES, min_samples_leaf=SMALLEST_LEAF, max_features=0.5, random_state=0)
    features, targets, _ = _inputs(train, pooled, with_leader)
    model.fit(features, targets)
    features, _, driven = _inputs(test, pooled, with_leader)
    found = []
    for scenes, trajectories, part in zip(test.scenes, driven, test.parts(model.predict(features)), strict=True):
        steps = np.arange(trajectories.x.shape[1])
        whole = np.array([np.interp(steps, _moments(scenes), [0.0, *row]) for row in part]).reshape(len(scenes), -1)
        found.append(_ade(scenes, replace(trajectories, x=trajectories.x + whole)))
    return np.concatenate(found)


def _moments(scenes: Scenes) -> npt.NDArray[np.int64]:
    return np.append(np.arange(0, scenes.window.horizon, 10), scenes.window.horizon)


def _inputs(drivers: Drivers, pooled: IDMParameters, with_leader: bool) -> tuple[Floats, Floats, list[Trajectories]]:
    """Return what the trees see, what they are to say (m every second), and the pooled rollout."""
    driven = drivers.drive(pooled)
    features = [plain(first_second(s).to_numpy(np.float64), pooled) for s in drivers.scenes]
    targets = [(_twin(s, "x") - t.x)[:, _moments(s)[1:]] for s, t in zip(drivers.scenes, driven, strict=True)]
    if with_leader:
        paths = [_leaders_path(s, t) for s, t in zip(drivers.scenes, driven, strict=True)]
        features = [np.column_stack(both) for both in zip(features, paths, strict=True)]
    return np.concatenate(features), np.concatenate(targets), driven


def _leaders_path(scenes: Scenes, driven: Trajectories) -> Floats:
    """Return the pooled rollout and its leader's rear (m from the start) every second; 150 m ahead where there is none."""
    at = _moments(scenes)[1:]
    own = driven.x[:, at] - driven.x[:, :1]
    return np.column_stack([own, own + np.minimum(driven.gap[:, at], 150.0)])


def _shares(test: Drivers, errors: dict[str, Floats], at_fault: dict[str, npt.NDArray[np.bool_]]) -> pd.DataFrame:
    """Return one row a method and kind of windows, with paired bootstrap intervals over drivers."""
    keys = test.keys()
    entry = (keys["first_frame"] == keys.groupby([c.PERIOD, c.VEHICLE])["first_frame"].transform("min")).to_numpy()
    rows, every, stays = [], np.ones(len(keys), dtype=bool), np.concatenate([_stays(s) for s in test.scenes])
    kinds = {"entry": entry, "every 6 s": every, "entry, in lane": entry & stays, "every 6 s, in lane": stays}
    for kind, which in kinds.items():
        if not which.any():
            continue
        by_driver = pd.DataFrame(errors)[which].groupby([keys[c.PERIOD][which], keys[c.VEHICLE][which]]).mean()
        for name in errors:
            hits = int((at_fault[name] & ~at_fault["idm_pooled"])[which].sum()) if name in at_fault else np.nan
            rows.append({"windows": kind, "method": name, **share_closed(by_driver, name), "drivers": len(by_driver),
                         "number": int(which.sum()), "at_fault_beyond_pooled": hits})  # fmt: skip
    return pd.DataFrame(rows)


def _stays(scenes: Scenes) -> npt.NDArray[np.bool_]:
    """Return whose recorded twin stays in its lane."""
    lane = road.lane_at(scenes.y)
    return np.asarray((lane == lane[:, :1]).all(axis=1))


def share_closed(ade: pd.DataFrame, name: str) -> dict[str, float]:
    """Return a method's ADE, what it gains on pooled and its share of the way to the oracle, with 95 % intervals."""
    draws = drawn_anew(len(ade))
    pooled, oracle, own = (ade[which].to_numpy() for which in ("idm_pooled", "idm_oracle", name))
    gain, way = pooled - own, pooled - oracle
    gains, ways = gain[draws].mean(axis=1), way[draws].mean(axis=1)
    gain_ends, ends = np.quantile(gains, [0.025, 0.975]), np.quantile(gains / ways, [0.025, 0.975])
    return {"ade_m": own.mean(), "gain_m": gain.mean(), "gain_low_m": gain_ends[0], "gain_high_m": gain_ends[1],
            "share": gain.mean() / way.mean(), "share_low": ends[0], "share_high": ends[1]}  # fmt: skip


def drawn_anew(drivers: int) -> npt.NDArray[np.int64]:
    """Return rows of drivers drawn with replacement, shape ``(resamples, drivers)``, the same for all methods."""
    return np.random.default_rng(0).integers(drivers, size=(RESAMPLES, drivers))


def _coverage(learned: Learned, test: Drivers, driven: dict[str, list[Trajectories]]) -> pd.DataFrame:
    """Return CRPS and coverage along the road of the prediction and of two baselines with fitted noise."""
    predictor, train = learned.predictor, learned.windows
    first = predictor.predict_with_spread(_first_seconds(test))
    bounds = np.cumsum([0] + [len(s) for s in test.scenes])
    scales = [predictor.scale(s, Prediction(first.theta[a:b], first.covariance[a:b], first.status[a:b]))
              for s, a, b in zip(test.scenes, bounds[:-1], bounds[1:], strict=True)]  # fmt: skip
    known = {"idm_rollout": (predictor.noise_, _residuals(test, driven["idm_rollout"]), np.concatenate(scales))}
    still = [drive_constant_velocity(s) for s in train.scenes], [drive_constant_velocity(s) for s in test.scenes]
    for name, (seen, unseen) in {"constant_velocity": still,
                                 "idm_pooled": (train.drive(predictor.pooled_, drive_idm), driven["idm_pooled"])}.items():  # fmt: skip
        before, after = _residuals(train, seen), _residuals(test, unseen)
        known[name] = (ResidualNoise.fit(before, np.ones_like(before)), after, np.ones_like(after))
    driver = test.keys().groupby([c.PERIOD, c.VEHICLE]).ngroup().to_numpy()
    return pd.DataFrame([_at(name, *what, driver, seconds) for name, what in known.items() for seconds in SECONDS
                         if 10 * seconds <= what[1].shape[1]])  # fmt: skip


def _residuals(drivers: Drivers, driven: list[Trajectories]) -> Floats:
    return np.concatenate([(_twin(s, "x") - t.x)[:, 1:] for s, t in zip(drivers.scenes, driven, strict=True)])


def _at(
    name: str,
    noise: ResidualNoise,
    residuals: Floats,
    scale: Floats,
    driver: npt.NDArray[np.int64],
    seconds: int,
) -> dict[str, float | str]:
    k = 10 * seconds - 1
    row: dict[str, float | str] = {
        "method": name,
        "seconds": seconds,
        "crps_m": float(noise.crps(residuals, scale)[:, k].mean()),
    }
    for share in (0.5, 0.9):
        low, high = noise.interval(share, scale)
        inside = ((residuals >= low) & (residuals <= high))[:, k]
        row[f"coverage_{share:.0%}"] = float(inside.mean())
        row[f"coverage_{share:.0%}_low"], row[f"coverage_{share:.0%}_high"] = _by_drivers(inside, driver)
        row[f"width_{share:.0%}_m"] = float((high - low)[:, k].mean())
    return row


def _by_drivers(inside: npt.NDArray[np.bool_], driver: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Return the 95 % interval of a mean over windows, drivers drawn anew."""
    hits, windows = np.bincount(driver, inside), np.bincount(driver)
    draws = drawn_anew(len(windows))
    low, high = np.quantile(hits[draws].sum(axis=1) / windows[draws].sum(axis=1), [0.025, 0.975])
    return float(low), float(high)
