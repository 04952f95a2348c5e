import json
from pathlib import Path

import pandas as pd
import pytest

from idm_sumo.recordings.inspection import inspect_recording
from idm_sumo.roads.units import FOOT
from tests.helpers import ngsim_files


def written(tmp_path: Path) -> Path:
    raw = ngsim_files.table(vehicles=4, frames=40)
    raw.loc[(raw["Vehicle_ID"] == 4) & (raw["Frame_ID"] > 40), "Lane_ID"] = 7  # 12 rows
    raw.loc[raw["Vehicle_ID"] == 3, "Preceding"] = 1
    holed = raw.drop(index=20)  # of vehicle 1
    return ngsim_files.official(tmp_path / "a.txt", pd.concat([holed, raw.iloc[[90]]]))


def test_read_is_used_and_dropped_over_all_stages(tmp_path: Path) -> None:
    plain = inspect_recording(written(tmp_path)).to_json()
    assert plain["read"] == 160
    assert plain["dropped"] == {"exact duplicate row": 1, "auxiliary lane or ramp": 12, "frame irregularity": 39}
    assert plain["used"] == 160 - 1 - 12 - 39
    assert plain["vehicles_read"] == 4
    assert plain["vehicles_dropped"] == {"frame irregularity": 1, "wrong leader": 1}
    assert plain["vehicles_used"] == 2


def test_it_says_what_is_there(tmp_path: Path) -> None:
    found = inspect_recording(written(tmp_path))
    assert found.lanes == {"2": 147, "7": 12}
    assert found.classes == {"car": 4}
    (period,) = found.periods
    assert (period.period, period.vehicles, period.rows) == ("0750-0805", 4, 159)
    assert period.end - period.start == pytest.approx(3.9)
    assert period.mean_speed == pytest.approx(40 * FOOT)
    assert found.known_leaders == 1.0


def test_json_is_json_and_the_lines_say_the_same(tmp_path: Path) -> None:
    found = inspect_recording(written(tmp_path))
    assert json.loads(json.dumps(found.to_json()))["read"] == 160
    text = "\n".join(found.lines())
    for word in ("160", "frame irregularity", "wrong leader", "0750-0805", "12.19", "car: 4"):
        assert word in text


@pytest.mark.parametrize("name", ["us101_raw_subset.parquet", "us101_scenes_smoothed.parquet"])
def test_real_recordings_lose_no_row_silently(shared_data: Path, name: str) -> None:
    found = inspect_recording(shared_data / name)
    assert found.rows.total == found.rows.used + sum(found.rows.dropped.values())
    assert found.rows.vehicles + sum(found.rows.vehicles_dropped.values()) == found.vehicles_read
    assert found.rows.used > 0.95 * found.rows.total
