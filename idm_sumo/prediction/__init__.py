"""Drivers predicted from what was observed of them."""

from idm_sumo.prediction.neighbours import KNNPredictor, average_parameters, first_gap_parameters, predict_drivers
from idm_sumo.prediction.observation import first_second
from idm_sumo.prediction.recent import recent
from idm_sumo.prediction.residual_drive import ResidualDrivers, drive_residual
from idm_sumo.prediction.residual_predictor import ResidualPredictor
from idm_sumo.prediction.result import Prediction
from idm_sumo.prediction.rollout_predictor import RolloutPredictor

__all__ = [
    "KNNPredictor", "Prediction", "ResidualDrivers", "ResidualPredictor", "RolloutPredictor", "average_parameters",
    "drive_residual", "first_gap_parameters", "first_second", "predict_drivers", "recent",
]  # fmt: skip
