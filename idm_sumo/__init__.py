"""Recorded traffic replayed in SUMO, one vehicle at a time driven by a model.

The names below are imported when they are first used, so that ``import idm_sumo`` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from idm_sumo.runtime.environment import find_places_for_caches

if TYPE_CHECKING:
    from idm_sumo.calibration.table import calibrate as calibrate
    from idm_sumo.diagnosis.diagnose import diagnose as diagnose
    from idm_sumo.evaluation.figures import plot_time_space as plot_time_space
    from idm_sumo.evaluation.metrics import score as score
    from idm_sumo.models.effects.extended_model import ExtendedModel as ExtendedModel
    from idm_sumo.models.idm import IDMParameters as IDMParameters
    from idm_sumo.prediction.neighbours import KNNPredictor as KNNPredictor
    from idm_sumo.prediction.residual_drive import drive_residual as drive_residual
    from idm_sumo.prediction.residual_predictor import ResidualPredictor as ResidualPredictor
    from idm_sumo.prediction.rollout_predictor import RolloutPredictor as RolloutPredictor
    from idm_sumo.recordings.cleaning import clean as clean
    from idm_sumo.recordings.reading import read_recording as read_recording
    from idm_sumo.recordings.recording import Recording as Recording
    from idm_sumo.recordings.smoothing import smooth as smooth
    from idm_sumo.roads.road import Road as Road
    from idm_sumo.runtime.errors import InputError as InputError
    from idm_sumo.scenes.windows import Scenes as Scenes
    from idm_sumo.scenes.windows import Window as Window
    from idm_sumo.scenes.windows import build_scenes as build_scenes
    from idm_sumo.simulation.rollout import drive_idm as drive_idm
    from idm_sumo.sumo.export.routes import export_routes as export_routes
    from idm_sumo.sumo.replay.one_vehicle import replay as replay
    from idm_sumo.sumo.surrogate.builtin import surrogate as surrogate

__version__ = "0.2.0"

# Public name: the module it lives in. No name is that of a room or module of this package.
_HOMES = {
    "ExtendedModel": "models.effects.extended_model",
    "IDMParameters": "models.idm",
    "InputError": "runtime.errors",
    "KNNPredictor": "prediction.neighbours",
    "Recording": "recordings.recording",
    "ResidualPredictor": "prediction.residual_predictor",
    "Road": "roads.road",
    "RolloutPredictor": "prediction.rollout_predictor",
    "Scenes": "scenes.windows",
    "Window": "scenes.windows",
    "build_scenes": "scenes.windows",
    "calibrate": "calibration.table",
    "clean": "recordings.cleaning",
    "diagnose": "diagnosis.diagnose",
    "drive_idm": "simulation.rollout",
    "drive_residual": "prediction.residual_drive",
    "export_routes": "sumo.export.routes",
    "plot_time_space": "evaluation.figures",
    "read_recording": "recordings.reading",
    "replay": "sumo.replay.one_vehicle",
    "score": "evaluation.metrics",
    "smooth": "recordings.smoothing",
    "surrogate": "sumo.surrogate.builtin",
}

__all__ = [*sorted(_HOMES), "__version__"]


def __getattr__(name: str) -> Any:
    """Import a public name from where it lives, once."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names."""
    return list(__all__)


find_places_for_caches(Path(__file__).parent)  # before any compiled kernel is loaded
