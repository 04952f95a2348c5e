"""``compare``: recordings held against the first of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.evaluation.comparison import ALL_PERIODS, RECORDING, Comparison, compare, matched_periods
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.text import number
from idm_sumo.sumo.surrogate import SURROGATE
from idm_sumo.sumo.surrogate.builtin import recording_path

from ..page.manifest import manifest, write_manifest
from ..page.page import not_measured, render
from ..page.style import save
from ..page.time_space import diagrams_of
from .figures import overview, time_space

STAGES = ("reading", "measuring", "drawing")
MEASURES = {
    "vehicles": "vehicles",
    "mean_speed_m_s": "mean speed (m/s)",
    "flow_veh_h": "flow, all lanes (1/h)",
    "density_veh_km": "density, all lanes (1/km)",
    "travel_time_s": "median travel time (s)",
    "gap_m": "median gap (m)",
    "time_headway_s": "median time headway (s)",
    "lane_changes_per_km": "lane changes per vehicle-km",
    "merges": "merges",
    "exits": "exits",
    "wave_speed_m_s": "wave speed (m/s)",
}
DISTANCES = {
    "gap_wasserstein_m": "gap (m)",
    "time_headway_wasserstein_s": "time headway (s)",
    "travel_time_wasserstein_s": "travel time (s)",
    "speed_wasserstein_m_s": "speed (m/s)",
    "gap_ks": "gap, KS",
    "time_headway_ks": "time headway, KS",
    "travel_time_ks": "travel time, KS",
    "speed_ks": "speed, KS",
}


def compare_files(
    files: list[str],
    out: Path,
    *,
    minutes: float,
    seed: int,
    location: str,
    command: list[str],
    read: Callable[[Path], Recording] | None = None,
    progress: Progress = silent,
) -> pd.DataFrame:
    """Compare recordings and leave the results in a folder.

    Parameters
    ----------
    files : list of str
        The reference first; the word ``surrogate`` is the built-in recording.
    out : Path
    minutes, seed : float, int
        Of the built-in recording; the seed is the bootstrap's too.
    location : str
        Which part of a file that mixes several.
    command : list of str
        As typed, for the manifest.
    read : callable, optional
        Reads a file, say on a network of the user's own; by default on the road that the file tells.
    progress : Progress
        Called with a stage's name, what is done of it and its total.

    Returns
    -------
    pandas.DataFrame
        The summary, one row a recording and period.

    Raises
    ------
    InputError
        If a recording cannot be read, or is named twice.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        recordings, paths = read_all(files, minutes, seed, location, progress, read=read)
        comparison = compare(recordings, seed=seed, progress=progress)
        write_comparison(comparison, recordings, part, progress)
        _write_page(comparison, recordings, part)
        settings = {"recordings": files, "minutes": minutes, "seed": seed, "location": location}
        record = manifest(
            command,
            settings,
            paths,
            seconds=round(time.perf_counter() - begin, 1),
            notes=all_notes(comparison, recordings),
        )
        write_manifest(part / MANIFEST, record)
    return comparison.summary


def read_all(
    files: list[str],
    minutes: float,
    seed: int,
    location: str,
    progress: Progress,
    *,
    read: Callable[[Path], Recording] | None = None,
) -> tuple[dict[str, Recording], list[Path]]:
    """Read recordings, named after their files.

    Parameters
    ----------
    files : list of str
        ``surrogate`` is the built-in one.
    minutes, seed : float, int
        Of the built-in one.
    location : str
    progress : Progress
        Called with a stage's name, what is done of it and its total.
    read : callable, optional
        As of :func:`compare_files`.

    Returns
    -------
    recordings : dict of str to Recording
    paths : list of Path

    Raises
    ------
    InputError
        If a recording cannot be read, or a name comes twice.
    """
    recordings: dict[str, Recording] = {}
    paths = []
    for done, file in enumerate(files):
        progress("reading", done, len(files))
        path = recording_path(file, minutes=minutes, seed=seed, progress=progress)
        name = SURROGATE if file == SURROGATE else path.name
        if name in recordings:
            raise InputError(f"{file}: a recording of this name is there already; rename one of the files")
        recordings[name] = read_recording(path, location=location) if read is None else read(path)
        paths.append(path)
    progress("reading", len(files), len(files))
    return recordings, paths


def write_comparison(
    comparison: Comparison, recordings: dict[str, Recording], folder: Path, progress: Progress = silent
) -> None:
    """Write the tables and pictures of a comparison.

    Parameters
    ----------
    comparison : Comparison
    recordings : dict of str to Recording
    folder : Path
    progress : Progress
        Called with a stage's name, what is done of it and its total.
    """
    tables, figures = folder / "tables", folder / "figures"
    for place in (tables, figures):
        place.mkdir(exist_ok=True)
    progress("drawing", 0, 2)
    comparison.summary.to_csv(tables / "comparison.csv", index=False, float_format="%.6g")
    for name in ("fields", "positions", "waves"):
        whole = pd.concat({key: getattr(p, name) for key, p in comparison.measures.items()}, names=[RECORDING])
        whole.reset_index(level=0).to_csv(tables / f"{name}.csv", index=False, float_format="%.6g")
    save(overview(comparison), figures / "comparison.png")
    progress("drawing", 1, 2)
    save(time_space(first_periods(recordings)), figures / "time_space.png")
    progress("drawing", 2, 2)


def first_periods(recordings: dict[str, Recording]) -> dict[str, Recording]:
    """Return of every recording what matches the reference's first period.

    Parameters
    ----------
    recordings : dict of str to Recording
    """
    reference = next(iter(recordings.values()))
    first = reference.periods[0]
    chosen = {}
    for name, recording in recordings.items():
        theirs = dict(matched_periods(reference.periods, recording.periods)).get(first)
        if theirs is not None:
            chosen[name] = recording.of_period(theirs)
    return chosen


def all_notes(comparison: Comparison, recordings: dict[str, Recording]) -> list[str]:
    """Return what was assumed in recordings and comparison.

    Parameters
    ----------
    comparison : Comparison
    recordings : dict of str to Recording
    """
    return [
        *comparison.notes,
        *(f"{name}: {note}" for name, recording in recordings.items() for note in recording.notes),
    ]


def shown(comparison: Comparison, period: str | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return measures and distances as the page shows them.

    Parameters
    ----------
    comparison : Comparison
    period : str, optional

    Returns
    -------
    measures : pandas.DataFrame
        One row a measure, one column a recording.
    distances : pandas.DataFrame
        One row a distance from the reference, with its interval.
    """
    summary = comparison.summary
    if period is not None:
        summary = summary[summary[c.PERIOD] == period]
    measures = summary.set_index(RECORDING)[list(MEASURES)].T.rename(index=MEASURES)
    others = summary[summary[RECORDING] != comparison.reference]
    distances = pd.DataFrame(
        {str(row[RECORDING]): [_with_interval(row, name) for name in DISTANCES] for _, row in others.iterrows()},
        index=list(DISTANCES.values()),
    )
    return (
        measures.rename_axis(columns=None).reset_index(names="measure"),
        distances.reset_index(names=f"distance from {comparison.reference}"),
    )


def _with_interval(row: pd.Series, name: str) -> str:
    value, low, high = row[name], row[f"{name}_low"], row[f"{name}_high"]
    return "–" if np.isnan(value) else f"{number(value, 2)} ({number(low, 2)} to {number(high, 2)})"


def findings(comparison: Comparison) -> str:
    """Say how far each other recording is from the reference.

    Parameters
    ----------
    comparison : Comparison
    """
    parts = []
    for name in list(comparison.measures)[1:]:
        theirs = last_row(comparison, name)
        own = reference_row(comparison, str(theirs[c.PERIOD]))
        parts.append(
            f"{name}: mean speed {theirs['mean_speed_m_s']:.1f} against {own['mean_speed_m_s']:.1f} m/s, "
            f"median gap {theirs['gap_m']:.1f} "
            f"against {own['gap_m']:.1f} m, median time headway {theirs['time_headway_s']:.2f} against "
            f"{own['time_headway_s']:.2f} s, "
            f"median travel time {theirs['travel_time_s']:.0f} against {own['travel_time_s']:.0f} s, lane "
            f"changes per vehicle-km "
            f"{theirs['lane_changes_per_km']:.2f} against {own['lane_changes_per_km']:.2f}."
        )
    return " ".join(parts)


def last_row(comparison: Comparison, name: str) -> pd.Series:
    """Return a recording's row over all periods.

    If it has one period only, that period's row.

    Parameters
    ----------
    comparison : Comparison
    name : str
    """
    return comparison.summary[comparison.summary[RECORDING] == name].iloc[-1]


def reference_row(comparison: Comparison, period: str) -> pd.Series:
    """Return the reference's row of a period.

    If it has no such row, that over all its periods.

    Parameters
    ----------
    comparison : Comparison
    period : str
    """
    rows = comparison.summary[comparison.summary[RECORDING] == comparison.reference]
    of_period = rows[rows[c.PERIOD] == period]
    return (of_period if len(of_period) else rows).iloc[-1]


def _write_page(comparison: Comparison, recordings: dict[str, Recording], part: Path) -> None:
    periods = list(dict.fromkeys(comparison.summary[c.PERIOD]))
    sections: list[dict[str, Any]] = []
    for period in reversed(periods):  # all of them together first
        measures, distances = shown(comparison, period)
        title = "All periods together" if period == ALL_PERIODS else f"Period {period}"
        sections.append({"title": title, "measures": measures, "distances": distances})
    notes = all_notes(comparison, recordings)
    render(
        part / "report.html",
        "comparison/report.html.j2",
        title=f"{' and '.join(recordings)} compared",
        findings=findings(comparison),
        not_measured=not_measured(recordings),
        figures=part / "figures",
        diagrams=diagrams_of(first_periods(recordings)),
        sections=sections,
        notes=notes,
    )
