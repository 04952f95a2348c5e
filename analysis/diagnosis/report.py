"""``diagnose``: JSON file, tables, figures, extended model and report."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from idm_sumo.calibration.departures import departures
from idm_sumo.diagnosis import Diagnosis
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent

from ..page.manifest import manifest, repeated, write_manifest
from ..page.page import not_measured, render
from ..page.style import save
from ..page.time_space import diagrams_of
from . import words
from .answer import answer
from .content import contract
from .contract import write_diagnosis
from .curves import curves
from .drawing import MODELS, draw, marks_of, marks_on_the_road, samples_of
from .effect_picture import Section, picture_of
from .held_out import write_replays
from .outcome import Outcome, outcome_of
from .shape import ALT, CAPTION, lacks
from .tables import causes_table, gains_table, laws_table, ruled_out_table, unexplained_table, untestable_table

# In this order; the stages of the search in between depend on the data.
STAGES = (
    "reading",
    "cutting windows",
    "fitting drivers",
    "comparing car-following laws",
    "comparing hypotheses",
    "driving with effects and comparing anew",
    "measuring the gain",
    "injecting effects",
    "drawing",
)
MODEL, DRIVERS, DIAGNOSIS = "model.json", "drivers.parquet", "diagnosis.json"
RECENT = 30.0  # s, within which a change of leader is recent


def diagnose_file(
    file: Path, out: Path, *, location: str, seed: int, jobs: int, command: list[str], injections: int = 0,
    progress: Progress = silent,
) -> Diagnosis:  # fmt: skip
    """Diagnose a recording and write the results to a folder.

    Parameters
    ----------
    file : Path
        The recording.
    out : Path
        Folder to write; complete or not at all.
    location : str
        Location to read from a file of several.
    seed : int
        For all random draws.
    jobs : int
        Number of processes.
    command : list of str
        The command line, for the manifest.
    injections : int
        Of each effect and size, to see which would have been found.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    Diagnosis
        The diagnosis.

    Raises
    ------
    InputError
        If the recording cannot be read, or does not suffice for a diagnosis.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        progress("reading", 0, 1)
        recording = clean(read_recording(file, location=location, any_length=True))
        progress("reading", 1, 1)
        found = diagnose(recording, seed=seed, jobs=jobs, injections=injections, progress=progress)
        notes = list(dict.fromkeys((*found.notes, *recording.notes, *recording.accounting.notes)))
        write_diagnosis(part / DIAGNOSIS, contract(found))
        replace(found.model, drivers=DRIVERS).write(part / MODEL)
        own_drivers(found, recording).to_parquet(part / DRIVERS, index=False, write_page_checksum=True)
        _write_tables(found, part / "tables")
        outcome = outcome_of(found)
        pictures = Pictures(file.name, draw(found, part / "figures", progress), notes, command)
        pictures.first = _first_picture(outcome, found, recording, part / "figures")
        if pictures.first is None and lacks(outcome):
            pictures.first = pictures.files["law_misfit"], ALT, CAPTION
        settings = {"recording": str(file), "location": location, "seed": seed, "jobs": jobs, "injections": injections}
        _write_page(found, outcome, recording, part, pictures)
        record = manifest(
            command,
            settings,
            [file],
            seconds=round(time.perf_counter() - begin, 1),
            verdict=found.verdict,
            stages={name: round(seconds, 2) for name, seconds in found.seconds.items()},
            notes=notes,
            rows={"read": recording.accounting.total, "used": recording.accounting.used},
        )
        write_manifest(part / MANIFEST, record)
    return found


@dataclass
class Pictures:
    """What the page shows beside the outcome.

    Attributes
    ----------
    name : str
        Of the recording.
    files : dict of str to Path
        Pictures by name.
    notes, command : list of str
        What a reader must know; the command line.
    first : tuple of (Path, str, str) or None
        The first picture, what is seen on it and how to read it.
    """

    name: str
    files: dict[str, Path]
    notes: list[str]
    command: list[str]
    first: tuple[Path, str, str] | None = None


def _first_picture(
    outcome: Outcome, found: Diagnosis, recording: Recording, folder: Path
) -> tuple[Path, str, str] | None:
    """Draw the first picture, if there is one."""
    samples = samples_of(found) if len(found.residuals) else pd.DataFrame()
    table = curves(samples, MODELS)
    x = recording.table["x"]
    drawn = picture_of(outcome, table, Section(recording.road, float(x.min()), float(x.max())))
    if drawn is None:
        return None
    save(drawn.figure, folder / "effect.png")
    return folder / "effect.png", drawn.alt, drawn.caption


def own_drivers(found: Diagnosis, recording: Recording) -> pd.DataFrame:
    """Return each driver's own parameters with the extended model.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.
    recording : Recording
        The recording, for the departures.

    Returns
    -------
    pandas.DataFrame
        A table like that of ``calibrate``, with the drivers' departures.
    """
    return found.drivers.astype({"period": str}).merge(departures(recording), on=["period", "vehicle"], how="left")


def groups(samples: pd.DataFrame) -> pd.DataFrame:
    """Return errors with and without a recent change of leader.

    A difference would show relaxation.

    Parameters
    ----------
    samples : pandas.DataFrame
        Residuals by window and moment.

    Returns
    -------
    pandas.DataFrame
        One row a group of windows.
    """
    changed = samples.groupby("window")["since_change"].min() < RECENT
    windows = samples.assign(base=samples["base"].abs(), extended=samples["extended"].abs()).groupby("window")
    errors = windows[list(MODELS)].mean().assign(driver=windows["driver"].first())
    rows = []
    for name, chosen in (("a change of leader in or shortly before them", changed), ("no change of leader", ~changed)):
        part = errors[chosen.reindex(errors.index).to_numpy()]
        if len(part):
            errors_of = {f"{model}_ade_m": part[model].mean() for model in MODELS}
            rows.append({"windows with": name, "windows": len(part), "drivers": part["driver"].nunique(), **errors_of})
    return pd.DataFrame(rows)


def _write_tables(found: Diagnosis, folder: Path) -> None:
    """Write everything that the figures show as CSV."""
    folder.mkdir()
    tables = {
        "drivers": found.drivers,
        "residual_curves": curves(samples_of(found), MODELS),
        "causes": causes_table(found.causes),
        "without_gain": causes_table(found.without_gain),
        "gains": gains_table([found.gain, *found.other_gains]),
        "ruled_out": ruled_out_table(found),
        "untestable": untestable_table(found).rename(columns={"effect": "name"}),
        "laws": laws_table(found),
        "detectable": pd.DataFrame([vars(one) for one in found.detectable]),
        "law_misfit": pd.DataFrame() if found.law_misfit is None else found.law_misfit.table,
        "scans": pd.concat(
            [
                pd.DataFrame(
                    {
                        "covariate": scan.covariate,
                        "unit": scan.unit,
                        "low": scan.edges[:-1],
                        "high": scan.edges[1:],
                        "acceleration_m_s2": scan.estimate,
                        "standard_error_m_s2": scan.standard_error,
                    }
                )
                for scan in found.scans
            ]
            or [pd.DataFrame()]
        ),
    }
    for name, table in tables.items():
        if len(table.columns):
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")


def _write_page(found: Diagnosis, outcome: Outcome, recording: Recording, part: Path, pictures: Pictures) -> None:
    """Write the page; replays of three drivers stand beside it."""
    samples = samples_of(found)
    render(
        part / "report.html",
        "diagnosis/report.html.j2",
        title=f"{pictures.name} diagnosed",
        not_measured=not_measured({pictures.name: recording}),
        found=found,
        answer=answer(outcome),
        law_sentence=words.law_sentence(found),
        shape=lacks(outcome),
        shape_alt=ALT,
        shape_caption=CAPTION,
        first=pictures.first,
        pictures=pictures.files,
        marks=bool(marks_of(found)),
        diagrams=diagrams_of({pictures.name: recording}, marks=marks_on_the_road(outcome)),
        replays=write_replays(outcome, found.residuals, recording, part),
        model_file=MODEL,
        gains=gains_table([found.gain, *found.other_gains]),
        groups=groups(samples) if len(samples) else pd.DataFrame(),
        causes=causes_table(found.causes),
        without_gain=causes_table(found.without_gain),
        unexplained=unexplained_table(outcome),
        laws=laws_table(found),
        ruled_out=ruled_out_table(found),
        untestable=untestable_table(found),
        detectable=words.detectable_sentences(found),
        notes=pictures.notes,
        repeat=f"To repeat: {repeated(pictures.command)}",
    )
