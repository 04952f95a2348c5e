"""Recordings of a run: read, cleaned, smoothed and split."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Accounting
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.ownership import is_whole
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.sumo.surrogate import SURROGATE
from idm_sumo.sumo.surrogate.builtin import surrogate, surrogate_folder

from .drivers import Drivers
from .settings import Settings
from .warm import compile_beside

NOT_MODELLED = [c.PERIOD, c.VEHICLE, "reason"]

ByPeriod = dict[str, frozenset[int]]


@dataclass(frozen=True)
class Source:
    """Cleaned and smoothed periods, split into training and test.

    Attributes
    ----------
    name : str
        What was read.
    periods : dict of str to Recording
        One recording a period in use.
    files : tuple of Path
        Files of the periods.
    train, test : dict of str to frozenset of int
        Vehicles to model, by period.
    accounts : dict of str to Accounting
        Accounting of rows in reading and cleaning, by file.
    not_modelled : pandas.DataFrame
        Vehicles that are traffic only: ``period, vehicle, reason``.
    notes : tuple of str
        What was assumed.
    desired_speed : float, optional
        Of all drivers, in every fit and every rollout (m/s); by default their road's speed limit.
    """

    name: str
    periods: dict[str, Recording]
    files: tuple[Path, ...]
    train: ByPeriod
    test: ByPeriod
    accounts: dict[str, Accounting]
    not_modelled: pd.DataFrame
    notes: tuple[str, ...]
    desired_speed: float | None = None

    def drivers(self, side: ByPeriod, name: str, window: Window) -> tuple[Drivers, pd.DataFrame]:
        """Cut the windows of one side.

        Parameters
        ----------
        side : dict of str to frozenset of int
            Vehicles to model, by period.
        name : str
            Name of the side, for messages.
        window : Window
            Observed and simulated frames.

        Returns
        -------
        drivers : Drivers
            The windows.
        excluded : pandas.DataFrame
            Vehicles without a window: ``period, vehicle, reason``.

        Raises
        ------
        InputError
            If no vehicle has a whole window.
        """
        scenes, excluded = [], []
        for period, modelled in side.items():
            cut = build_scenes(self.periods[period], window, modelled=modelled)
            excluded.append(cut.excluded)
            if len(cut):
                scenes.append(cut)
        if not scenes:
            raise InputError(
                f"{self.name}: no vehicle of {name} period {', '.join(side)} is recorded for "
                f"{window.frames} frames in a row; shorten the horizon or choose other periods"
            )
        return Drivers(tuple(scenes), self.desired_speed), pd.concat(excluded, ignore_index=True)


def load_source(settings: Settings, progress: Progress = silent) -> Source:
    """Read, clean, smooth and split the recordings of a run.

    Parameters
    ----------
    settings : Settings
        Settings of the run.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    Source
        Training and test side.

    Raises
    ------
    InputError
        If a file cannot be used, a named period is in no file, or there are fewer than two vehicles to model.
    """
    files = _files(settings, progress)
    periods: dict[str, Recording] = {}
    accounts, left_out = {}, []
    for index, file in enumerate(files):
        progress("reading", index, len(files))
        recording = smooth(clean(read_recording(file)))
        accounts[file.name] = recording.accounting
        left_out.append(recording.ineligible[NOT_MODELLED])
        for period in recording.periods:
            if period in periods:
                raise InputError(f"{file}: period {period!r} is also in an earlier file; leave one of them out")
            periods[period] = recording.of_period(period)
    progress("reading", len(files), len(files))
    name = ", ".join(SURROGATE if name == SURROGATE else Path(name).name for name in settings.recordings)
    if len({recording.has_leader_rows for recording in periods.values()}) > 1:
        raise InputError(f"{name}: only some of them hold the vehicles ahead; run them separately")
    not_modelled = pd.concat(left_out, ignore_index=True)
    periods = dict(sorted(periods.items(), key=lambda item: float(item[1].table[c.TIME].min())))
    train, test, split_note = _split(name, periods, not_modelled, settings)
    used = {period: recording for period, recording in periods.items() if period in train or period in test}
    notes = dict.fromkeys(note for recording in used.values() for note in recording.notes)
    return Source(
        name, used, tuple(files), train, test, accounts, not_modelled, (*notes, *split_note), settings.desired_speed
    )


def _files(settings: Settings, progress: Progress) -> list[Path]:
    """Return the files to read.

    Of the built-in recording only the periods in use are read.
    """
    files = []
    wanted = {*settings.train, *settings.test}
    for name in settings.recordings:
        if name != SURROGATE:
            files.append(Path(name))
            continue
        parts = sorted(_surrogate(settings, progress).glob("*.parquet"))
        files += [part for part in parts if part.stem in wanted or not (settings.train and settings.test)]
    return files


def _surrogate(settings: Settings, progress: Progress) -> Path:
    """Return the built-in recording.

    While SUMO makes it on one core, the kernels are compiled on another.
    """
    if is_whole(surrogate_folder(settings.minutes, settings.seed)):
        return surrogate(minutes=settings.minutes, seed=settings.seed)
    compiling = compile_beside()
    folder = surrogate(minutes=settings.minutes, seed=settings.seed, progress=progress)
    progress("compiling", 0, 1)
    compiling.result()
    progress("compiling", 1, 1)
    return folder


def _split(
    name: str, periods: dict[str, Recording], not_modelled: pd.DataFrame, settings: Settings
) -> tuple[ByPeriod, ByPeriod, tuple[str, ...]]:
    """Choose training and test drivers.

    They are split by period, or by time of entry within a single one.
    """
    for wanted in (*settings.train, *settings.test):
        if wanted not in periods:
            raise InputError(f"{name}: no period {wanted!r}; it has {', '.join(periods) or 'none of those named'}")
    if both := set(settings.train) & set(settings.test):
        raise InputError(f"period {sorted(both)[0]!r} is both in `train` and in `test`; drivers may not be in both")
    entries = {period: _by_entry(recording, period, not_modelled) for period, recording in periods.items()}
    if (count := sum(map(len, entries.values()))) < 2:
        raise InputError(f"{name}: {count} vehicle(s) to model; training and test need at least one each")
    if len(periods) == 1:
        return _split_by_entry(*entries.popitem())
    train = settings.train or tuple(p for p in periods if p not in settings.test)[:1]
    test = settings.test or tuple(p for p in periods if p not in train)
    if not train or not test:
        raise InputError(f"{name}: training and test need one period each; give --train and --test")
    return {p: frozenset(entries[p]) for p in train}, {p: frozenset(entries[p]) for p in test}, ()


def _by_entry(recording: Recording, period: str, not_modelled: pd.DataFrame) -> list[int]:
    """Return a period's vehicles that may be modelled, by entry."""
    barred = not_modelled.loc[not_modelled[c.PERIOD] == period, c.VEHICLE]
    entry = recording.table.groupby(c.VEHICLE)[c.FRAME].min().drop(barred, errors="ignore")
    return [int(vehicle) for vehicle in entry.sort_values(kind="stable").index]


def _split_by_entry(period: str, ordered: list[int]) -> tuple[ByPeriod, ByPeriod, tuple[str, ...]]:
    """Train on the half that entered first, test on others."""
    half = len(ordered) // 2
    note = (
        f"one period only: trained on the {half} vehicles that entered first, "
        f"tested on the {len(ordered) - half} others"
    )
    return {period: frozenset(ordered[:half])}, {period: frozenset(ordered[half:])}, (note,)
