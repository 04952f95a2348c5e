"""``compare``: recordings held against the first of them, as tables, pictures and a page."""

from __future__ import annotations

import time
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
from idm_sumo.sumo.surrogate.builtin import SURROGATE, recording_path

from ..page.manifest import manifest, write_manifest
from ..page.page import render
from ..page.style import save
from .figures import overview, time_space

MEASURES = {
    "vehicles": "vehicles", "mean_speed_m_s": "mean speed (m/s)", "flow_veh_h": "flow, all lanes (1/h)",
    "density_veh_km": "density, all lanes (1/km)", "travel_time_s": "median travel time (s)", "gap_m": "median gap (m)",
    "time_headway_s": "median time headway (s)", "lane_changes_per_km": "lane changes per vehicle-km", "merges": "merges",
    "exits": "exits", "wave_speed_m_s": "wave speed (m/s)",
}  # fmt: skip
DISTANCES = {
    "gap_wasserstein_m": "gap (m)", "time_headway_wasserstein_s": "time headway (s)", "travel_time_wasserstein_s": "travel time (s)",
    "speed_wasserstein_m_s": "speed (m/s)", "gap_ks": "gap, KS", "time_headway_ks": "time headway, KS",
    "travel_time_ks": "travel time, KS", "speed_ks": "speed, KS",
}  # fmt: skip


def compare_files(
    files: list[str],
    out: Path,
    *,
    minutes: float,
    seed: int,
    location: str,
    command: list[str],
    progress: Progress = silent,
) -> pd.DataFrame:
    """Compare recordings, leave the results in the folder ``out`` and return the summary.

    Parameters
    ----------
    files : list of str
        The reference first; the word ``surrogate`` is the built-in recording.
    minutes, seed
        Of the built-in recording; the seed is the bootstrap's too.

    Raises
    ------
    InputError
        If a recording cannot be read, or is named twice.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        recordings, paths = read_all(files, minutes, seed, location, progress)
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
    files: list[str], minutes: float, seed: int, location: str, progress: Progress
) -> tuple[dict[str, Recording], list[Path]]:
    """Read recordings by name of file; ``surrogate`` is the built-in one."""
    recordings: dict[str, Recording] = {}
    paths = []
    for number, file in enumerate(files):
        progress("reading", number, len(files))
        path = recording_path(file, minutes=minutes, seed=seed, progress=progress)
        name = SURROGATE if file == SURROGATE else path.name
        if name in recordings:
            raise InputError(f"{file}: a recording of this name is there already; rename one of the files")
        recordings[name] = read_recording(path, location=location)
        paths.append(path)
    progress("reading", len(files), len(files))
    return recordings, paths


def write_comparison(
    comparison: Comparison, recordings: dict[str, Recording], folder: Path, progress: Progress = silent
) -> None:
    """Write the tables and pictures of a comparison below ``folder``."""
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
    """Return the part of every recording that belongs to the reference's first period."""
    reference = next(iter(recordings.values()))
    first = reference.periods[0]
    chosen = {}
    for name, recording in recordings.items():
        theirs = dict(matched_periods(reference.periods, recording.periods)).get(first)
        if theirs is not None:
            chosen[name] = recording.of_period(theirs)
    return chosen


def all_notes(comparison: Comparison, recordings: dict[str, Recording]) -> list[str]:
    """Return what was assumed, of the recordings and of the comparison."""
    return [
        *comparison.notes,
        *(f"{name}: {note}" for name, recording in recordings.items() for note in recording.notes),
    ]


def shown(comparison: Comparison, period: str | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the measures, one row a measure and one column a recording, and the distances with their intervals."""
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
    return "–" if np.isnan(value) else f"{value:.2g} ({low:.2g} to {high:.2g})"


def findings(comparison: Comparison) -> str:
    """Say how far each other recording is from the reference, every number computed."""
    parts = []
    for name in list(comparison.measures)[1:]:
        own, theirs = (last_row(comparison, key) for key in (comparison.reference, name))
        parts.append(
            f"{name}: mean speed {theirs['mean_speed_m_s']:.1f} against {own['mean_speed_m_s']:.1f} m/s, median gap {theirs['gap_m']:.1f} "
            f"against {own['gap_m']:.1f} m, median time headway {theirs['time_headway_s']:.2f} against {own['time_headway_s']:.2f} s, "
            f"median travel time {theirs['travel_time_s']:.0f} against {own['travel_time_s']:.0f} s, lane changes per vehicle-km "
            f"{theirs['lane_changes_per_km']:.2f} against {own['lane_changes_per_km']:.2f}."
        )
    return " ".join(parts)


def last_row(comparison: Comparison, name: str) -> pd.Series:
    """Return a recording's row over all periods, or its only one."""
    return comparison.summary[comparison.summary[RECORDING] == name].iloc[-1]


def _write_page(comparison: Comparison, recordings: dict[str, Recording], part: Path) -> None:
    periods = list(dict.fromkeys(comparison.summary[c.PERIOD]))
    sections: list[dict[str, Any]] = []
    for period in reversed(periods):  # all of them together first
        measures, distances = shown(comparison, period)
        title = "All periods together" if period == ALL_PERIODS else f"Period {period}"
        sections.append({"title": title, "measures": measures, "distances": distances})
    notes = all_notes(comparison, recordings)
    render(
        part / "report.html", "comparison/report.html.j2", title=f"{' and '.join(recordings)} compared", findings=findings(comparison),
        surrogate=SURROGATE in recordings, figures=part / "figures", sections=sections, notes=notes,
    )  # fmt: skip
