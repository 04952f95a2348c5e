"""What ``export`` writes drives by itself as in our loop."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from idm_sumo.roads.us101 import US101
from idm_sumo.sumo import network
from idm_sumo.sumo.closed_loop import run as closed_loop
from idm_sumo.sumo.export.routes import Exported, export_routes
from tests.helpers.exports import drivers, sumo

COLUMNS = ["timestep_time", "vehicle_id", "vehicle_x", "vehicle_y", "vehicle_speed"]
DURATION = 1000.0  # s, two periods


@pytest.mark.parametrize("crowded", [False, True], ids=["free", "crowded"])
def test_entries_speeds_and_travel_times_are_those_of_the_loop(tmp_path: Path, crowded: bool) -> None:
    table = drivers()
    if crowded:  # all of a period within two seconds, in one lane
        first = table.groupby("period")["depart_s"].transform("min")
        table = table.assign(depart_s=first + 0.1 * table.groupby("period").cumcount(), lane=3, x_m=5.0)
    exported = export_routes(table, tmp_path / "drivers.rou.xml")
    plain, end = tmp_path / "plain.parquet", ("--end", str(DURATION))
    assert sumo(exported.config_file, "--seed", "5", "--fcd-output", str(plain), *closed_loop.FCD, *end).returncode == 0
    outcome = closed_loop.run(_files(exported), tmp_path / "loop.parquet", seed=5)
    assert outcome.late.empty != crowded
    alone, ours = (pd.read_parquet(path)[COLUMNS].sort_values(COLUMNS[:2]) for path in (plain, outcome.fcd))
    alone = alone[alone["timestep_time"] <= ours["timestep_time"].max()]
    pd.testing.assert_frame_equal(alone.reset_index(drop=True), ours.reset_index(drop=True))
    entered = ours.groupby("vehicle_id")["timestep_time"].min()
    planned = exported.vehicles.set_index("id")["depart_s"]
    assert set(entered.index) == set(planned.index)
    assert ((entered - planned) >= -0.1).all()


def _files(exported: Exported) -> closed_loop.RunFiles:
    demand = exported.vehicles[["id", "depart_s"]].rename(columns={"id": "vehicle"})
    return closed_loop.RunFiles(
        exported.net_file, exported.route_file, exported.config_file, None, DURATION, demand, (), network.of(US101)
    )
