"""Parameters of SUMO's lane changing, fitted to recorded lane changes.

A run of SUMO is noisy and gives no derivative, so a Gaussian process stands for the misfit over the logarithms of the
parameters; each further run is where it expects the largest improvement (Jones, Schonlau and Welch, 1998).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.stats import norm, qmc, wasserstein_distance

from idm_sumo.evaluation import macroscopic as m
from idm_sumo.evaluation.comparison import compare_measures
from idm_sumo.evaluation.traffic_measures import TrafficMeasures

Floats = npt.NDArray[np.float64]

# Between what each is searched; SUMO's default is 1, within both. Only what makes drivers change for speed: what makes
# them change for their way (lcStrategic, lcCooperative) fails after minutes, beyond the runs of a fit, and the gaps
# that are taken follow from the drivers' deceleration (:func:`idm_sumo.sumo.closed_loop.populations.assertiveness`).
BOUNDS = {"lcSpeedGain": (0.5, 50.0), "lcLookaheadLeft": (0.5, 20.0)}
RUNS, FIRST = 16, 7  # in all; that are spread over the box before the process says where to go
CANDIDATES = 2048
# How far off counts as one: a fifth in numbers, 40 m where vehicles merge, 1.5 m/s in the mean speed by position, an
# emergency braking for every hundredth vehicle, as many that never enter.
A_FIFTH, MERGE, SPEED, SHARE = float(np.log(1.2)), 40.0, 1.5, 0.01
MISFIT = "misfit"


def lane_change_misfit(
    recorded: TrafficMeasures, simulated: TrafficMeasures, *, brakings: int, left_out: int
) -> dict[str, float]:
    """Return how far simulated lane changes are from recorded ones.

    Parameters
    ----------
    recorded, simulated : TrafficMeasures
        Of the same time and road.
    brakings, left_out : int
        Emergency brakings in the simulation, and vehicles that never entered it, say from an on-ramp.

    Returns
    -------
    dict of str to float
        ``changes, pairs, places`` (numbers in all, by lanes before and after, by place), ``merges`` (their places),
        ``speeds`` (mean by position), ``brakings``, ``left_out``, each in units of what is tolerable, and ``misfit``,
        the root of their mean square.
    """
    places = [_between_main_lanes(one) for one in (recorded, simulated)]
    edges = np.linspace(0.0, recorded.road.length, m.SEGMENTS + 1)
    by_place = [np.histogram(table["x"], edges)[0] for table in places]
    pairs = [table.groupby(["before", "after"]).size() for table in places]
    known = pairs[0].index.union(pairs[1].index)
    summary = compare_measures({"recorded": recorded, "simulated": simulated}, resamples=2).summary
    found = {
        "changes": _off([len(places[0])], [len(places[1])]),
        "pairs": _off(*(one.reindex(known, fill_value=0) for one in pairs)),
        "places": _off(*by_place),
        "merges": _merges_apart(recorded, simulated) / MERGE,
        "speeds": float(summary["speed_profile_rmse_m_s"].iloc[1]) / SPEED,
        "brakings": brakings / (SHARE * int(recorded.counts.sum())),
        "left_out": left_out / (SHARE * int(recorded.counts.sum())),
    }
    return found | {MISFIT: float(np.sqrt(np.mean(np.square(list(found.values())))))}


def _between_main_lanes(measured: TrafficMeasures) -> pd.DataFrame:
    """Return changes from one main lane to another."""
    table = measured.lane_change_places
    return table[(table[["before", "after"]] <= measured.road.main_lanes).all(axis=1)]


def _off(recorded: npt.ArrayLike, simulated: npt.ArrayLike) -> float:
    """Return how far numbers are apart, in fifths.

    The root mean square of the logarithms of their ratios; one is added to each.
    """
    ratios = np.log1p(np.asarray(simulated, dtype=np.float64)) - np.log1p(np.asarray(recorded, dtype=np.float64))
    return float(np.sqrt(np.mean(ratios**2)) / A_FIFTH) if ratios.size else 0.0


def _merges_apart(recorded: TrafficMeasures, simulated: TrafficMeasures) -> float:
    """Return the distance (m) of the places of merges."""
    main, tables = recorded.road.main_lanes, (recorded.lane_change_places, simulated.lane_change_places)
    x = [table.loc[(table["before"] > main) & (table["after"] <= main), "x"] for table in tables]
    if not len(x[0]):
        return 0.0
    return float(wasserstein_distance(*x)) if len(x[1]) else recorded.road.length


def fit_lane_changes(
    evaluate: Callable[[dict[str, float]], Mapping[str, float]], names: Sequence[str] = tuple(BOUNDS), *,
    runs: int = RUNS, seed: int = 1, progress: Callable[[int, int], object] = lambda done, total: None,
) -> pd.DataFrame:  # fmt: skip
    """Search the parameters with the smallest misfit.

    Parameters
    ----------
    evaluate : callable
        Given parameters by name, it runs SUMO and returns what :func:`lane_change_misfit` does.
    names : sequence of str
        Keys of ``BOUNDS`` that are searched.
    runs : int
        Runs of SUMO; the first has SUMO's defaults.
    seed : int
    progress : callable
        Called with the runs done and their total.

    Returns
    -------
    pandas.DataFrame
        One row a run, in order: the parameters, and what ``evaluate`` returned.
    """
    low, high = (np.log([BOUNDS[name][end] for name in names]) for end in (0, 1))
    sobol = qmc.Sobol(len(names), seed=seed)
    points = [(0.0 - low) / (high - low), *sobol.random(8)[: FIRST - 1]]  # the logarithm of SUMO's default is 0
    rows: list[dict[str, Any]] = []
    for run in range(runs):
        if run == len(points):
            points.append(_most_promising(np.array(points), [row[MISFIT] for row in rows], sobol.random(CANDIDATES)))
        values = np.exp(low + points[run] * (high - low))
        parameters = {name: float(f"{value:.3g}") for name, value in zip(names, values, strict=True)}
        rows.append({**parameters, **evaluate(parameters)})
        progress(run + 1, runs)
    return pd.DataFrame(rows)


def _most_promising(points: Floats, misfits: list[float], candidates: Floats) -> Floats:
    """Return the candidate with the largest expected improvement."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import Matern, WhiteKernel

    values = np.log(misfits)
    kernel = Matern(np.full(points.shape[1], 0.5), (0.1, 10.0), nu=2.5) + WhiteKernel(0.05, (1e-3, 0.5))
    process = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=2, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound: a parameter without effect
        process.fit(points, values)
    mean, spread = process.predict(candidates, return_std=True)
    gain = float(values.min()) - mean
    improvement = gain * norm.cdf(gain / spread) + spread * norm.pdf(gain / spread)
    return np.asarray(candidates[int(np.argmax(improvement))])


def best_of(table: pd.DataFrame, names: Sequence[str] = tuple(BOUNDS)) -> dict[str, float]:
    """Return the parameters of the run with the smallest misfit.

    Parameters
    ----------
    table : pandas.DataFrame
        Of :func:`fit_lane_changes`.
    names : sequence of str
        The parameters that were searched.

    Returns
    -------
    dict of str to float
    """
    return {name: float(table.loc[table[MISFIT].idxmin(), name]) for name in names}
