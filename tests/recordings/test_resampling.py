import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.accounting import Ledger
from idm_sumo.recordings.resampling import BETWEEN, MADE, resample
from idm_sumo.runtime.errors import InputError


def tracks(time: np.ndarray, x: np.ndarray, **more: np.ndarray) -> pd.DataFrame:
    period = pd.Categorical(np.full(len(time), "p"))
    return pd.DataFrame({c.PERIOD: period, c.VEHICLE: 1, c.TIME: time, c.X: x, **more})


@given(st.sampled_from([0.02, 0.04, 0.05, 0.2, 0.25, 0.5, 1.0]), st.floats(0.0, 1e9))
def test_a_cubic_way_comes_back_whatever_the_step(step: float, start: float) -> None:
    time = np.arange(0.0, 20.0 + step / 2, step)
    x = 30.0 * time + 0.3 * time**2 - 0.01 * time**3
    ledger = Ledger(len(time))
    out = resample(tracks(start + time, x), ledger, "test")
    at = out[c.FRAME].to_numpy() * 0.1
    np.testing.assert_array_equal(out[c.FRAME], np.arange(201))
    np.testing.assert_allclose(out[c.X], 30.0 * at + 0.3 * at**2 - 0.01 * at**3, atol=1e-4)
    ledger.close(len(out), vehicles=1)


def test_rows_on_frames_are_taken_as_they_are() -> None:
    time = np.arange(0, 5, 0.05)
    x = np.random.default_rng(1).normal(size=len(time))
    ledger = Ledger(len(time))
    out = resample(tracks(time, x), ledger, "test")
    np.testing.assert_array_equal(out[c.X], x[::2])
    assert ledger.dropped == {BETWEEN: 50}


def test_the_error_at_one_second_is_centimetres() -> None:
    time = np.arange(0.0, 60.0)
    way = lambda t: 20.0 * t + 8.0 * np.cos(0.4 * t)  # noqa: E731 - accelerations up to 1.3 m/s²
    out = resample(tracks(time, way(time)), ledger := Ledger(60), "test")
    error = np.abs(out[c.X] - way(out[c.FRAME] * 0.1))
    assert error.max() < 0.02
    assert ledger.added == {MADE: len(out) - 60}


def test_nobody_drives_backwards_where_a_vehicle_stops() -> None:
    time = np.arange(0.0, 20.0)
    x = np.minimum(10.0 * time - 0.5 * time**2, 50.0) * (time <= 10) + 50.0 * (time > 10)
    out = resample(tracks(time, x), Ledger(20), "test")
    assert (np.diff(out[c.X]) >= 0).all()


def test_a_gap_ends_a_run() -> None:
    time = np.concatenate([np.arange(0, 5, 0.5), np.arange(20, 25, 0.5)])
    out = resample(tracks(time, 10 * time), Ledger(len(time)), "test")
    assert not out[c.FRAME].between(46, 199).any()


@pytest.mark.parametrize("step", [2.0, 100.0, 0.001])
def test_other_steps_are_refused(step: float) -> None:
    time = np.arange(10) * step
    with pytest.raises(InputError, match="apart"):
        resample(tracks(time, time), Ledger(10), "test")
