"""``diagnose``: the contract's file, tables, pictures, the extended model and a page."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.calibration.departures import departures
from idm_sumo.diagnosis import CauseFound, Diagnosis, Gain, RuledOut
from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent

from ..page.manifest import manifest, write_manifest
from ..page.page import not_measured, render
from ..page.style import save
from . import figures, words
from .contract import write_diagnosis
from .curves import curves, lag_response, map_of

# In the order they come; what the search asks in between depends on the data.
STAGES = (
    "reading", "cutting windows", "fitting drivers", "comparing car-following laws", "looking for what some drivers have",
    "measuring the gain", "drawing",
)  # fmt: skip
MODEL, DRIVERS, DIAGNOSIS = "model.json", "drivers.parquet", "diagnosis.json"
MODELS = (figures.BASE, figures.EXTENDED)
PLACES, TIMES = 24, 40  # cells of the map
LONGEST_LAG = 3.0  # s
RECENT = 30.0  # s, within which a leader change counts as one of the driver's

GAIN = ("metric", "base", "extended", "difference", "ci95", "vehicles", "held_out")
NOT_MEASURED = Gain("ade_m", 0.0, 0.0, 0.0, (0.0, 0.0), 0)  # nobody was held out: zero vehicles

Range = tuple[float, float]


def diagnose_file(
    file: Path, out: Path, *, location: str, seed: int, jobs: int, command: list[str], progress: Progress = silent
) -> Diagnosis:
    """Diagnose a recording, leave the results in the folder ``out`` and return the diagnosis.

    Raises
    ------
    InputError
        If the recording cannot be read, or holds nothing that a diagnosis could be made of.
    """
    begin = time.perf_counter()
    with new_folder(out) as part:
        progress("reading", 0, 1)
        recording = clean(read_recording(file, location=location))
        progress("reading", 1, 1)
        found = diagnose(recording, seed=seed, jobs=jobs, progress=progress)
        notes = list(dict.fromkeys((*found.notes, *recording.notes, *recording.accounting.notes)))
        write_diagnosis(part / DIAGNOSIS, contract(found))
        replace(found.model, drivers=DRIVERS).write(part / MODEL)
        own_drivers(found, recording).to_parquet(part / DRIVERS, index=False)
        _write_tables(found, part / "tables")
        pictures = _draw(found, part / "figures", progress)
        settings = {"recording": str(file), "location": location, "seed": seed, "jobs": jobs}
        warning = not_measured({file.name: recording})
        _write_page(found, part, f"{file.name} diagnosed", pictures, notes, command, warning)
        record = manifest(
            command, settings, [file], seconds=round(time.perf_counter() - begin, 1), verdict=found.verdict,
            stages={name: round(seconds, 2) for name, seconds in found.seconds.items()}, notes=notes,
            rows={"read": recording.accounting.total, "used": recording.accounting.used},
        )  # fmt: skip
        write_manifest(part / MANIFEST, record)
    return found


def own_drivers(found: Diagnosis, recording: Recording) -> pd.DataFrame:
    """Return each driver's own parameters with the extended model, and where it departs: a table as that of ``calibrate``."""
    return found.drivers.astype({"period": str}).merge(departures(recording), on=["period", "vehicle"], how="left")


def contract(found: Diagnosis) -> dict[str, Any]:
    """Return what ``diagnosis.json`` holds. A cause without bounds in place or time acts over all that was seen."""
    whole = _extent(found)
    unexplained = [
        {
            "covariate": one.covariate, "range": list(one.range), "position_m": list(one.position_m or whole["position"]),
            "time_s": list(one.time_s or whole["time"]), "p_value": one.p_value,
        }
        for one in found.unexplained
    ]  # fmt: skip
    gain = found.gain or NOT_MEASURED
    return {
        "verdict": found.verdict,
        "causes": [_cause(cause, whole) for cause in found.causes],
        "unexplained": unexplained,
        "gain": {name: getattr(gain, name) for name in GAIN},
        "ruled_out": [
            {"name": one.name, "p_value": one.p_value, "confusable_with": list(one.confusable_with), "why": one.why}
            for one in found.ruled_out
        ],
        "without_gain": [_cause(cause, whole) for cause in found.without_gain],
        "untestable": dict(found.untestable),
        "power": [vars(one) for one in found.power],
        "law": found.model.law,
    }


def _cause(cause: CauseFound, whole: dict[str, Range]) -> dict[str, Any]:
    where = None
    if cause.where is not None:
        where = {
            "position_m": list(cause.where.position_m or whole["position"]),
            "time_s": list(cause.where.time_s or whole["time"]),
            "lanes": None if cause.where.lanes is None else list(cause.where.lanes),
        }
    return {
        "name": cause.name,
        "parameters": {s: {"value": p.value, "unit": p.unit, "ci95": list(p.ci95)} for s, p in cause.parameters.items()},
        "where": where, "p_value": cause.p_value, "share_of_gain": cause.share_of_gain, "evidence": cause.evidence,
    }  # fmt: skip


def _extent(found: Diagnosis) -> dict[str, Range]:
    """Return first and last position (m) and time (s) that were seen."""
    extent: dict[str, Range] = {}
    for name in ("position", "time"):
        values = found.residuals[name].to_numpy(np.float64) if len(found.residuals) else np.zeros(1)
        extent[name] = (float(values.min()), float(values.max()))
    return extent


def _samples(found: Diagnosis) -> pd.DataFrame:
    """Return the residuals with a number for each driver."""
    keys = [name for name in ("period", "vehicle") if name in found.residuals]
    return found.residuals.assign(driver=found.residuals.groupby(keys, observed=True).ngroup())


def groups(samples: pd.DataFrame) -> pd.DataFrame:
    """Return the errors of windows with and without a recent leader change, where relaxation would show."""
    changed = samples.groupby("window")["since_change"].min() < RECENT
    windows = samples.assign(base=samples["base"].abs(), extended=samples["extended"].abs()).groupby("window")
    errors = windows[list(MODELS)].mean().assign(driver=windows["driver"].first())
    rows = []
    for name, chosen in (("a leader change in or shortly before", changed), ("no leader change", ~changed)):
        part = errors[chosen.reindex(errors.index).to_numpy()]
        if len(part):
            rows.append({"windows with": name, "windows": len(part), "drivers": part["driver"].nunique(),
                         "base_ade_m": part["base"].mean(), "extended_ade_m": part["extended"].mean()})  # fmt: skip
    return pd.DataFrame(rows)


def _write_tables(found: Diagnosis, folder: Path) -> None:
    """Write everything the pictures show, as CSV."""
    folder.mkdir()
    tables = {
        "drivers": found.drivers,
        "residual_curves": curves(_samples(found), MODELS),
        "causes": words.causes_table(found.causes),
        "without_gain": words.causes_table(found.without_gain),
        "gains": words.gains_table([found.gain, *found.other_gains]),
        "ruled_out": words.ruled_out_table(found),
        "untestable": pd.DataFrame({"name": list(found.untestable), "reason": list(found.untestable.values())}),
        "power": pd.DataFrame([vars(one) for one in found.power]),
        "laws": words.laws_table(found),
        "scans": pd.concat([pd.DataFrame({
            "covariate": scan.covariate, "unit": scan.unit, "low": scan.edges[:-1], "high": scan.edges[1:],
            "acceleration_m_s2": scan.estimate, "standard_error_m_s2": scan.standard_error,
        }) for scan in found.scans] or [pd.DataFrame()]),
    }  # fmt: skip
    for name, table in tables.items():
        if len(table.columns):
            table.to_csv(folder / f"{name}.csv", index=False, float_format="%.6g")


def _draw(found: Diagnosis, folder: Path, progress: Progress) -> dict[str, Path]:
    """Draw what there is to draw; return the pictures by name."""
    folder.mkdir()
    drawn: dict[str, Any] = {}
    samples = _samples(found)
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
    if found.power:
        shares = [{**vars(one), "share": one.size / words.magnitude(one).typical} for one in found.power]
        drawn["power"] = figures.power_sizes(pd.DataFrame(shares))
    paths = {}
    for done, (name, figure) in enumerate(drawn.items()):
        progress("drawing", done, len(drawn))
        paths[name] = folder / f"{name}.png"
        save(figure, paths[name])
    progress("drawing", len(drawn), len(drawn))
    return paths


def _map(found: Diagnosis, samples: pd.DataFrame) -> Any:
    """Draw place against time, with what was named or is unexplained framed."""
    (low, high), (begin, end) = _extent(found).values()
    places, times = np.linspace(low, high + 1e-6, PLACES + 1), np.linspace(begin, end + 1e-6, TIMES + 1)
    shown = MODELS if found.verdict == "named" else MODELS[:1]
    fields = {model: map_of(samples, model, places, times) for model in shown}
    return figures.where_and_when(fields, places, times, _marks(found))


def _marks(found: Diagnosis) -> list[tuple[Range | None, Range | None]]:
    marks = [(one.where.position_m, one.where.time_s) for one in found.causes if one.where is not None]
    marks += [(one.position_m, one.time_s) for one in found.unexplained]
    return [mark for mark in marks if mark != (None, None)]


def _lag(samples: pd.DataFrame) -> Any:
    """Draw the residual's growth against what the leader did some seconds ago."""
    moments = np.sort(samples["lag"].unique())
    if len(moments) < 4:  # fewer hold no lag
        return None
    step = float(np.median(np.diff(moments)))
    wide = samples.pivot_table(index="window", columns="lag", values=[*MODELS, "leader_acceleration"], observed=True)
    driver = samples.groupby("window")["driver"].first().reindex(wide.index).to_numpy()
    reach = min(int(LONGEST_LAG / step), len(moments) // 2)
    lags = np.arange(-reach, reach + 1)
    leader = wide["leader_acceleration"].to_numpy(np.float64)
    responses = {}
    for model in MODELS:
        speed = np.gradient(wide[model].to_numpy(np.float64), step, axis=1)  # of the speed, not of the position
        responses[model] = lag_response(np.gradient(speed, step, axis=1), leader, driver, lags)
    return figures.lag_figure(np.asarray(lags * step, dtype=np.float64), responses)


def _write_page(
    found: Diagnosis,
    part: Path,
    title: str,
    pictures: dict[str, Path],
    notes: list[str],
    command: list[str],
    warning: str,
) -> None:
    samples = _samples(found)
    drivers = found.drivers
    held_out = int(drivers["held_out"].sum()) if len(drivers) else 0
    counts = f"{len(drivers)} drivers in {int(drivers['windows'].sum()) if len(drivers) else 0} windows, {held_out} of them held out."
    unexplained = pd.DataFrame([
        {"covariate": words.plain(one.covariate), "from": one.range[0], "to": one.range[1], "p": f"{one.p_value:.2g}",
         "position (m)": "everywhere" if one.position_m is None else f"{one.position_m[0]:.0f} to {one.position_m[1]:.0f}",
         "time (s)": "always" if one.time_s is None else f"{one.time_s[0]:.0f} to {one.time_s[1]:.0f}"}
        for one in found.unexplained
    ])  # fmt: skip
    render(
        part / "report.html", "diagnosis/report.html.j2", title=title, not_measured=warning, found=found, headline=words.headline(found),
        gain_sentence=words.gain_sentence(found.gain), law_sentence=words.law_sentence(found),
        pictures=pictures, marks=bool(_marks(found)), model_file=MODEL,
        gains=words.gains_table([found.gain, *found.other_gains]), groups=groups(samples) if len(samples) else pd.DataFrame(),
        causes=words.causes_table(found.causes), without_gain=words.causes_table(found.without_gain), unexplained=unexplained,
        laws=words.laws_table(found), ruled_out=words.ruled_out_table(found), power=words.power_sentences(found), counts=counts, notes=notes, sentence=words.sentence,
        repeat=f"To repeat: {shlex.join(['idm-sumo', *command[1:]])}",
    )  # fmt: skip
