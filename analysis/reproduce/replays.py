"""Drivers behind the table of methods.

A page that plays each method's best, median and worst.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.prediction import RolloutPredictor
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories

from ..page.style import method_name
from ..replay.player import Played, write_player
from .results import Results

Floats = npt.NDArray[np.float64]

FOLDER = "replays"
PLAYED = ("constant_velocity", "irl_rl", "idm_average", "idm_prediction", "idm_rollout", "idm_pooled", "idm_oracle")
ROLLOUT, SHARES = "idm_rollout", (0.9, 0.5)  # of the drivers lie between the ends of these intervals
PLACES = {"best": 0.0, "median": 0.5, "worst": 1.0}


class Driver(NamedTuple):
    """One driver of a table.

    The page plays it.

    Attributes
    ----------
    text : str
        Vehicle and error.
    page : str
        Path from the report.
    """

    text: str
    page: str


class Row(NamedTuple):
    """Three drivers of one method.

    Attributes
    ----------
    method : str
        As readers know it.
    best, median, worst : Driver
    """

    method: str
    best: Driver
    median: Driver
    worst: Driver


def write_replays(results: Results, folder: Path) -> list[Row]:
    """Write the pages of the drivers.

    Each method has three: those it drives best, at the median and worst.

    Parameters
    ----------
    results : Results
    folder : Path
        Of the report; the pages stand in ``replays`` below it.

    Returns
    -------
    list of Row
        What the report shows, one row a method.
    """
    (folder / FOLDER).mkdir()
    methods = [name for name in PLAYED if name in results.scores]
    chosen = {name: _places(results.scores[name]["ade_m"].to_numpy()) for name in methods}
    pages = {
        place: _write(results, methods, place, folder) for place in sorted({p for one in chosen.values() for p in one})
    }
    rows = []
    for name, places in chosen.items():
        ade = results.scores[name]["ade_m"].to_numpy()
        three = [Driver(f"{pages[place][0]}, {ade[place]:.2f} m", pages[place][1]) for place in places]
        rows.append(Row(method_name(name), *three))
    return rows


def _places(ade: Floats) -> list[int]:
    """Return the rows of three drivers.

    They have the least, the median and the largest error.
    """
    order = np.argsort(ade, kind="stable")
    return [int(order[round(share * (len(order) - 1))]) for share in PLACES.values()]


def _write(results: Results, methods: list[str], place: int, folder: Path) -> tuple[str, str]:
    """Write one driver's page.

    Return how the report calls it, and its path from there.
    """
    part, row = part_of([len(scenes) for scenes in results.study.test.scenes], place)
    scenes = results.study.test.scenes[part].subset(np.array([row]))
    driven = {name: results.driven[name][part].rows(slice(row, row + 1)) for name in methods}
    fans = {ROLLOUT: _fan(results.study.learned.predictor, scenes, driven[ROLLOUT])} if ROLLOUT in driven else {}
    played = [Played(name, one, name != "constant_velocity", fans.get(name, ())) for name, one in driven.items()]
    table = pd.concat([results.scores[name].iloc[[place]].assign(method=name) for name in methods], ignore_index=True)
    vehicle, period = scenes.vehicle[0], scenes.one_period
    page = f"{FOLDER}/{file_name(period, results.source.periods)}_{vehicle}.html"
    recording = results.source.periods[period]
    seconds = scenes.window.horizon * FRAME_STEP
    best = table.loc[table["ade_m"].idxmin()]
    write_player(
        folder / page, recording, scenes, played, table[["method", "ade_m", "fde_m", "min_gap_m"]],
        title=f"Vehicle {vehicle} of period {period}, driven by {len(methods)} methods",
        answer=f"Over {seconds:g} s {method_name(best['method'])} stays nearest to the recorded "
        f"vehicle: {best['ade_m']:.2f} m away on average.",
        notes=[note for note in recording.notes if "surrogate" in note.lower()],
        footnote="ADE and FDE: mean and final distance between modelled and recorded front bumper.",
    )  # fmt: skip
    return f"vehicle {vehicle}", page


def _fan(predictor: RolloutPredictor, scenes: Scenes, driven: Trajectories) -> list[tuple[float, Floats, Floats]]:
    """Return where the predictor expects the vehicle.

    Intervals (m along the road) about its rollout.
    """
    found = predictor.predict_with_spread(predictor.observe(scenes))
    scale = predictor.scale(scenes, found)[0]
    bands = []
    for share in SHARES:
        low, high = (driven.x[0] + np.append(0.0, end) for end in predictor.noise_.interval(share, scale))
        bands.append((share, low, high))
    return bands


def file_name(period: str, periods: Iterable[str]) -> str:
    """Return a period's name in the name of a file.

    A period may be named by anything, such as a path.

    Parameters
    ----------
    period : str
        Name of a period.
    periods : iterable of str
        All of them.

    Returns
    -------
    str
        The name itself if every system takes it, else its number.
    """
    return period if re.fullmatch(r"[\w-]{1,60}", period) else str(list(periods).index(period) + 1)


def part_of(lengths: list[int], place: int) -> tuple[int, int]:
    """Return part and row of a place.

    The parts are laid end to end.

    Parameters
    ----------
    lengths : list of int
        Rows of each part.
    place : int
        Below their sum.
    """
    part = 0
    while place >= lengths[part]:
        place -= lengths[part]
        part += 1
    return part, place
