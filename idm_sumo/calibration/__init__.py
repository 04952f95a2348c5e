"""Calibration: one driver's parameters, one set for all of them, and everything between."""

from idm_sumo.calibration.hierarchical import Population, hierarchical
from idm_sumo.calibration.pooled import pooled
from idm_sumo.calibration.table import calibrate

__all__ = ["Population", "calibrate", "hierarchical", "pooled"]
