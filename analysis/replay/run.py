"""One replay: trajectory, scores, time-space picture, animation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from dataclasses import replace as changed
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.driver_table import DESIRED_SPEED, FIRST_FRAME, read_drivers
from idm_sumo.evaluation.metrics import score
from idm_sumo.models.effects import ExtendedModel
from idm_sumo.prediction.residual_drive import MODEL, ResidualDrivers, drive_residual
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import MANIFEST, new_folder
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.text import ranges
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.extended_rollout import drive_extended
from idm_sumo.simulation.rollout import Trajectories, drive_constant_velocity, drive_idm

from ..page.manifest import manifest, write_manifest
from ..page.style import save
from ..reproduce.figures import time_space
from ..reproduce.study import PARAMETERS
from .animation import animate
from .nearest import nearest
from .player import Played, write_player

CONSTANT_VELOCITY, EXTENDED, RESIDUAL = "constant_velocity", "extended", "idm_residual"


@dataclass(frozen=True)
class Request:
    """Which vehicle is to be replayed, how.

    Attributes
    ----------
    recording : Path
        For the manifest; what is replayed has been read already.
    vehicle : int
    periods : tuple of str
        Where to look for it; empty for all, of which the first that has it is taken.
    window : Window
    backend : str
        ``"sumo"`` or ``"kernel"``.
    drivers : tuple of Path
        Tables with its parameters, each driven; without one they are fitted to the vehicle itself.
    desired_speed : float, optional
        m/s; by default that of the table, else the road's speed limit.
    seed : int
    model : Path or None
        An extended model of ``diagnose``; its desired speed counts. Without drivers it is fitted to the vehicle too,
        beginning at the plain model's fit.
    """

    recording: Path
    vehicle: int
    periods: tuple[str, ...]
    window: Window
    backend: str
    drivers: tuple[Path, ...]
    desired_speed: float | None
    seed: int
    model: Path | None = None


class Modelled(NamedTuple):
    """One driver of the vehicle.

    Attributes
    ----------
    theta : float64, shape (1, 5)
        ``a, b, T, d0, d1``.
    desired_speed : float
        m/s.
    """

    theta: npt.NDArray[np.float64]
    desired_speed: float


def replay_one(
    recording: Recording, request: Request, out: Path, *, command: list[str], progress: Progress = silent
) -> pd.DataFrame:
    """Drive one vehicle and write what happened to a folder.

    Parameters
    ----------
    recording : Recording
        Cleaned and smoothed.
    request : Request
    out : Path
    command : list of str
        As typed, for the manifest.
    progress : Progress
        Called with a stage's name, what is done of it and its total.

    Returns
    -------
    pandas.DataFrame
        The scores, one row a model.

    Raises
    ------
    InputError
        If the vehicle is not there, is too short a time, or its parameters are unknown.
    """
    model = None if request.model is None else ExtendedModel.read(request.model)
    if model is not None:
        _check_drivers(model, request)
        request = changed(request, desired_speed=model.desired_speed)
    scenes = _scene_of(recording, request)
    for path in request.drivers:
        _check_recording(read_drivers(path), recording, path)
    models = _models(request, scenes)
    driven = {name: _drive(request.backend, scenes, one) for name, one in models.items()}
    for path in request.drivers[:1]:
        driven |= _with_residual(request, path, scenes)
    if model is not None:
        recorded = recording.of_period(scenes.one_period)
        first = next(iter(models.values()))
        theta, model = nearest(scenes, recorded, model, first.theta, refit=not request.drivers)
        models[EXTENDED] = Modelled(theta, first.desired_speed)
        driven[EXTENDED] = _drive(request.backend, scenes, models[EXTENDED], (recorded, model))
    scores = pd.concat([score(scenes, one).assign(model=name) for name, one in driven.items()], ignore_index=True)
    shown = list(driven.values())[-1]
    with new_folder(out) as part:
        trajectory_table(scenes, shown).to_parquet(part / "trajectory.parquet", index=False, write_page_checksum=True)
        scores.to_csv(part / "scores.csv", index=False)
        save(time_space(scenes, 0, driven), part / "time_space.png")
        animate(recording, scenes, shown, part / "replay.gif", progress)
        _write_page(part / "replay.html", recording, scenes, driven, scores)
        named = {name: dict(zip(PARAMETERS, one.theta[0].tolist(), strict=True)) for name, one in models.items()}
        causes = {} if model is None else {"model_file": json.loads(model.to_json())}
        inputs = [request.recording, *request.drivers, *([request.model] if request.model else [])]
        last = list(named)[-1]
        record = manifest(
            command,
            asdict(request),
            inputs,
            parameters=named[last],
            parameters_from="prediction" if request.drivers else "oracle",
            parameters_by_model=named,
            notes=list(recording.notes),
            **causes,
        )
        write_manifest(part / MANIFEST, record)
    columns = [c.PERIOD, c.VEHICLE, "ade_m", "fde_m", "collision", "at_fault", "min_gap_m"]
    return scores[columns if len(driven) == 1 else ["model", *columns]]


def _write_page(
    path: Path, recording: Recording, scenes: Scenes, driven: Mapping[str, Trajectories], scores: pd.DataFrame
) -> None:
    """Write the page that plays the modelled cars, a car at constant velocity with them."""
    played = [Played(name, one) for name, one in driven.items()]
    if CONSTANT_VELOCITY not in driven:
        still = drive_constant_velocity(scenes)
        played.append(Played(CONSTANT_VELOCITY, still, shown=False))
        scores = pd.concat([scores, score(scenes, still).assign(model=CONSTANT_VELOCITY)], ignore_index=True)
    last = scores[scores["model"] == list(driven)[-1]].iloc[0]
    seconds = scenes.window.horizon * c.FRAME_STEP
    table = scores.rename(columns={"model": "method"})[["method", "ade_m", "fde_m", "min_gap_m"]]
    write_player(
        path, recording, scenes, played, table,
        title=f"Vehicle {scenes.vehicle[0]} of period {scenes.one_period}, replayed",
        answer=f"Over {seconds:g} s the modelled car is {last['ade_m']:.2f} m from the recorded one on average, "
        f"and {last['fde_m']:.2f} m at the end.",
        notes=[note for note in recording.notes if "surrogate" in note.lower()],
        footnote="ADE and FDE: mean and final distance between modelled and recorded front bumper.",
    )  # fmt: skip


def _check_drivers(model: ExtendedModel, request: Request) -> None:
    if request.drivers and not model.is_idm:
        raise InputError(
            f"{request.model}: its drivers follow {model.law}, not an IDM, whose parameters {request.drivers[0]} "
            "holds; leave --drivers out, and the vehicle is fitted by that law"
        )


def _scene_of(recording: Recording, request: Request) -> Scenes:
    """Cut the window of the one vehicle."""
    table = recording.table
    holding = [str(p) for p in table.loc[table[c.VEHICLE] == request.vehicle, c.PERIOD].unique()]
    wanted = [p for p in recording.periods if p in holding and (not request.periods or p in request.periods)]
    if not wanted:
        there = f"it is in {', '.join(holding)}" if holding else "no period has it on a main lane"
        raise InputError(
            f"{recording.source}: no vehicle {request.vehicle} in the wanted periods; {there}; "
            f"{_usable(recording, request)}"
        )
    scenes = build_scenes(recording.of_period(wanted[0]), request.window, modelled=[request.vehicle])
    if not len(scenes):
        raise InputError(
            f"{recording.source}: vehicle {request.vehicle} is recorded for fewer than "
            f"{request.window.frames} frames in a "
            f"row; lower --horizon, or choose another: {_usable(recording, request)}"
        )
    return scenes


def _usable(recording: Recording, request: Request) -> str:
    """Say which vehicles can be replayed."""
    parts = []
    for period in request.periods or recording.periods:
        one = recording.of_period(period)
        scenes = build_scenes(one, request.window, modelled=one.table[c.VEHICLE].unique())
        parts.append(f"{ranges(scenes.vehicle)} of {period}")
    return f"vehicles {'; '.join(parts)} can be replayed; `idm-sumo inspect RECORDING --vehicles` lists them all"


def _models(request: Request, scenes: Scenes) -> dict[str, Modelled]:
    """Return the vehicle's parameters by the name of their origin: its own fit, or every driver table's row."""
    if not request.drivers:
        return {"idm_oracle": _fitted(request, scenes)}
    if len(request.drivers) == 1:
        return {"idm_prediction": _looked_up(request, request.drivers[0], scenes)}
    names = [path.stem for path in request.drivers]
    if len({*names, EXTENDED, CONSTANT_VELOCITY}) < len(names) + 2:
        raise InputError(f"--drivers: {', '.join(names)}: tables need different names, and other than {EXTENDED}")
    return {name: _looked_up(request, path, scenes) for name, path in zip(names, request.drivers, strict=True)}


def _fitted(request: Request, scenes: Scenes) -> Modelled:
    fit = calibrate(scenes, desired_speed=request.desired_speed)
    if not np.isfinite(fit[PARAMETERS].to_numpy()).all():
        raise InputError(f"vehicle {request.vehicle}: no fit ({fit['status'].iloc[0]}); give parameters with --drivers")
    return Modelled(fit[PARAMETERS].to_numpy(), float(fit[DESIRED_SPEED].iloc[0]))


def _check_recording(drivers: pd.DataFrame, recording: Recording, path: Path) -> None:
    """Raise if a table's drivers have numbers of this recording, but none begins where it has it."""
    if FIRST_FRAME not in drivers or recording.vehicles is None:
        return
    begins = recording.vehicles[[c.PERIOD, c.VEHICLE, "first_frame", "last_frame"]]
    keys = drivers[[c.PERIOD, c.VEHICLE, FIRST_FRAME]].rename(columns={FIRST_FRAME: "told"})
    shared = begins.assign(**{c.PERIOD: begins[c.PERIOD].astype(str)}).merge(
        keys.assign(**{c.PERIOD: keys[c.PERIOD].astype(str)}), on=[c.PERIOD, c.VEHICLE]
    )
    if len(shared) and not (shared["first_frame"] == shared["told"]).any():
        raise InputError(
            f"{path}: belongs to another recording: no driver begins in the frame in which {recording.source} has it; "
            "calibrate this recording"
        )


def _looked_up(request: Request, path: Path, scenes: Scenes) -> Modelled:
    """Return the row of a driver table; the desired speed asked for comes first, then the table's, then the limit."""
    drivers, wanted = read_drivers(path), request.desired_speed
    own = drivers[(drivers[c.PERIOD].astype(str) == scenes.one_period) & (drivers[c.VEHICLE] == request.vehicle)]
    if own.empty:
        raise InputError(f"{path}: no row for vehicle {request.vehicle} of period {scenes.one_period}")
    if wanted is None and DESIRED_SPEED in own:
        wanted = float(own[DESIRED_SPEED].iloc[0])
    return Modelled(own[PARAMETERS].to_numpy()[:1], float(scenes.road.desired_speed(wanted)))


def _drive(
    backend: str, scenes: Scenes, one: Modelled, extension: tuple[Recording, ExtendedModel] | None = None
) -> Trajectories:
    """Drive it in SUMO or in the kernel."""
    if backend == "kernel":
        if extension is not None:
            return drive_extended(scenes, *extension, one.theta, desired_speed=one.desired_speed)
        return drive_idm(scenes, one.theta, desired_speed=one.desired_speed)
    from idm_sumo.sumo.replay.one_vehicle import replay

    return replay(scenes, one.theta, desired_speed=one.desired_speed, extension=extension)


def _with_residual(request: Request, path: Path, scenes: Scenes) -> dict[str, Trajectories]:
    """Drive the vehicle by its predicted residual, too, if the table has one."""
    drivers = read_drivers(path)
    if MODEL not in drivers:
        return {}
    residual = ResidualDrivers.of_table(drivers, scenes.keys(), str(path))
    residual.check_observed(scenes.window.observed, str(path))
    if request.backend == "kernel":
        return {RESIDUAL: drive_residual(scenes, residual)}
    from idm_sumo.sumo.replay.one_vehicle import replay

    return {RESIDUAL: replay(scenes, residual)}


def trajectory_table(scenes: Scenes, trajectories: Trajectories) -> pd.DataFrame:
    """Return the modelled and the recorded vehicle frame by frame.

    Parameters
    ----------
    scenes : Scenes
    trajectories : Trajectories
        Of the first driver are used.

    Returns
    -------
    pandas.DataFrame
        SI units; columns of the recorded vehicle begin with ``recorded_``.
    """
    steps = trajectories.x.shape[1]
    span = slice(scenes.start, scenes.start + steps)
    values: dict[str, Any] = {
        c.PERIOD: scenes.period[0],
        c.VEHICLE: scenes.vehicle[0],
        c.FRAME: scenes.first_frame[0] + scenes.start + np.arange(steps),
        "time_s": np.arange(steps) * FRAME_STEP,
    }
    for name in (c.X, c.Y, c.HEADING, c.SPEED):
        values[name] = getattr(trajectories, name)[0]
        values[f"recorded_{name}"] = getattr(scenes, name)[0, span]
    values["gap_m"] = trajectories.gap[0]
    for name in ("acceleration", "steering"):
        values[name] = np.append(getattr(trajectories, name)[0], np.nan)
    return pd.DataFrame(values)
