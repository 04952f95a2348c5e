"""Drivers fitted to all of their windows: nearer over them than any single window's fit."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.calibration import calibrate, integrators
from idm_sumo.calibration.driver_table import road_of_drivers, write_drivers
from idm_sumo.calibration.problem import prepare
from idm_sumo.calibration.whole import OTHER_LAWS, WHOLE, as_whole, fit_whole_drivers, names_for, whole_columns
from idm_sumo.calibration.without_d1 import REFIT, linearise, refit_table
from idm_sumo.models.idm import LOWER
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads import US101
from idm_sumo.roads.straight import straight_road
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.driver_parameters import PARAMETERS
from tests.helpers.platoons import platoon_recording


def test_a_driver_of_several_windows_has_one_row_and_the_smallest_mean_error(tmp_path: Path) -> None:
    platoon_recording(periods=1, platoons=2, cars=4).to_parquet(tmp_path / "platoons.parquet")
    recording = smooth(clean(read_recording(tmp_path / "platoons.parquet")))
    scenes = build_scenes(recording, Window(observed=10, horizon=40, every=40))
    fits = calibrate(scenes)
    whole = fit_whole_drivers(fits, scenes)
    assert len(whole) == len(fits.drop_duplicates(["period", "vehicle"])) < len(fits)
    several = whole["windows"] > 1
    assert several.any()
    single = fits.groupby("vehicle")["ade_m"].mean()
    # One set for all windows cannot be better than each window's own.
    assert (whole.loc[several, "ade_m"] >= whole.loc[several, "vehicle"].map(single) - 1e-6).all()
    assert np.isfinite(whole.loc[several, ["a", "b", "T", "d0", "d1"]].to_numpy()).all()


def test_a_driver_table_keeps_its_road(tmp_path: Path) -> None:
    road = straight_road("test", (3.5, 3.0), length=500.0, speed_limit=30.0)
    table = pd.DataFrame({"period": ["p"], "vehicle": [1], "a": [1.0]})
    write_drivers(table, tmp_path / "own.parquet", road)
    write_drivers(table, tmp_path / "default.parquet", US101)
    assert road_of_drivers(tmp_path / "own.parquet") == road
    assert road_of_drivers(tmp_path / "default.parquet") == US101


def test_types_of_all_windows_have_the_smallest_mean_error_over_them(tmp_path: Path) -> None:
    platoon_recording(periods=1, platoons=2, cars=4).to_parquet(tmp_path / "platoons.parquet")
    recording = smooth(clean(read_recording(tmp_path / "platoons.parquet")))
    windows = build_scenes(recording, Window(observed=10, horizon=40, every=40))
    first = windows.subset(~windows.keys().duplicated(["period", "vehicle"]).to_numpy())
    fits = calibrate(first)
    whole = whole_columns(fits, windows)
    several = (whole["windows"] > 1).to_numpy()
    assert several.any()
    others = [linearise(fits[list(PARAMETERS)], fits["mean_speed_m_s"], fits["desired_speed_m_s"])]
    others.append(refit_table(fits, first)[list(REFIT)].assign(d1=0.0).to_numpy())
    for other in others:
        errors = _mean_errors(windows, fits, np.nan_to_num(other, nan=1.0))
        assert (whole["whole_ade_m"].to_numpy()[several] <= errors[several] + 1e-6).all()
    np.testing.assert_allclose(
        _mean_errors(windows, fits, whole[list(WHOLE)].assign(d1=0.0).fillna(1.0).to_numpy())[several],
        whole["whole_ade_m"].to_numpy()[several],
    )


@pytest.mark.parametrize("law", OTHER_LAWS)
def test_types_by_a_law_have_a_smaller_error_than_the_idm_s_parameters_driven_by_it(tmp_path: Path, law: str) -> None:
    platoon_recording(periods=1, platoons=2, cars=4).to_parquet(tmp_path / "platoons.parquet")
    windows = build_scenes(smooth(clean(read_recording(tmp_path / "platoons.parquet"))), Window(10, 40, every=40))
    fits = calibrate(windows.subset(~windows.keys().duplicated(["period", "vehicle"]).to_numpy()))
    idm, other = (whole_columns(fits, windows, law=one) for one in ("idm", law))
    several, names = (other["windows"] > 1).to_numpy(), list(names_for(law))
    assert several.any()
    pd.testing.assert_series_equal(idm["windows"], other["windows"])
    by_law = other[names[:4]].assign(d1=0.0).fillna(1.0).to_numpy()
    translated = idm[list(WHOLE)].assign(d1=0.0).fillna(1.0).to_numpy()
    errors = [_mean_errors(windows, fits, theta, law)[several] for theta in (by_law, translated)]
    np.testing.assert_allclose(errors[0], other[names[4]].to_numpy()[several])
    assert (errors[0] <= errors[1] + 1e-6).all()
    assert errors[0].mean() < errors[1].mean()


def _mean_errors(windows: Scenes, fits: pd.DataFrame, theta: np.ndarray, scheme: str = "euler") -> np.ndarray:
    """Return each driver's mean ADE (m) over its windows that can be fitted, as SUMO integrates."""
    row = pd.Index(fits["vehicle"]).get_indexer(pd.Index(windows.vehicle))
    ade = integrators.ades(prepare(windows), theta[row], scheme)
    return pd.Series(np.where(calibrate(windows)["status"] == "ok", ade, np.nan)).groupby(row).mean().to_numpy()


def test_types_of_all_windows_stand_for_the_refit_and_their_own_bounds() -> None:
    drivers = pd.DataFrame({
        "period": "p", "vehicle": [1, 2], "a": 1.0, "b": 2.0, "T": 1.0, "d0": 2.0, "d1": 0.0, "at_bound": "a",
        "desired_speed_m_s": 30.0, "mean_speed_m_s": 10.0, "a_whole": [1.5, np.nan], "b_whole": [LOWER.b, np.nan],
        "T_whole": [1.2, np.nan], "d0_whole": [3.0, np.nan],
    })  # fmt: skip
    shown = as_whole(drivers)
    assert shown[list(REFIT)].to_numpy().tolist() == [[1.5, LOWER.b, 1.2, 3.0], [1.0, 2.0, 1.0, 2.0]]
    assert shown["at_bound"].tolist() == ["b", "a"]
