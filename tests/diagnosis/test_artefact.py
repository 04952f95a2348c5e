"""A seam is a jump of every vehicle in a moment, not something that all of them do at one place."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import artefact
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import runs
from tests.helpers.followers import recorded

PLACE = 150.0


def recording(x: np.ndarray) -> Recording:
    """Return vehicles that take these paths, shape ``(vehicles, frames)``, measured to 10 cm."""
    return recorded(x + 0.1 * np.random.default_rng(2).standard_normal(x.shape))


def paths(jerk: float = 0.0) -> np.ndarray:
    """Return the paths of vehicles that begin, at one place, to brake ever harder for 3 s, and then no more."""
    start = np.random.default_rng(1).uniform(0.0, 20.0, (120, 1))
    steady = start + 12.0 * 0.1 * np.arange(300)
    since = np.maximum((steady - PLACE) / 12.0, 0.0)
    after = np.maximum(since - 3.0, 0.0)
    return steady - jerk * (since**3 - after**3 - 9.0 * after**2) / 6.0


@pytest.mark.parametrize("shift", [0.3, -0.8])
def test_a_seam_is_found_where_it_is(shift):
    x = paths()
    seam = artefact.find_seam(recording(x + shift * (x > PLACE)))
    assert seam is not None
    assert seam.position == pytest.approx(PLACE, abs=2.0)
    assert seam.shift == pytest.approx(shift, rel=0.15)
    moved = artefact.repaired(recording(x + shift * (x > PLACE)), seam)
    beyond = x > PLACE + 3.0
    assert abs((moved.table[c.X].to_numpy().reshape(x.shape) - x)[beyond].mean()) < 0.15 * abs(shift)


def test_what_all_drivers_do_at_one_place_is_none():
    given = recording(paths(jerk=1.5))
    x = given.table[c.X].to_numpy(np.float64)
    place = np.floor((x - x.min()) / artefact.BIN).astype(np.int64)
    long = artefact._steps(x, place, *runs(given.table), artefact.FRAMES)
    assert (np.abs(long.mean) > artefact.LEAST)[long.passed > artefact.FEWEST].any()
    assert artefact.find_seam(given) is None
    assert artefact.find_seam(recording(paths())) is None


def test_a_step_has_its_size_in_a_short_look_as_in_a_long_one():
    x = paths()
    given = recording(x + 0.4 * (x > PLACE)).table[c.X].to_numpy(np.float64)
    place = np.floor((given - given.min()) / artefact.BIN).astype(np.int64)
    ends = runs(recording(x).table)
    for frames in (artefact.FRAMES, artefact.FEW):
        unit = artefact._steps((given > PLACE).astype(float), place, *ends, frames)
        seen = artefact._steps(given, place, *ends, frames)
        assert artefact._size(seen, unit) == pytest.approx(0.4, rel=0.15)
        assert artefact._size(unit, unit) == pytest.approx(1.0)
