"""A recording by its path and how it is read."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads import Road
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.sumo.own_recording import read_on_network


@dataclass(frozen=True)
class Source:
    """Where a recording is, and how it is read.

    Attributes
    ----------
    path : Path
        File or folder, in any layout.
    location : str
        Which location to keep of a file that mixes several.
    net : Path or None
        SUMO network that it was recorded on; None for a road that is known.
    corridor : tuple of str
        Edges of the road in driving order.
    route_files : tuple of Path
        With the vehicle types of floating car data.
    name : str
        How messages call it; empty for the path.
    """

    path: Path
    location: str
    net: Path | None = None
    corridor: tuple[str, ...] = ()
    route_files: tuple[Path, ...] = ()
    name: str = ""

    def read(self, *, any_length: bool = False) -> Recording:
        """Return the recording as it is in the file.

        Parameters
        ----------
        any_length : bool
            Whether the section may be longer than the road's.
        """
        if self.net is None:
            return read_recording(self.path, location=self.location, any_length=any_length)
        return read_on_network(
            self.path, self.net, corridor=self.corridor, route_files=self.route_files, location=self.location
        )

    def smoothed(self) -> Recording:
        """Return the recording read, cleaned and smoothed."""
        return smooth(clean(self.read()))


@dataclass(frozen=True)
class Drivers:
    """A driver table and what it was made from.

    Attributes
    ----------
    table : pandas.DataFrame
        One row a driver.
    road : Road
        What they were recorded on.
    left_out : dict of str to int
        Vehicles that are not modelled, by reason.
    notes : tuple of str
        Of the recording.
    rows : (int, int)
        Of the recording: read, and used.
    vehicle_seconds : float
        How long all its vehicles together were recorded (s).
    """

    table: pd.DataFrame
    road: Road
    left_out: dict[str, int]
    notes: tuple[str, ...]
    rows: tuple[int, int]
    vehicle_seconds: float


@dataclass(frozen=True)
class Modelled:
    """The windows of a recording's drivers.

    Attributes
    ----------
    scenes : Scenes
    recording : Recording
        That they were cut from.
    """

    scenes: Scenes
    recording: Recording

    def with_table(self, table: pd.DataFrame) -> Drivers:
        """Return the drivers of these windows.

        Parameters
        ----------
        table : pandas.DataFrame
        """
        reasons = self.scenes.excluded["reason"].value_counts(sort=False)
        left_out = {str(reason): int(count) for reason, count in reasons.items()}
        account = self.recording.accounting
        seconds = len(self.recording.table) * FRAME_STEP
        return Drivers(table, self.scenes.road, left_out, self.recording.notes, (account.total, account.used), seconds)


def modelled(source: Source, window: Window, periods: Iterable[str] = ()) -> Modelled:
    """Return the windows of the wanted periods' drivers.

    Parameters
    ----------
    source : Source
    window : Window
    periods : iterable of str
        All without any.

    Raises
    ------
    InputError
        If no vehicle has a whole window.
    """
    recording = source.smoothed()
    scenes = build_scenes(recording.of_period(*(periods or recording.periods)), window)
    if not len(scenes):
        against = recording.accounting.vehicles_dropped
        told = ", ".join(f"{count} {reason}" for reason, count in against.items())
        raise InputError(
            f"{source.name or source.path}: no vehicle that can be modelled is recorded for {window.frames} frames in "
            "a row"
            + (f" (not modelled: {told})" if told else "")
            + "; lower --observed or --horizon, or see `idm-sumo inspect RECORDING --vehicles`"
        )
    return Modelled(scenes, recording)


def beside(table: pd.DataFrame, *more: pd.DataFrame) -> pd.DataFrame:
    """Join further columns of the same drivers to a table.

    Parameters
    ----------
    table : pandas.DataFrame
    *more : pandas.DataFrame
        With rows in the same order.
    """
    for other in more:
        table = table.join(other[[name for name in other.columns if name not in table.columns]])
    return table
