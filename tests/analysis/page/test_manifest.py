"""How a run is told, so that it can be repeated."""

from __future__ import annotations

import pytest

from analysis.page.manifest import repeated


@pytest.mark.parametrize("jobs", [[], ["--jobs", "2"], ["--jobs=2"], ["--jo", "2"], ["--cluster", "tcp://h:1"]])
def test_who_computes_does_not_show_in_the_line_that_repeats(jobs: list[str]) -> None:
    line = repeated(["/usr/bin/idm-sumo", "diagnose", "a file.csv", *jobs, "--seed", "3", "-o", "out"])
    assert line == "idm-sumo diagnose 'a file.csv' --seed 3 -o out"
