from pathlib import Path

import numpy as np
import pandas as pd

from idm_sumo.calibration import calibrate
from idm_sumo.calibration.driver_table import road_of_drivers, write_drivers
from idm_sumo.calibration.whole import fit_whole_drivers
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.reading import read_recording
from idm_sumo.recordings.smoothing import smooth
from idm_sumo.roads import US101
from idm_sumo.roads.straight import straight_road
from idm_sumo.scenes.windows import Window, build_scenes
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
