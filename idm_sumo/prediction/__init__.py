"""IDM parameters of drivers observed for a second."""

from idm_sumo.prediction.moving_horizon import MovingHorizon, recent
from idm_sumo.prediction.neighbours import KNNPredictor, average_parameters, first_gap_parameters, predict_drivers
from idm_sumo.prediction.observation import first_second
from idm_sumo.prediction.result import Prediction
from idm_sumo.prediction.rollout_predictor import RolloutPredictor

__all__ = [
    "KNNPredictor", "MovingHorizon", "Prediction", "RolloutPredictor", "average_parameters", "first_gap_parameters",
    "first_second", "predict_drivers", "recent",
]  # fmt: skip
