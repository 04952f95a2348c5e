"""Mean residuals by covariate, with intervals over drivers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.stats import t as student

Floats = npt.NDArray[np.float64]

BINS = 9
FEWEST_DRIVERS = 3  # least number of drivers for an interval over drivers


class Covariate(NamedTuple):
    """A quantity against which residuals are shown.

    Attributes
    ----------
    name : str
        Column of the samples.
    label : str
        Label of the axis, with the unit.
    scale : str
        ``"quantiles"``, ``"even"`` bins, or ``"labels"``: the values themselves.
    limits : tuple of float
        Values beyond are left out.
    """

    name: str
    label: str
    scale: str = "quantiles"
    limits: tuple[float, float] = (-np.inf, np.inf)


COVARIATES = (
    Covariate("speed", "speed (m/s)"),
    Covariate("gap", "gap (m)", limits=(0.0, 100.0)),
    Covariate("approach_rate", "approach rate (m/s)", limits=(-10.0, 10.0)),
    Covariate("leader_acceleration", "leader's acceleration (m/s²)", limits=(-5.0, 5.0)),
    Covariate("since_change", "time since a leader change (s)", "even", (0.0, 30.0)),
    Covariate("adjacent_difference", "own minus slower next lane's speed (m/s)", limits=(-15.0, 15.0)),
    Covariate("rear_gap", "gap to the follower (m)", limits=(0.0, 60.0)),
    Covariate("leader_class", "leader's class (1 motorcycle, 2 car, 3 truck)", "labels", (1.0, 3.0)),
    Covariate("lane", "lane (1 leftmost)", "labels"),
    Covariate("lag", "time since the start of the window (s)", "even"),
    Covariate("position", "position along the road (m)", "even"),
    Covariate("time", "time since the period began (s)", "even"),
)


def curves(samples: pd.DataFrame, models: tuple[str, ...]) -> pd.DataFrame:
    """Return mean residuals by covariate and bin.

    Parameters
    ----------
    samples : pandas.DataFrame
        One row a driver and moment: ``driver``, covariates, and one column of residuals a model (any unit).
    models : tuple of str
        Names of those columns.

    Returns
    -------
    pandas.DataFrame
        ``covariate, model, low, centre, high, mean, ci_low, ci_high, drivers``, with 95 % intervals over drivers.
        Covariates that are unknown or constant are left out.
    """
    parts = []
    for covariate in COVARIATES:
        if covariate.name not in samples:
            continue
        values = samples[covariate.name].to_numpy(np.float64)
        known = np.isfinite(values) & (values >= covariate.limits[0]) & (values <= covariate.limits[1])
        edges = _edges(values[known], covariate.scale)
        if len(edges) < 3:
            continue
        part = samples[known]
        number = np.clip(np.searchsorted(edges, values[known], side="right") - 1, 0, len(edges) - 2)
        parts += [_curve(part, number, edges, covariate, model) for model in models]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=_COLUMNS)


_COLUMNS = ["covariate", "model", "low", "centre", "high", "mean", "ci_low", "ci_high", "drivers"]


def _edges(values: Floats, scale: str) -> Floats:
    """Return the edges of the bins.

    Fewer than three mean that there is nothing to compare.
    """
    if not len(values):
        return np.empty(0)
    if scale == "labels":
        labels = np.unique(values)
        return np.append(labels, labels[-1] + 1.0) if len(labels) > 1 else np.empty(0)
    if scale == "even":
        low, high = np.quantile(values, [0.005, 0.995])
        return np.linspace(low, high, BINS + 1) if high > low else np.empty(0)
    return np.unique(np.quantile(values, np.linspace(0.01, 0.99, BINS + 1)))


def _curve(
    part: pd.DataFrame, number: npt.NDArray[np.int64], edges: Floats, covariate: Covariate, model: str
) -> pd.DataFrame:
    """Return the curve of one model against one covariate."""
    mean, half, drivers = clustered_mean(
        part[model].to_numpy(np.float64), part["driver"].to_numpy(), number, len(edges) - 1
    )
    labels = covariate.scale == "labels"
    centre = edges[:-1] if labels else 0.5 * (edges[1:] + edges[:-1])
    table = pd.DataFrame(
        {
            "covariate": covariate.name,
            "model": model,
            "low": edges[:-1],
            "centre": centre,
            "high": edges[:-1] if labels else edges[1:],
            "mean": mean,
            "ci_low": mean - half,
            "ci_high": mean + half,
            "drivers": drivers,
        }
    )
    return table[table["drivers"] >= FEWEST_DRIVERS]


def clustered_mean(
    values: Floats, driver: npt.NDArray[np.int64], number: npt.NDArray[np.int64], bins: int
) -> tuple[Floats, Floats, npt.NDArray[np.int64]]:
    """Return each bin's mean with its 95 % interval.

    The sums of a driver's deviations are independent, its frames are not. So the interval uses the
    cluster-robust variance of a mean (Cameron and Miller 2015, eq. 11) and Student's t with one degree of
    freedom less than there are drivers.

    Parameters
    ----------
    values : float64, shape (samples,)
        Values; NaN is left out.
    driver : array, shape (samples,)
        Label of each value's driver.
    number : int64, shape (samples,)
        Bin of each value.
    bins : int
        Number of bins.

    Returns
    -------
    mean, half : float64, shape (bins,)
        Mean and half the width of its interval.
    drivers : int64, shape (bins,)
        Drivers in each bin.
    """
    used = np.isfinite(values)
    values, number = values[used], number[used]
    _, who = np.unique(driver[used], return_inverse=True)
    count = np.bincount(number, minlength=bins).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(number, values, minlength=bins) / count
        cell = number * (who.max(initial=0) + 1) + who
        _, first, place = np.unique(cell, return_index=True, return_inverse=True)
        sums = np.bincount(place, values - mean[number])
        of = number[first]
        drivers = np.bincount(of, minlength=bins)
        variance = np.bincount(of, sums**2, minlength=bins) / count**2 * drivers / (drivers - 1.0)
        half = student.ppf(0.975, np.maximum(drivers - 1, 1)) * np.sqrt(variance)
    return mean, half, drivers


def map_of(samples: pd.DataFrame, model: str, places: Floats, times: Floats) -> Floats:
    """Return the mean residual by position and time.

    Parameters
    ----------
    samples : pandas.DataFrame
        As in :func:`curves`, with ``position`` (m) and ``time`` (s).
    model : str
        Column of the residuals.
    places, times : float64 array
        Edges of the cells (m, s).

    Returns
    -------
    float64, shape (places - 1, times - 1)
        Means, NaN in cells without samples.
    """
    sums, _, _ = np.histogram2d(samples["position"], samples["time"], bins=[places, times], weights=samples[model])
    count, _, _ = np.histogram2d(samples["position"], samples["time"], bins=[places, times])
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(count > 0, sums / count, np.nan))


def lag_response(
    residual: Floats, leader_acceleration: Floats, driver: npt.NDArray[np.int64], lags: npt.NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Return the residual's correlation with the leader's earlier acceleration.

    Parameters
    ----------
    residual, leader_acceleration : float64, shape (windows, samples)
        Residuals, and acceleration of the leader (m/s²).
    driver : array, shape (windows,)
        Label of each window's driver.
    lags : int64, shape (lags,)
        Lags in samples; positive where the leader moved first.

    Returns
    -------
    mean, half : float64, shape (lags,)
        Correlation and half the width of its 95 % interval.

    Notes
    -----
    A driver who reacts late leaves a residual that follows the leader at positive lags; one who looks
    farther ahead, at negative lags.
    """
    whole = np.isfinite(residual).all(axis=1) & np.isfinite(leader_acceleration).all(axis=1)
    r = residual[whole] - residual[whole].mean(axis=1, keepdims=True)
    a = leader_acceleration[whole] - leader_acceleration[whole].mean(axis=1, keepdims=True)
    size = np.sqrt((r**2).mean() * (a**2).mean()) if whole.any() else np.nan
    mean, half = np.full(len(lags), np.nan), np.full(len(lags), np.nan)
    for place, lag in enumerate(lags.tolist()):
        late = r[:, lag:] if lag >= 0 else r[:, :lag]
        early = a[:, : a.shape[1] - lag] if lag >= 0 else a[:, -lag:]
        product = (late * early).mean(axis=1) / size
        zero = np.zeros(len(product), dtype=np.int64)
        middle, width, _ = clustered_mean(product, driver[whole], zero, 1)
        mean[place], half[place] = middle[0], width[0]
    return mean, half
