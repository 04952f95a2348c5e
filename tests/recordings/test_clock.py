import numpy as np
import pytest

from idm_sumo.recordings.accounting import Ledger
from idm_sumo.recordings.readers.ngsim import to_recording
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers import ngsim_files


def read(**changed: object) -> Recording:
    raw = ngsim_files.table().assign(**changed)
    return to_recording(
        raw.astype(dict.fromkeys(raw.select_dtypes("number"), float)), Ledger(len(raw)), road=US101, source="x"
    )[0]


def test_a_clock_in_seconds_gives_the_same_times() -> None:
    raw = ngsim_files.table()
    recording = read(Global_Time=raw["Global_Time"] / 1000)
    np.testing.assert_allclose(recording.table["time"], read().table["time"])
    assert "Global_Time is in seconds; it is converted to ms" in recording.notes


def test_a_clock_that_stands_is_replaced_by_the_frames() -> None:
    recording = read(Global_Time=1.11885e12)
    assert recording.table["frame"].equals(read().table["frame"])
    assert any("stands still over 100% of the frames" in note for note in recording.notes)


def test_jitter_is_measured_and_taken_out() -> None:
    raw = ngsim_files.table()
    shift = np.random.default_rng(1).uniform(-30, 30, len(raw))
    recording = read(Global_Time=raw["Global_Time"] + shift)
    steps = recording.table.groupby("vehicle")["time"].diff().dropna()
    np.testing.assert_allclose(steps, 0.1, atol=1e-6)
    assert any("Global_Time jitters by" in note for note in recording.notes)


def test_another_frame_rate_is_refused() -> None:
    raw = ngsim_files.table()
    with pytest.raises(InputError, match=r"advances by 200 a frame where 100 ms are needed"):
        read(Global_Time=2.0 * raw["Global_Time"])
    with pytest.raises(InputError, match=r"frames of a vehicle are 2 apart .0.2 s."):
        read(Frame_ID=2 * raw["Frame_ID"])
