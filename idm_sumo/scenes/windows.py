"""Drivers to be modelled and their traffic, cut from recordings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders_from_headway import leader_lengths, recorded_leaders
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.signals import following
from idm_sumo.scenes.traffic import Traffic, build_traffic, period_numbers, sort_into_cells

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

TOO_SHORT = "window too short"
LEADER_FROM_LANE = "lane"  # whoever is recorded ahead in the driver's lane at its simulated position
LEADER_OF_RECORDED = "twin"  # whoever the recorded vehicle followed: all that its headway tells


@dataclass(frozen=True)
class Window:
    """Which frames of a trajectory are observed and which simulated.

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
        """Frame of the window at which the simulation starts.

        There the modelled vehicle stands where the recorded one does.
        """
        return 0 if self.from_entry else self.observed - 1

    @property
    def frames(self) -> int:
        """Frames a vehicle must be recorded for."""
        return max(self.observed, self.start + self.horizon + 1)


def _nobody() -> pd.DataFrame:
    return pd.DataFrame({c.PERIOD: pd.Series(dtype=str), c.VEHICLE: pd.Series(dtype="int64"), "reason": ""})


@dataclass(frozen=True, repr=False)
class Scenes:
    """Drivers, each in its window, with the traffic around.

    Windows of several periods stand in one list: each knows its period, and its cells of the traffic are of
    that period only. So whatever drives, fits or scores windows needs not know of periods.

    Attributes
    ----------
    period : str, shape (vehicles,)
        Vehicle numbers are unique within one.
    window : Window
    road : Road
        What the drivers and their traffic were recorded on.
    vehicle, first_frame, lane : int64, shape (vehicles,)
        Number; the window's first frame; main lane at the start of the simulation.
    x, y, heading, speed : float64, shape (vehicles, frames)
        The reference trajectory: front bumper (m), rad, m/s. No gaps: see :func:`build_scenes`.
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
        ``"lane"``: whoever is ahead in the lane; ``"twin"``: the recorded vehicle's own leader.
    excluded : pandas.DataFrame
        Vehicles that are not modelled: ``period, vehicle, reason``.
    raw_x, raw_y : float64, shape (vehicles, frames), or None
        Front bumper before smoothing (m); None where nothing was smoothed.
    """

    period: npt.NDArray[np.str_]
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
    excluded: pd.DataFrame = field(default_factory=_nobody)
    raw_x: Floats | None = None
    raw_y: Floats | None = None

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.vehicle)

    def __repr__(self) -> str:
        """Return one line: windows, drivers, periods, frames."""
        drivers = len(self.keys().drop_duplicates([c.PERIOD, c.VEHICLE]))
        return (
            f"<Scenes: {len(self):,} windows of {drivers:,} drivers, period {', '.join(self.periods) or 'none'}, "
            f"{self.window.observed} frames observed, {self.window.horizon} simulated>"
        )

    @property
    def start(self) -> int:
        """Frame of the window at which the simulation starts."""
        return self.window.start

    @property
    def periods(self) -> list[str]:
        """Labels of the periods, in the order of the windows."""
        return list(dict.fromkeys(self.period.tolist()))

    @property
    def one_period(self) -> str:
        """The period of all windows; empty without windows.

        Raises
        ------
        InputError
            If there are several: what plays the traffic frame by frame has one clock.
        """
        self.check_one_period()
        return self.periods[0] if self.periods else ""

    def check_one_period(self) -> None:
        """Raise if there are windows of several periods.

        Raises
        ------
        InputError
            What plays the traffic frame by frame has one clock.
        """
        if len(self.periods) > 1:
            raise InputError(f"scenes of {', '.join(self.periods)}: take one period at a time, see Scenes.by_period")

    def by_period(self) -> list[Scenes]:
        """Return the windows of each period, with that period's traffic."""
        if len(self.periods) <= 1:
            return [self]
        return [self._of_period(period) for period in self.periods]

    def _of_period(self, period: str) -> Scenes:
        part = self.subset(self.period == period)
        if self.leader_source != LEADER_FROM_LANE:
            return part  # every window has its own lane
        cells = self.road.main_lanes * self.traffic.frames
        first = int(part.cell[0]) // cells * cells
        return replace(part, traffic=self.traffic.part(first, first + cells), cell=part.cell - first)

    def cells(self, lane: npt.ArrayLike, step: npt.ArrayLike) -> Integers:
        """Return cells of the traffic around each window.

        Parameters
        ----------
        lane : int array, shape (), (vehicles,) or (vehicles, steps)
            Main lane.
        step : int array, shape () or (steps,)
            Frame of the window.

        Returns
        -------
        int64, shape (vehicles,) or (vehicles, steps)
        """
        lanes, steps = np.asarray(lane, dtype=np.int64), np.asarray(step, dtype=np.int64)
        more = (1,) * max(lanes.ndim - 1, steps.ndim)
        first = (self.cell - self.lane * self.traffic.frames).reshape(-1, *more)
        return np.asarray(first + lanes * self.traffic.frames + steps)

    def subset(self, which: npt.NDArray[np.bool_] | Integers) -> Scenes:
        """Return some of the drivers; the traffic stays whole.

        Parameters
        ----------
        which : bool array, shape (vehicles,), or int array
            A mask, or places of the windows.

        Returns
        -------
        Scenes
        """
        per_vehicle: tuple[str, ...]
        per_vehicle = ("period", "vehicle", "first_frame", "lane", "x", "y", "heading", "speed", "headway",
                       "length", "width", "vehicle_class", "size_known", "cell")  # fmt: skip
        per_vehicle += () if self.raw_x is None else (c.RAW_X, c.RAW_Y)
        return replace(self, **{name: getattr(self, name)[which] for name in per_vehicle})

    def keys(self) -> pd.DataFrame:
        """Return ``period, vehicle, first_frame`` of every window."""
        return pd.DataFrame({c.PERIOD: self.period, c.VEHICLE: self.vehicle, "first_frame": self.first_frame})

    def to_pandas(self) -> pd.DataFrame:
        """Return the recorded drivers, one row a window and frame.

        Returns
        -------
        pandas.DataFrame
            ``period, vehicle, first_frame, frame, x, y, heading, speed, headway`` (m, rad, m/s).
        """
        frames = self.window.frames
        table = self.keys().loc[np.repeat(np.arange(len(self)), frames)].reset_index(drop=True)
        table[c.FRAME] = (self.first_frame[:, None] + np.arange(frames)).ravel()
        paths = {name: getattr(self, name).ravel() for name in (c.X, c.Y, c.HEADING, c.SPEED, c.HEADWAY)}
        return table.assign(**paths)


def build_scenes(
    recording: Recording, window: Window | None = None, *, modelled: Iterable[int] | pd.DataFrame | None = None
) -> Scenes:
    """Cut windows out of a cleaned, smoothed recording.

    Parameters
    ----------
    recording : Recording
        Of one or several periods, which are kept apart.
    window : Window, optional
        One second observed and ten simulated, by default.
    modelled : iterable of int, or pandas.DataFrame with ``period, vehicle``, optional
        Vehicles to model; numbers hold in every period. By default those that cleaning found fit
        (:attr:`~idm_sumo.recordings.recording.Recording.eligible`). The others are traffic.

    Returns
    -------
    Scenes
        On a road with traffic lights a window never holds a moment at which its driver stands or brakes for one
        (:mod:`idm_sumo.scenes.signals`). Its ``excluded`` holds the modelled vehicles without a single whole window,
        and, where ``modelled`` is not given, those that cleaning found unfit.
    """
    window = window or Window()
    first_row, rows = _longest_runs(recording.table)
    keys = recording.table.iloc[first_row][[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: str}).reset_index(drop=True)
    allowed = _is_modelled(keys, recording.eligible if modelled is None else modelled)
    first_row, rows, keys = first_row[allowed], rows[allowed], keys[allowed]
    if recording.road.has_signals and recording.has_leader_rows:
        first_row, rows = following(recording, first_row, rows, window.frames)
    long_enough = rows >= window.frames
    excluded = keys[~long_enough].assign(reason=TOO_SHORT)
    if modelled is None:
        excluded = pd.concat([recording.ineligible.astype({c.PERIOD: str}), excluded])
    starts = _window_starts(first_row[long_enough], rows[long_enough], window)
    return replace(_cut(recording, window, starts), excluded=excluded.reset_index(drop=True))


def _is_modelled(keys: pd.DataFrame, modelled: Iterable[int] | pd.DataFrame) -> npt.NDArray[np.bool_]:
    """Return which vehicles (``period, vehicle``) are named."""
    if not isinstance(modelled, pd.DataFrame):
        return np.isin(keys[c.VEHICLE], np.asarray(sorted(modelled), dtype=np.int64))
    named = pd.MultiIndex.from_frame(modelled[[c.PERIOD, c.VEHICLE]].astype({c.PERIOD: str}))
    return np.asarray(pd.MultiIndex.from_frame(keys).isin(named))


def _longest_runs(table: pd.DataFrame) -> tuple[Integers, Integers]:
    """Find every vehicle's longest unbroken run of frames.

    Returns its first row and its number of rows.
    """
    changes = (np.diff(period_numbers(table)[0]) != 0) | (np.diff(table[c.VEHICLE].to_numpy()) != 0)
    vehicle = np.concatenate([[0], np.cumsum(changes)])
    breaks = np.flatnonzero(changes | (np.diff(table[c.FRAME].to_numpy()) != 1)) + 1
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


def _cut(recording: Recording, window: Window, starts: Integers) -> Scenes:
    """Gather the windows that begin at rows ``starts``."""
    table = recording.table
    rows = starts[:, None] + np.arange(window.frames)
    path = {name: table[name].to_numpy(np.float64)[rows] for name in (c.X, c.Y, c.HEADING, c.SPEED, c.HEADWAY)}
    if c.RAW_X in table:
        path |= {name: table[name].to_numpy(np.float64)[rows] for name in (c.RAW_X, c.RAW_Y)}
    lane = recording.road.lane_at(path[c.Y][:, window.start])
    first_frame = table[c.FRAME].to_numpy()[starts]
    if recording.has_leader_rows:
        traffic = build_traffic(recording)
        period, _ = period_numbers(table)
        cell = traffic.cell(period[starts] * recording.road.main_lanes + lane, first_frame)
    else:
        traffic, cell = _private_traffic(recording, rows)
    length, width = (table[name].to_numpy()[starts] for name in (c.LENGTH, c.WIDTH))
    return Scenes(
        period=table[c.PERIOD].to_numpy()[starts].astype(str), window=window, road=recording.road,
        vehicle=table[c.VEHICLE].to_numpy()[starts], first_frame=first_frame, lane=lane,
        length=np.where(np.isnan(length), recording.road.car_length, length),
        width=np.where(np.isnan(width), recording.road.car_width, width),
        vehicle_class=table[c.CLASS].to_numpy(np.int64)[starts], size_known=~np.isnan(length), cell=cell,
        traffic=traffic, leader_source=LEADER_FROM_LANE if recording.has_leader_rows else LEADER_OF_RECORDED, **path,
    )  # fmt: skip


def _private_traffic(recording: Recording, rows: Integers) -> tuple[Traffic, Integers]:
    """Give every window a lane with only its leader."""
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
    if c.RAW_X in recording.table:
        columns[c.RAW_X] = (recording.table[c.RAW_X] + recording.table[c.HEADWAY]).to_numpy()[taken]
    traffic = sort_into_cells(cell, windows * frames, columns, np.zeros(len(taken), dtype=np.int64), 0, frames)
    return traffic, np.arange(windows) * frames
