"""Fields that belong to no effect: along which covariates behaviour is free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from tests.helpers.followers import DRIVERS, followers


@pytest.mark.parametrize("periods", [1, 2])
def test_nothing_is_looked_for_along_the_time_of_several_periods(periods):
    windows, theta = followers(ro.PLAIN, np.random.default_rng(5))
    windows = replace(windows, period=np.array(["p", "q"])[np.arange(DRIVERS) % periods])
    grid = rg.grid_of(windows)
    _, state = ro.respond(windows.seen, windows.driver, theta, ro.PLAIN)
    free = {family.covariate for family, _ in ff.families(windows, state, grid)}
    catalogued = {regressor.name for scan in rg._scans(windows, state, grid) for regressor in scan.regressors}
    assert any(name.startswith(ff.TIMED) for name in free) is (periods == 1)
    assert ("time_of_day" in catalogued) is (periods == 1)
    assert "position" in free
    assert "location" in catalogued
