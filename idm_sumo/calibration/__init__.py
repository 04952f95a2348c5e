"""Calibration of drivers, one by one, together and in between."""

from idm_sumo.calibration.hierarchical import hierarchical
from idm_sumo.calibration.pooled import pooled
from idm_sumo.calibration.population import Population
from idm_sumo.calibration.table import calibrate

__all__ = ["Population", "calibrate", "hierarchical", "pooled"]
