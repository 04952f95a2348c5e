"""From a recording to arrays ``(vehicles, frames)``: the drivers to be modelled and their traffic."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders_from_headway import leader_lengths, recorded_leaders
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.scenes.traffic import Traffic, build_traffic, sort_into_cells

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TOO_SHORT = "window too short"
LEADER_FROM_LANE = "lane"  # whoever is recorded ahead in the driver's lane at its simulated position
LEADER_OF_TWIN = "twin"  # whoever the recorded twin followed: all that its headway tells


@dataclass(frozen=True)
class Window:
    """Which part of a trajectory is observed and which is simulated, in frames.

    Attributes
    ----------
    observed : int
        The driving code sees frames ``0 .. observed - 1``.
    horizon : int
        Simulated frames.
    from_entry : bool
        Whether the simulation starts at frame 0 (the paper's apparent choice) and not at
        the last observed frame.
    every : int or None
        Start a further window every so many frames; by default one window a vehicle, at entry.
    """

    observed: int = 10
    horizon: int = 100
    from_entry: bool = False
    every: int | None = None

    @property
    def start(self) -> int:
        """Frame of the window at which the simulated car stands where the recorded one does."""
        return 0 if self.from_entry else self.observed - 1

    @property
    def frames(self) -> int:
        """Frames a vehicle must be recorded for."""
        return max(self.observed, self.start + self.horizon + 1)


@dataclass(frozen=True)
class Scenes:
    """Drivers of one period, each in its window, with the traffic around.

    Attributes
    ----------
    period : str
    window : Window
    road : Road
        What the drivers and their traffic were recorded on.
    vehicle, first_frame, lane : int64, shape (vehicles,)
        Number; the window's first frame; main lane at the start of the simulation.
    x, y, heading, speed : float64, shape (vehicles, frames)
        The recorded twin: front bumper (m), rad, m/s. No gaps: see :func:`build_scenes`.
    headway : float64, shape (vehicles, frames)
        Front to the recorded leader's front (m), NaN for none.
    length, width : float64, shape (vehicles,)
        m, assumed where ``size_known`` is false.
    vehicle_class : int64, shape (vehicles,)
    size_known : bool, shape (vehicles,)
    cell : int64, shape (vehicles,)
        The cell of ``traffic`` that holds the driver's lane at the window's first frame.
    traffic : Traffic
    leader_source : str
        ``"lane"`` or ``"twin"``.
    """

    period: str
    window: Window
    road: Road
    vehicle: Integers
    first_frame: Integers
    lane: Integers
    x: Floats
    y: Floats
    heading: Floats
    speed: Floats
    headway: Floats
    length: Floats
    width: Floats
    vehicle_class: Integers
    size_known: npt.NDArray[np.bool_]
    cell: Integers
    traffic: Traffic
    leader_source: str

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.vehicle)

    @property
    def start(self) -> int:
        """Frame of the window at which the simulation starts."""
        return self.window.start

    def subset(self, which: npt.NDArray[np.bool_] | Integers) -> Scenes:
        """Return some of the drivers; the traffic stays whole."""
        per_vehicle = ("vehicle", "first_frame", "lane", "x", "y", "heading", "speed", "headway",
                       "length", "width", "vehicle_class", "size_known", "cell")  # fmt: skip
        return replace(self, **{name: getattr(self, name)[which] for name in per_vehicle})


def build_scenes(
    recording: Recording, window: Window, *, modelled: Iterable[int] | None = None
) -> tuple[Scenes, pd.DataFrame]:
    """Cut windows out of one period of a cleaned, smoothed recording.

    Parameters
    ----------
    recording : Recording
        One period.
    window : Window
    modelled : iterable of int, optional
        Vehicles that may be modelled; by default all. The others are traffic.

    Returns
    -------
    scenes : Scenes
    excluded : pandas.DataFrame
        Columns ``period, vehicle, reason``: modelled vehicles without a single whole window.
    """
    table = recording.table
    allowed = table[c.VEHICLE].unique() if modelled is None else np.asarray(sorted(modelled), dtype=np.int64)
    first_row, rows = _longest_runs(table)
    is_allowed = np.isin(table[c.VEHICLE].to_numpy()[first_row], allowed)
    first_row, rows = first_row[is_allowed], rows[is_allowed]
    long_enough = rows >= window.frames
    period = str(table[c.PERIOD].iloc[0])
    excluded = pd.DataFrame(
        {c.PERIOD: period, c.VEHICLE: table[c.VEHICLE].to_numpy()[first_row[~long_enough]], "reason": TOO_SHORT}
    )
    starts = _window_starts(first_row[long_enough], rows[long_enough], window)
    return _cut(recording, period, window, starts), excluded


def _longest_runs(table: pd.DataFrame) -> tuple[Integers, Integers]:
    """Return first row and number of rows of every vehicle's longest unbroken run of frames."""
    vehicle, frame = table[c.VEHICLE].to_numpy(), table[c.FRAME].to_numpy()
    breaks = np.flatnonzero((np.diff(vehicle) != 0) | (np.diff(frame) != 1)) + 1
    first = np.concatenate([[0], breaks])
    rows = np.diff(np.concatenate([first, [len(vehicle)]]))
    order = np.lexsort((first, -rows, vehicle[first]))
    _, best = np.unique(vehicle[first][order], return_index=True)
    return first[order][best], rows[order][best]


def _window_starts(first_row: Integers, rows: Integers, window: Window) -> Integers:
    """Return the first row of every window."""
    if window.every is None:
        return first_row
    counts = (rows - window.frames) // window.every + 1
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.asarray(np.repeat(first_row, counts) + within * window.every)


def _cut(recording: Recording, period: str, window: Window, starts: Integers) -> Scenes:
    """Gather the windows that begin at rows ``starts``."""
    table = recording.table
    rows = starts[:, None] + np.arange(window.frames)
    path = {name: table[name].to_numpy(np.float64)[rows] for name in (c.X, c.Y, c.HEADING, c.SPEED, c.HEADWAY)}
    lane = recording.road.lane_at(path[c.Y][:, window.start])
    first_frame = table[c.FRAME].to_numpy()[starts]
    if recording.has_leader_rows:
        traffic = build_traffic(recording)
        cell = traffic.cell(lane, first_frame)
    else:
        traffic, cell = _private_traffic(recording, rows)
    length, width = (table[name].to_numpy()[starts] for name in (c.LENGTH, c.WIDTH))
    return Scenes(
        period=period, window=window, road=recording.road, vehicle=table[c.VEHICLE].to_numpy()[starts],
        first_frame=first_frame, lane=lane,
        length=np.where(np.isnan(length), recording.road.car_length, length),
        width=np.where(np.isnan(width), recording.road.car_width, width),
        vehicle_class=table[c.CLASS].to_numpy(np.int64)[starts], size_known=~np.isnan(length), cell=cell,
        traffic=traffic, leader_source=LEADER_FROM_LANE if recording.has_leader_rows else LEADER_OF_TWIN, **path,
    )  # fmt: skip


def _private_traffic(recording: Recording, rows: Integers) -> tuple[Traffic, Integers]:
    """Give every window a lane of its own in which only the recorded twin's leader drives."""
    leader = recorded_leaders(recording)
    windows, frames = rows.shape
    cell = np.arange(windows * frames)
    taken = rows.ravel()
    known = np.isfinite(leader.x[taken])
    cell, taken = cell[known], taken[known]
    y = recording.table[c.Y].to_numpy()[taken]
    columns = {
        c.X: leader.x[taken], c.Y: y, c.SPEED: leader.speed[taken], c.HEADING: np.zeros(len(taken)),
        c.LENGTH: leader_lengths(recording)[taken], c.WIDTH: np.full(len(taken), recording.road.car_width),
    }  # fmt: skip
    traffic = sort_into_cells(cell, windows * frames, columns, np.zeros(len(taken), dtype=np.int64), 0, frames)
    return traffic, np.arange(windows) * frames
