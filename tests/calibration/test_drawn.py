"""Drivers drawn to their population: nobody at a bound, and what a window says is kept."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate, identifiability
from idm_sumo.calibration.drawn import DRAWN, DRAWN_SHARE, NAMES, as_drawn, drawn_columns
from idm_sumo.runtime.errors import InputError
from tests.helpers.known_drivers import known_drivers


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    scenes, _ = known_drivers(40, noise=0.2, seed=5)
    fits = calibrate(scenes)
    return fits.merge(drawn_columns(scenes, fits["desired_speed_m_s"]), on=["period", "vehicle", "first_frame"])


def test_fewer_drawn_drivers_sit_at_a_bound(table: pd.DataFrame) -> None:
    fitted, drawn = (identifiability.at_bound(table[columns].to_numpy()) for columns in (NAMES, DRAWN))
    assert drawn.any(axis=1).mean() < 0.5 * fitted.any(axis=1).mean()
    assert table[DRAWN_SHARE].between(0.0, 1.0).all()


def test_drawn_drivers_take_the_place_of_the_fitted(table: pd.DataFrame) -> None:
    drawn = as_drawn(table.assign(a_refit=1.0), "drivers")
    assert np.array_equal(drawn[NAMES].to_numpy(), table[DRAWN].to_numpy())
    assert "a_refit" not in drawn  # it stands for the fitted parameters without d1


def test_too_few_drivers_are_no_population() -> None:
    scenes, _ = known_drivers(3, seed=6)
    found = drawn_columns(scenes)
    assert found[DRAWN].isna().all(axis=None)
    with pytest.raises(InputError, match="no driver is drawn"):
        as_drawn(found, "three.parquet")
