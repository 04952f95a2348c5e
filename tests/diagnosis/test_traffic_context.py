"""What a driver has before and behind it."""

from __future__ import annotations

import numpy as np

from idm_sumo.diagnosis.traffic_context import look_around
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.reading import read_recording
from tests.simulators import first as planting


def test_the_follower_is_known_by_its_class(tmp_path):
    written = planting.write(
        planting.simulate(planting.plan(3, effect=None, drivers=60, minutes=1.0, trucks=0.5)), tmp_path / "r.parquet"
    )
    table = (recording := read_recording(written)).table
    ahead = look_around(recording)
    last = table[c.X].to_numpy() == table.groupby([c.FRAME, c.LANE])[c.X].transform("min").to_numpy()
    assert (ahead.follower_kind[last] == 0.0).all()
    assert set(ahead.follower_kind[~last]) == {1.0, 2.0, 3.0} & set(table[c.CLASS])
    np.testing.assert_array_equal(ahead.follower_kind == 0.0, ahead.follower_front == -np.inf)
