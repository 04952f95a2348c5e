"""IDM parameters of a driver that was observed for a second."""

from idm_sumo.prediction.neighbours import KNNPredictor, average_parameters, first_gap_parameters, predict_drivers

__all__ = ["KNNPredictor", "average_parameters", "first_gap_parameters", "predict_drivers"]
