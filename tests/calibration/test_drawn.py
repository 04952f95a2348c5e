"""Drivers drawn to their population: nobody at a bound, and what a window says is kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate, identifiability
from idm_sumo.calibration.drawn import DRAWN, DRAWN_SHARE, NAMES, as_drawn, drawn_columns
from idm_sumo.calibration.hierarchical import hierarchical
from idm_sumo.runtime.errors import InputError
from tests.helpers.known_drivers import known_drivers


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    scenes, _ = known_drivers(40, noise=0.2, seed=5)
    fits = calibrate(scenes)
    return fits.merge(drawn_columns(scenes, fits["desired_speed_m_s"]), on=["period", "vehicle", "first_frame"])


def test_no_drawn_driver_sits_at_a_bound(table: pd.DataFrame) -> None:
    fitted, drawn = (identifiability.at_bound(table[columns].to_numpy()) for columns in (NAMES, DRAWN))
    assert fitted.any(axis=1).mean() > 0.2
    drawn[:, 4] &= table["d1_drawn"] > 1.0  # none is no bound
    assert not drawn.any()
    assert (as_drawn(table, "drivers")["at_bound"] == "").all()
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


def test_windows_of_a_driver_have_one_set_and_drivers_differ_less_than_windows() -> None:
    scenes, _ = known_drivers(60, noise=0.2, seed=8)
    named = replace(scenes, vehicle=scenes.vehicle // 3, first_frame=scenes.first_frame + np.arange(len(scenes)))
    apart, together = (hierarchical(named, by_driver=one) for one in (False, True))
    sets = together[0].groupby("vehicle")[list(NAMES)].nunique()
    assert (sets == 1).all(axis=None)
    assert together[1].drivers < apart[1].drivers
    assert np.trace(together[1].covariance) < np.trace(apart[1].covariance)


def test_one_window_a_driver_is_the_same_by_driver() -> None:
    scenes, _ = known_drivers(20, noise=0.2, seed=9)
    one, other = (hierarchical(scenes, by_driver=by)[0] for by in (False, True))
    pd.testing.assert_frame_equal(one, other)
