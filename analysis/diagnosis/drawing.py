"""Which figures a diagnosis gets, and their data."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.diagnosis import CauseFound, Diagnosis, RuledOut
from idm_sumo.runtime.progress import Progress

from ..page.style import save
from ..page.time_space import Mark
from . import figures, words
from .content import Range, extent
from .curves import curves, lag_response, map_of
from .outcome import Outcome

PLACES, TIMES = 24, 40  # cells of the map
MODELS = (figures.BASE, figures.EXTENDED)
LONGEST_LAG = 3.0  # s


def samples_of(found: Diagnosis) -> pd.DataFrame:
    """Return the residuals with a number for each driver.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    pandas.DataFrame
        Residuals with a column ``driver``.
    """
    keys = [name for name in ("period", "vehicle") if name in found.residuals]
    return found.residuals.assign(driver=found.residuals.groupby(keys, observed=True).ngroup())


def draw(found: Diagnosis, folder: Path, progress: Progress) -> dict[str, Path]:
    """Draw the figures that the diagnosis has data for.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.
    folder : Path
        Folder to make.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    dict of str to Path
        Files by name of the figure.
    """
    folder.mkdir()
    drawn: dict[str, Any] = {}
    samples = samples_of(found)
    if len(samples):
        drawn["residuals"] = figures.residual_curves(curves(samples, MODELS))
        drawn["map"] = _map(found, samples)
        if (lag := _lag(samples)) is not None:
            drawn["lag"] = lag
    held_out = found.drivers[found.drivers["held_out"]] if len(found.drivers) else found.drivers
    held_out = held_out.dropna(subset=["base_ade", "extended_ade"]) if len(held_out) else held_out
    if len(held_out) > 1 and found.verdict == "named":
        drawn["gain"] = figures.gain_per_driver(held_out)
    if found.scans:
        drawn["scans"] = figures.free_accelerations(found.scans)
    tried: tuple[Sequence[CauseFound | RuledOut], ...] = (found.causes, found.without_gain, found.ruled_out)
    tests = [(one.name, one.p_value, kind) for kind, each in zip(figures.KINDS, tried, strict=True) for one in each]
    if tests:
        drawn["evidence"] = figures.evidence(pd.DataFrame(tests, columns=["name", "p_value", "kind"]))
    if found.law_misfit is not None and found.law_misfit.surest is not None:
        drawn["law_misfit"] = figures.law_misfit(found.law_misfit)
    paths = {}
    for done, (name, figure) in enumerate(drawn.items()):
        progress("drawing", done, len(drawn))
        paths[name] = folder / f"{name}.png"
        save(figure, paths[name])
    progress("drawing", len(drawn), len(drawn))
    return paths


def _map(found: Diagnosis, samples: pd.DataFrame) -> Any:
    """Draw position against time, with named and unexplained regions framed."""
    (low, high), (begin, end) = extent(found).values()
    places, times = np.linspace(low, high + 1e-6, PLACES + 1), np.linspace(begin, end + 1e-6, TIMES + 1)
    shown = MODELS if found.verdict == "named" else MODELS[:1]
    fields = {model: map_of(samples, model, places, times) for model in shown}
    return figures.where_and_when(fields, places, times, marks_of(found))


def marks_of(found: Diagnosis) -> list[tuple[Range | None, Range | None]]:
    """Return the intervals that the map frames.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    list of (position, time)
        Of named causes and unexplained structure; None for everywhere or always.
    """
    marks = [(one.where.position_m, one.where.time_s) for one in found.causes if one.where is not None]
    marks += [(one.position_m, one.time_s) for one in found.unexplained]
    return [mark for mark in marks if mark != (None, None)]


def marks_on_the_road(outcome: Outcome) -> list[Mark]:
    """Return places and times for a time-space diagram.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    list of Mark
        Causes and unexplained structure that are bounded; times since the period began.
    """
    named = [
        (words.plain(one.name), one.where.position_m, one.where.time_s) for one in outcome.content.causes if one.where
    ]
    rest = [(words.plain(one.covariate), one.position_m, one.time_s) for one in outcome.content.unexplained]
    marks = [
        Mark(label, outcome.bounded("position", place) or (None, None), outcome.bounded("time", time) or (None, None))
        for label, place, time in (*named, *rest)
    ]
    return [mark for mark in marks if (mark.place, mark.time) != ((None, None), (None, None))]


def _lag(samples: pd.DataFrame) -> Any:
    """Draw the residual's acceleration against the leader's earlier acceleration."""
    moments = np.sort(samples["lag"].unique())
    if len(moments) < 4:  # too few for a lag
        return None
    step = float(np.median(np.diff(moments)))
    wide = samples.pivot_table(index="window", columns="lag", values=[*MODELS, "leader_acceleration"], observed=True)
    driver = samples.groupby("window")["driver"].first().reindex(wide.index).to_numpy()
    reach = min(int(LONGEST_LAG / step), len(moments) // 2)
    lags = np.arange(-reach, reach + 1)
    leader = wide["leader_acceleration"].to_numpy(np.float64)
    responses = {}
    for model in MODELS:
        speed = np.gradient(wide[model].to_numpy(np.float64), step, axis=1)  # growth of the speed residual
        responses[model] = lag_response(np.gradient(speed, step, axis=1), leader, driver, lags)
    return figures.lag_figure(np.asarray(lags * step, dtype=np.float64), responses)
