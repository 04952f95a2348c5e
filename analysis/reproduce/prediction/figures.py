"""Figures on prediction: its intervals, and longer observation."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.figure import Figure

from idm_sumo.calibration.population import to_parameters
from idm_sumo.prediction import Prediction
from idm_sumo.prediction.spread import logarithms
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import drive_idm

from ...page.style import METHOD_COLOURS, METHOD_NAMES, RECORDED, new_figure
from ..study import Study
from .for_whom import METHODS, PREDICTED
from .seconds import ORACLE, OWN_PAST, POOLED, RESIDUAL, SECONDS

QUARTILES = (0.25, 0.5, 0.75)
DRAWN = 20  # rollouts with drawn parameters for each driver


def fan(study: Study) -> Figure:
    """Draw predicted intervals and recorded positions of three drivers.

    They are test drivers at the quartiles of the error. Intervals, rollouts of drawn parameters and recorded
    positions are shown as distance along the road from the predicted rollout.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a driver.
    """
    scenes, predictor = max(study.test.scenes, key=len), study.learned.predictor
    found = predictor.predict_with_spread(predictor.observe(scenes))
    own = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
    off = scenes.x[:, own] - drive_idm(scenes, found.theta, desired_speed=predictor.desired_speed_).x
    order = np.argsort(np.abs(off).mean(axis=1), kind="stable")
    figure, axes = new_figure(9.0, 3.4, columns=len(QUARTILES))
    for ax, q in zip(axes, QUARTILES, strict=True):
        which = order[[round(q * (len(order) - 1))]]
        one = scenes.subset(which)
        prediction = Prediction(found.theta[which], found.covariance[which], found.status[which])
        scale, time = predictor.scale(one, prediction)[0], FRAME_STEP * np.arange(off.shape[1])
        for share, alpha in ((0.9, 0.18), (0.5, 0.3)):
            low, high = predictor.noise_.interval(share, scale)
            ax.fill_between(time[1:], low, high, color=METHOD_COLOURS["idm_rollout"], alpha=alpha, linewidth=0,
                            label=f"{share:.0%}")  # fmt: skip
        for path in _drawn(one, prediction, predictor.desired_speed_):
            ax.plot(time, path, color=METHOD_COLOURS["idm_rollout"], linewidth=0.5, alpha=0.5)
        ax.plot(time, off[which[0]], color=RECORDED, label="recorded")
        ax.set(xlabel="time (s)", title=f"vehicle {one.vehicle[0]}")
    axes[0].set_ylabel("ahead of the predicted rollout (m)")
    axes[0].legend(frameon=False)
    return figure


def seconds(table: pd.DataFrame) -> Figure:
    """Draw accuracy against the seconds observed.

    Parameters
    ----------
    table : pandas.DataFrame
        As :func:`analysis.reproduce.prediction.seconds.table` returns it.

    Returns
    -------
    matplotlib.figure.Figure
        ADE on the left, share of the way from pooled to oracle on the right.
    """
    figure, (left, right) = new_figure(9.0, 3.6, columns=2)
    for name in (RESIDUAL, OWN_PAST):
        rows = table[table["method"] == name]
        if rows.empty:
            continue
        look: dict[str, Any] = {
            "color": METHOD_COLOURS[name],
            "marker": "o",
            "markersize": 3,
            "label": METHOD_NAMES[name],
        }
        left.plot(rows["observed_s"], rows["ade_m"], **look)
        ends = np.abs(rows[["share_low", "share_high"]].to_numpy() - rows[["share"]].to_numpy()).T
        right.errorbar(rows["observed_s"], rows["share"], ends, capsize=2, **look)
    for name, share in ((POOLED, 0.0), (ORACLE, 1.0)):
        line: dict[str, Any] = {"color": METHOD_COLOURS[name], "linestyle": "--", "linewidth": 1}
        for ade in table.loc[table["method"] == name, "ade_m"]:
            left.axhline(ade, label=METHOD_NAMES[name], **line)
        right.axhline(share, **line)
    for ax in (left, right):
        ax.set(xscale="log", xlabel="observed (s)")
        ax.set_xticks(SECONDS, [f"{s:g}" for s in SECONDS])
        ax.minorticks_off()
    left.set(ylabel="ADE of what follows (m)", ylim=(0, None))
    right.set(ylabel="share of the way from pooled to oracle")
    if left.lines:
        left.legend(fontsize=8)
    return figure


def for_whom(distances: pd.DataFrame, gains: pd.DataFrame) -> Figure:
    """Draw what prediction is worth in metres, and for whom.

    Parameters
    ----------
    distances, gains : pandas.DataFrame
        As :mod:`analysis.reproduce.prediction.for_whom` returns them.

    Returns
    -------
    matplotlib.figure.Figure
        Distances after some seconds on the left, gains by group with 95 % intervals on the right.
    """
    figure, (left, right) = new_figure(10.0, 4.4, columns=2)
    width = 0.8 / len(METHODS)
    for number, name in enumerate(METHODS):
        at = np.arange(len(distances)) + (number - (len(METHODS) - 1) / 2) * width
        left.bar(at, distances[name], 0.9 * width, color=METHOD_COLOURS[name], label=METHOD_NAMES[name])
    left.set_xticks(np.arange(len(distances)), [f"{s:g} s" for s in distances["seconds"]])
    left.set(xlabel="after", ylabel="mean distance from the recorded vehicle (m)")
    left.legend(fontsize=8)
    labels = (gains["by"] + ": " + gains["group"]).drop_duplicates().tolist()
    for number, name in enumerate(PREDICTED):
        rows = gains[gains["method"] == name]
        at = len(labels) - np.arange(len(rows)) + 0.15 - 0.3 * number
        ends = np.abs(rows[["gain_low_m", "gain_high_m"]].to_numpy() - rows[["gain_m"]].to_numpy()).T
        right.errorbar(rows["gain_m"], at, xerr=ends, fmt="o", markersize=4, capsize=2, color=METHOD_COLOURS[name],
                       label=METHOD_NAMES[name])  # fmt: skip
    right.set_yticks(len(labels) - np.arange(len(labels)), labels)
    right.axvline(0.0, color=METHOD_COLOURS[POOLED], linestyle="--", linewidth=1)
    right.set(xlabel="gain on the pooled driver, ADE (m)")
    return figure


def _drawn(one: Scenes, prediction: Prediction, speed: float) -> npt.NDArray[np.float64]:
    """Return positions of rollouts with drawn parameters.

    They are relative to the predicted rollout.
    """
    rng = np.random.default_rng(0)
    u = rng.multivariate_normal(logarithms(prediction.theta)[0], prediction.covariance[0], DRAWN)
    many = one.subset(np.zeros(DRAWN, dtype=np.int64))
    drawn = drive_idm(many, to_parameters(u), desired_speed=speed)
    return np.asarray(drawn.x - drive_idm(one, prediction.theta, desired_speed=speed).x)
