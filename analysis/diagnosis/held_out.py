"""Replays of three held-out drivers by both models."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from idm_sumo.evaluation.metrics import score
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.extended_rollout import drive_extended
from idm_sumo.simulation.rollout import Trajectories

from ..replay.nearest import nearest
from ..replay.player import Played, write_player
from .figures import BASE, EXTENDED
from .outcome import Outcome

FOLDER = "replays"
PLACES = {"best": 0.0, "median": 0.5, "worst": 1.0}
EVERY = 10  # frames between windows to choose from


class HeldOut(NamedTuple):
    """One of the three drivers.

    Attributes
    ----------
    place : str
        Of its gain among the held-out drivers: best, median or worst.
    text, page : str
        Vehicle; path of its replay from the report.
    base, extended : float
        Its error (m) by both models, as in the table of drivers.
    """

    place: str
    text: str
    page: str
    base: float
    extended: float


def three_drivers(drivers: pd.DataFrame) -> pd.DataFrame:
    """Return held-out drivers of largest, median and smallest gain.

    Parameters
    ----------
    drivers : pandas.DataFrame
        As in ``tables/drivers.csv``.

    Returns
    -------
    pandas.DataFrame
        Their rows with a column ``place``; fewer than three where fewer were held out.
    """
    if not len(drivers):
        return drivers.assign(place=[])
    held = drivers[drivers["held_out"]].dropna(subset=["base_ade", "extended_ade"])
    ordered = held.iloc[np.argsort((held["extended_ade"] - held["base_ade"]).to_numpy(), kind="stable")]
    rows = {round(share * (len(ordered) - 1)): place for place, share in PLACES.items()} if len(ordered) else {}
    return ordered.iloc[list(rows)].assign(place=list(rows.values()))


def write_replays(outcome: Outcome, residuals: pd.DataFrame, recording: Recording, folder: Path) -> list[HeldOut]:
    """Write the page of each of the three drivers.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis that named causes; without any there is nothing to compare.
    residuals : pandas.DataFrame
        Of the held-out drivers; the window in which both models differ most is shown.
    recording : Recording
        Cleaned.
    folder : Path
        Of the report; the pages stand in ``replays`` below it.

    Returns
    -------
    list of HeldOut
        Best gain first; drivers that are recorded for no whole window are left out.
    """
    chosen = three_drivers(outcome.drivers)
    if outcome.content.verdict != "named" or not len(chosen):
        return []
    smoothed, out = smooth(recording), []
    for row in chosen.to_dict("records"):
        period = smoothed.of_period(str(row["period"])) if str(row["period"]) in smoothed.periods else None
        windows = None if period is None else _windows(period, int(row["vehicle"]))
        if period is None or windows is None or not len(windows):
            continue
        (folder / FOLDER).mkdir(exist_ok=True)
        page = f"{FOLDER}/{row['place']}.html"
        _write(folder / page, outcome, row, period, windows, _most_different(residuals, row))
        text = f"vehicle {row['vehicle']} of {row['period']}"
        out.append(HeldOut(str(row["place"]), text, page, float(row["base_ade"]), float(row["extended_ade"])))
    return out


def _windows(recording: Recording, vehicle: int) -> Scenes | None:
    """Return all windows of one vehicle."""
    try:
        return build_scenes(recording, Window(every=EVERY), modelled=[vehicle])
    except IndexError:
        return None


def _most_different(residuals: pd.DataFrame, row: dict[str, object]) -> float:
    """Return the time (s) at which both models differ most."""
    own = residuals[residuals["vehicle"] == row["vehicle"]]
    if "period" in own:
        own = own[own["period"].astype(str) == str(row["period"])]
    if not len(own):
        return 0.0
    apart = (own["base"].abs() - own["extended"].abs()).groupby(own["window"]).mean().abs()
    return float(own.loc[own["window"] == apart.idxmax(), "time"].min())


def _write(
    path: Path, outcome: Outcome, row: dict[str, object], recording: Recording, windows: Scenes, begin: float
) -> None:
    first = int(recording.table[c.FRAME].min())
    starts = (windows.first_frame + windows.start - first) * c.FRAME_STEP
    shown = int(np.argmin(np.abs(starts - begin)))
    apart = np.abs(starts - starts[shown]) >= windows.window.horizon * c.FRAME_STEP
    one = windows.subset(np.array([shown]))
    fitted = windows.subset(np.flatnonzero(apart)[:: windows.window.horizon // EVERY]) if apart.any() else one
    driven = {
        name: _driven(one, fitted, recording, model, row)
        for name, model in ((BASE, outcome.base), (EXTENDED, outcome.model))
    }
    scores = pd.concat([score(one, trajectories).assign(method=name) for name, trajectories in driven.items()])
    base, extended = scores["ade_m"]
    fit = "its other windows" if apart.any() else "this window, the only one"
    write_player(
        path, recording, one, [Played(name, trajectories) for name, trajectories in driven.items()],
        scores[["method", "ade_m", "fde_m", "min_gap_m"]],
        title=f"Vehicle {row['vehicle']} of period {row['period']}, by the base and the extended model",
        answer=f"In this window the base model is {base:.2f} m off on average, the extended model {extended:.2f} m. "
        f"Among the held-out drivers this one has the {row['place']} gain.",
        notes=[note for note in recording.notes if "surrogate" in note.lower()],
        footnote=f"Both models have this driver's own parameters, fitted to {fit}; the window is the one in which the "
        "models differ most. ADE and FDE: mean and final distance between modelled and recorded front bumper.",
        apart=True,
    )  # fmt: skip


def _driven(
    one: Scenes, fitted: Scenes, recording: Recording, model: ExtendedModel, row: dict[str, object]
) -> Trajectories:
    """Return a driver's rollout, fitted to its other windows."""
    own = [row.get(name, value) for name, value in model.parameters._asdict().items()]
    theta, model = nearest(fitted, recording, model, np.array([own], dtype=np.float64), refit=True)
    return drive_extended(one, recording, model, theta, desired_speed=model.desired_speed)
