"""What prediction is worth in metres, and for whom."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import displacement
from idm_sumo.prediction import observation as o
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.simulation.rollout import Trajectories

from ..drivers import Drivers
from .intervals import share_closed
from .learned import stays_in_lane

Floats = npt.NDArray[np.float64]
Groups = dict[tuple[str, str], npt.NDArray[np.bool_]]

METHODS = ("idm_pooled", "idm_rollout", "idm_residual", "idm_oracle")
PREDICTED = ("idm_rollout", "idm_residual")
AFTER = (3.0, 5.0, 10.0)  # s
STEADY = 1.0  # m/s, below which an approach rate is that of steady following
FEWEST_DRIVERS = 5  # of a group, so that its interval means something


def distances(test: Drivers, driven: dict[str, list[Trajectories]]) -> pd.DataFrame:
    """Return mean distances after some seconds.

    Parameters
    ----------
    test : Drivers
        Windows at entry and along the drivers' way.
    driven : dict of str to list of Trajectories
        By method, one a period.

    Returns
    -------
    pandas.DataFrame
        ``seconds``, and for each method the mean distance (m) over drivers.
    """
    off = {name: _distance(test, driven[name]) for name in METHODS}
    rows = []
    for seconds in AFTER:
        k = round(seconds / FRAME_STEP) - 1
        if k < off["idm_pooled"].shape[1]:
            rows.append({"seconds": seconds} | {name: _by_driver(test, d[:, k]).mean() for name, d in off.items()})
    return pd.DataFrame(rows, columns=["seconds", *METHODS])


def table(test: Drivers, seen: pd.DataFrame, errors: dict[str, Floats]) -> pd.DataFrame:
    """Return gains over the pooled driver, by group.

    Parameters
    ----------
    test : Drivers
        Windows at entry and along the drivers' way.
    seen : pandas.DataFrame
        Their first seconds.
    errors : dict of str to float64 array
        ADE (m) of each window, by method.

    Returns
    -------
    pandas.DataFrame
        One row a group and predicting method: ADE, gain (m) and share, with 95 % bootstrap intervals over drivers.
        Groups of fewer than five drivers are left out.
    """
    every, keys, rows = pd.DataFrame({name: errors[name] for name in METHODS}), test.keys(), []
    for (by, group), which in groups(test, seen).items():
        ade = every[which].groupby([keys[c.PERIOD][which], keys[c.VEHICLE][which]]).mean()
        if len(ade) < FEWEST_DRIVERS:
            continue
        for name in PREDICTED:
            counts = {"drivers": len(ade), "number": int(which.sum())}
            pooled = {"pooled_ade_m": ade["idm_pooled"].mean()}
            rows.append({"by": by, "group": group, "method": name, **pooled, **share_closed(ade, name), **counts})
    return pd.DataFrame(rows)


def groups(test: Drivers, seen: pd.DataFrame) -> Groups:
    """Return which windows belong to which group.

    Parameters
    ----------
    test : Drivers
        Windows.
    seen : pandas.DataFrame
        Their first seconds.

    Returns
    -------
    dict of (str, str) to bool array
        By quantity and group. Thirds of speed and gap are those of these windows; whether the lane changes is known
        in hindsight only.
    """
    found = _thirds("speed", seen[o.SPEED].to_numpy(), "m/s") | _thirds("gap", seen[o.GAP].to_numpy(), "m")
    rate = seen[o.APPROACH_RATE].to_numpy()
    found["approach", "closes in"] = rate > STEADY
    found["approach", "steady"] = np.abs(rate) <= STEADY
    found["approach", "falls back"] = rate < -STEADY
    stays = np.concatenate([stays_in_lane(s) for s in test.scenes])
    found["lane", "stays"], found["lane", "changes"] = stays, ~stays
    return found


def _thirds(by: str, values: Floats, unit: str) -> Groups:
    """Return thirds of windows by a quantity."""
    known = np.isfinite(values)
    if not known.any():
        return {}
    low, high = np.quantile(values[known], [1 / 3, 2 / 3])
    return {
        (by, f"below {low:.0f} {unit}"): known & (values < low),
        (by, f"{low:.0f} to {high:.0f} {unit}"): known & (values >= low) & (values < high),
        (by, f"{high:.0f} {unit} and more"): known & (values >= high),
    }


def _distance(test: Drivers, driven: list[Trajectories]) -> Floats:
    """Return every window's distance (m) at each step."""
    return np.concatenate([displacement(s, t) for s, t in zip(test.scenes, driven, strict=True)])


def _by_driver(test: Drivers, values: Floats) -> pd.Series:
    keys = test.keys()
    return pd.Series(values).groupby([keys[c.PERIOD], keys[c.VEHICLE]]).mean()
