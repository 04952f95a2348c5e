"""CRPS and coverage of predicted intervals along the road."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import recorded_from_start
from idm_sumo.prediction import Prediction
from idm_sumo.prediction.noise import ResidualNoise
from idm_sumo.recordings import columns as c
from idm_sumo.simulation.rollout import Trajectories, drive_constant_velocity

from ..drivers import Drivers
from .intervals import share_interval
from .learned import Learned

Floats = npt.NDArray[np.float64]
SECONDS = (1, 3, 5, 10)


def coverage_of(learned: Learned, test: Drivers, driven: dict[str, list[Trajectories]]) -> pd.DataFrame:
    """Return CRPS and coverage of predictions and two baselines.

    All have fitted noise along the road.

    Parameters
    ----------
    learned : Learned
        The predictor and its windows.
    test : Drivers
        Test windows.
    driven : dict of str to list of Trajectories
        By method, one a period.

    Returns
    -------
    pandas.DataFrame
        One row a method and time.
    """
    predictor, train = learned.predictor, learned.windows
    first = predictor.predict_with_spread(learned.first_seconds(test))
    bounds = np.cumsum([0] + [len(s) for s in test.scenes])
    scales = [
        predictor.scale(s, Prediction(first.theta[a:b], first.covariance[a:b], first.status[a:b]))
        for s, a, b in zip(test.scenes, bounds[:-1], bounds[1:], strict=True)
    ]
    residual = learned.residual
    known = {"idm_rollout": (predictor.noise_, _residuals(test, driven["idm_rollout"]), np.concatenate(scales))}
    known["idm_residual"] = (
        residual.noise_,
        _residuals(test, driven["idm_residual"]),
        np.concatenate([residual.scale(s) for s in test.scenes]),
    )
    still = [drive_constant_velocity(s) for s in train.scenes], [drive_constant_velocity(s) for s in test.scenes]
    for name, (seen, unseen) in {
        "constant_velocity": still,
        "idm_pooled": (train.drive(predictor.pooled_), driven["idm_pooled"]),
    }.items():
        before, after = _residuals(train, seen), _residuals(test, unseen)
        known[name] = (ResidualNoise.fit(before, np.ones_like(before)), after, np.ones_like(after))
    driver = test.keys().groupby([c.PERIOD, c.VEHICLE]).ngroup().to_numpy()
    return pd.DataFrame(
        [
            _at(name, *what, driver, seconds)
            for name, what in known.items()
            for seconds in SECONDS
            if 10 * seconds <= what[1].shape[1]
        ]
    )


def _residuals(drivers: Drivers, driven: list[Trajectories]) -> Floats:
    return np.concatenate(
        [(recorded_from_start(s, s.x) - t.x)[:, 1:] for s, t in zip(drivers.scenes, driven, strict=True)]
    )


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
        row[f"coverage_{share:.0%}_low"], row[f"coverage_{share:.0%}_high"] = share_interval(inside, driver)
        row[f"width_{share:.0%}_m"] = float((high - low)[:, k].mean())
    return row
