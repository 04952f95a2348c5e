"""What a comparison says of recordings that hold unequal periods."""

from __future__ import annotations

import pandas as pd
import pytest

from analysis.comparison.run import findings
from idm_sumo.evaluation.comparison import Comparison, compare
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from tests.helpers.builders import Car, rows_of


def traffic(**speeds: float) -> Recording:
    """Return a few cars through the section in each period, at one speed."""
    rows = [
        rows_of(Car(n, 0.5, 2 + n % 2, speed, first_frame=40 * n, frames=int(600 / speed * 10)), period)
        for period, speed in speeds.items()
        for n in range(1, 9)
    ]
    return Recording.from_table(pd.concat(rows, ignore_index=True), road=US101, source="inline")


@pytest.fixture(scope="module")
def compared() -> Comparison:
    return compare({"both": traffic(a=10.0, b=20.0), "first": traffic(a=11.0)}, seed=1)


def test_recordings_are_compared_in_the_period_that_both_hold(compared: Comparison) -> None:
    assert "first: mean speed 11.0 against 10.0 m/s" in findings(compared)
