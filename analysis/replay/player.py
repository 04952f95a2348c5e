"""A replay that can be played: one page with the road from above and curves over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import LEADER_OF_RECORDED, Scenes
from idm_sumo.simulation.rollout import Trajectories

from ..page.embedded import embedded
from ..page.page import render
from ..page.style import dark_colour, line_dash, method_colour, method_name

AHEAD, BEHIND = 450.0, 300.0  # m of traffic kept around the recorded car


@dataclass(frozen=True)
class Played:
    """One modelled car of a page.

    Attributes
    ----------
    key : str
        Name of the method, as in the tables.
    driven : Trajectories
        Where it drove; the page shows its first vehicle.
    shown : bool
        Whether it is switched on when the page opens.
    fan : sequence of (float, array, array)
        Bands in which the car is expected: probability, lower and upper position (m), shape ``(steps + 1,)``.
    """

    key: str
    driven: Trajectories
    shown: bool = True
    fan: Sequence[tuple[float, npt.NDArray[np.float64], npt.NDArray[np.float64]]] = ()


def write_player(
    path: Path, recording: Recording, scenes: Scenes, played: Sequence[Played], scores: pd.DataFrame, *,
    title: str, answer: str, notes: Sequence[str] = (), footnote: str = "", apart: bool = False,
) -> None:  # fmt: skip
    """Write the page of one driver.

    Parameters
    ----------
    path : Path
        ``.html``, self-contained: it opens from disk and asks nothing of a network.
    recording : Recording
        Whose traffic is shown around the car.
    scenes : Scenes
        One driver in its window.
    played : sequence of Played
        Modelled cars, which the reader can switch on and off.
    scores : pandas.DataFrame
        One row a model, shown below the curves.
    title, answer, footnote : str
        Heading, first sentence, last sentence.
    notes : sequence of str
        What the reader must know of the data, such as that it is no measurement.
    apart : bool
        Whether each modelled car has a road of its own, side by side and played together.
    """
    render(
        path, "replay/player.html.j2", title=title, answer=answer, notes=notes, footnote=footnote, scores=scores,
        road_alt=f"The road from above with recorded vehicle {scenes.vehicle[0]} and {len(played)} modelled cars",
        data=embedded({**player_data(recording, scenes, played), "apart": apart}),
    )  # fmt: skip


def player_data(recording: Recording, scenes: Scenes, played: Sequence[Played]) -> dict[str, Any]:
    """Return what ``player.js`` draws: lists of numbers by frame, ``None`` where nothing is known."""
    steps = played[0].driven.x.shape[1]
    span = slice(scenes.start, scenes.start + steps)
    first = int(scenes.first_frame[0]) + scenes.start
    recorded = {
        "x": numbers(scenes.x[0, span]), "y": numbers(scenes.y[0, span]), "h": numbers(scenes.heading[0, span], 4),
        "v": numbers(scenes.speed[0, span]), "a": numbers(np.gradient(scenes.speed[0, span], c.FRAME_STEP), 2),
        "length": float(scenes.length[0]), "width": float(scenes.width[0]), **_recorded_leader(scenes, steps),
    }  # fmt: skip
    return {
        "step": c.FRAME_STEP,
        "road": _road(recording.road),
        "recorded": recorded,
        "models": [_model(one, number) for number, one in enumerate(played)],
        "traffic": _traffic(recording, scenes, first, steps),
    }


def numbers(values: npt.ArrayLike, digits: int = 2) -> list[float | None]:
    """Return rounded numbers, ``None`` for what is not finite."""
    array = np.asarray(values, dtype=np.float64)
    return [round(float(value), digits) if np.isfinite(value) else None for value in array]


def _road(road: Road) -> dict[str, Any]:
    """Return lane markings and the lanes beside, an open end as ``None``."""
    edge = float(road.markings[-1])
    sides = [
        {
            "name": f"{lane.kind} lane" if lane.kind == "auxiliary" else lane.kind,
            "from_x": lane.start if np.isfinite(lane.start) else None,
            "to_x": lane.end if np.isfinite(lane.end) else None,
            "from_y": edge,
            "to_y": edge - lane.width,
        }
        for lane in road.side_lanes
    ]
    return {"name": road.name, "edges": numbers(road.markings), "sides": sides}


def _recorded_leader(scenes: Scenes, steps: int) -> dict[str, Any]:
    """Return number of and gap to the vehicle that is first ahead of the recorded car in its traffic."""
    t, own = scenes.traffic, int(scenes.vehicle[0])
    leaders: list[int | None] = []
    gaps = np.full(steps, np.nan)
    for k in range(steps):
        frame = scenes.start + k
        cell = int(scenes.cell[0]) + frame
        rows = np.arange(t.offsets[cell], t.offsets[cell + 1])
        ahead = rows[(t.x[rows] > scenes.x[0, frame]) & (t.vehicle[rows] != own)]
        leaders.append(int(t.vehicle[ahead[0]]) if len(ahead) else None)
        if len(ahead):
            gaps[k] = t.x[ahead[0]] - t.length[ahead[0]] - scenes.x[0, frame]
    return {"leader": leaders, "gap": numbers(gaps)}


def _model(one: Played, number: int) -> dict[str, Any]:
    """Return one modelled car."""
    driven = one.driven
    return {
        "key": one.key, "name": method_name(one.key),
        "colour": method_colour(one.key), "colour_dark": dark_colour(one.key),
        "dash": line_dash(number), "shown": one.shown,
        "x": numbers(driven.x[0]), "y": numbers(driven.y[0]), "h": numbers(driven.heading[0], 4),
        "v": numbers(driven.speed[0]), "gap": numbers(driven.gap[0]),
        "a": numbers(np.append(driven.acceleration[0], np.nan)),
        "fan": [{"share": share, "low": numbers(low), "high": numbers(high)} for share, low, high in one.fan],
    }  # fmt: skip


def _traffic(recording: Recording, scenes: Scenes, first: int, steps: int) -> list[dict[str, Any]]:
    """Return the vehicles around, or the recorded leader alone where no other has rows."""
    if scenes.leader_source == LEADER_OF_RECORDED:
        return _leader_alone(scenes, steps)
    table = recording.of_period(scenes.one_period).table
    span = slice(scenes.start, scenes.start + steps)
    near = table[c.X].between(scenes.x[0, span].min() - BEHIND, scenes.x[0, span].max() + AHEAD)
    there = table[c.FRAME].between(first, first + steps - 1) & near & (table[c.VEHICLE] != scenes.vehicle[0])
    road = recording.road
    found = []
    for vehicle, rows in table[there].groupby(c.VEHICLE, sort=True):
        frames = rows[c.FRAME].to_numpy()
        found += [
            _vehicle(int(str(vehicle)), rows.iloc[part], int(frames[part[0]]) - first, road)
            for part in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(frames) != 1) + 1)
        ]
    return found


def _vehicle(number: int, rows: pd.DataFrame, first: int, road: Road) -> dict[str, Any]:
    """Return one vehicle over an unbroken run of frames."""
    length, width = rows[c.LENGTH].iloc[0], rows[c.WIDTH].iloc[0]
    return {
        "id": number, "first": first,
        "length": round(float(length if np.isfinite(length) else road.car_length), 1),
        "width": round(float(width if np.isfinite(width) else road.car_width), 1),
        "x": numbers(rows[c.X], 1), "y": numbers(rows[c.Y], 1), "h": numbers(rows[c.HEADING], 2),
    }  # fmt: skip


def _leader_alone(scenes: Scenes, steps: int) -> list[dict[str, Any]]:
    """Return the leader that the recorded headway tells of, one part for every unbroken stretch."""
    t = scenes.traffic
    rows = np.full(steps, NOBODY)
    for k in range(steps):
        cell = int(scenes.cell[0]) + scenes.start + k
        if t.offsets[cell + 1] > t.offsets[cell]:
            rows[k] = t.offsets[cell]
    frames = np.flatnonzero(rows != NOBODY)
    parts = np.split(frames, np.flatnonzero(np.diff(frames) != 1) + 1) if len(frames) else []
    return [
        {
            "id": int(t.vehicle[rows[part[0]]]), "first": int(part[0]),
            "length": round(float(t.length[rows[part[0]]]), 1), "width": round(float(t.width[rows[part[0]]]), 1),
            "x": numbers(t.x[rows[part]], 1), "y": numbers(t.y[rows[part]], 1), "h": numbers(t.heading[rows[part]], 2),
        }
        for part in parts
    ]  # fmt: skip
