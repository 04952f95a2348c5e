"""The network against the recorded section and its sources."""

import itertools
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import libsumo
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.roads.units import FOOT
from idm_sumo.roads.us101 import OFF_RAMP, ON_RAMP, US101
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo import network

NETWORK_FOLDER = Path(__file__).parents[2] / "network"
END = US101.length

# Observed lane centres of US-101 (ft right of the left edge) and where (m) they are tested:
# main lanes along the whole section, the others where this network has them.
OBSERVED_CENTRES = [
    (1, 7.0, 0, END),
    (2, 18.8, 0, END),
    (3, 30.2, 0, END),
    (4, 40.6, 0, END),
    (5, 52.8, 0, END),
    (6, 63.0, ON_RAMP, OFF_RAMP),
    (7, 66.0, 152, ON_RAMP - 0.01),  # the ramps are recorded from 500 ft and to 1,424 ft
    (8, 66.8, OFF_RAMP, 434),
]
NETWORK = network.of(US101)


@pytest.fixture(params=[[], ["--lateral-resolution", "3.66"]], ids=["lanes", "sublanes"])
def sumo(request):
    """Run a simulation in which vehicles stand still."""
    options = ["--step-length", "0.1", "--no-step-log", "--no-warnings", "--xml-validation", "never"]
    collisions = ["--collision.action", "warn", "--collision.mingap-factor", "0"]
    libsumo.start(["sumo", "-n", str(NETWORK.file), *options, *collisions, *request.param])
    for origin, destination in itertools.product(NETWORK.origins, NETWORK.destinations):
        libsumo.route.add(f"{origin} {destination}", NETWORK.route(origin, destination))
    yield libsumo
    libsumo.close()


def add(sumo, name, origin="upstream", destination="outflow"):
    sumo.vehicle.add(name, f"{origin} {destination}", departPos="base", departSpeed="0")
    sumo.vehicle.setLaneChangeMode(name, 0)
    sumo.vehicle.setSpeedMode(name, 0)


def put(sumo, name, x, y):
    sumo.vehicle.moveToXY(name, "", -1, float(x), float(y), 90, 3)


@pytest.mark.parametrize(("lane", "centre_ft", "begin", "end"), OBSERVED_CENTRES)
def test_recorded_lane_centres_fall_in_the_right_sumo_lane(sumo, lane, centre_ft, begin, end):
    origin = "on_ramp" if lane == 7 else "upstream"
    add(sumo, "car", origin, "off_ramp" if lane == 8 else "outflow")
    for x in np.linspace(begin, end - 0.01, 60):
        put(sumo, "car", x, -centre_ft * FOOT)
        sumo.simulationStep()
        edge, index = sumo.vehicle.getRoadID("car"), sumo.vehicle.getLaneIndex("car")
        assert NETWORK.recorded_lane(edge, index) == lane, f"at x = {x:.1f} m"
        assert abs(sumo.vehicle.getLateralLanePosition("car")) < US101.widths[0] / 2


def test_sumo_coordinates_are_the_recorded_ones(sumo):
    for lane, x in itertools.product(range(1, 9), np.linspace(100, 540, 23)):
        where = NETWORK.place(x, lane)
        at = sumo.simulation.convert2D(str(where.edge), float(where.position), int(where.lane_index))
        expected = (x, US101.lane_center(min(lane, 6)))
        np.testing.assert_allclose(at, expected, atol=1e-6)


def gap_cases():
    """Return pairs of cars on edges and across junctions."""
    main = [("upstream", "outflow", lane) for lane in range(1, 6)]
    pairs = [
        (60.0, 95.3),
        (150.0, 200.7),
        (176.0, 181.5),
        (300.0, 321.0),
        (380.0, 399.9),
        (500.0, 530.0),
        (600.0, 690.0),
    ]
    cases = [(*way, *pair) for way in main for pair in pairs]
    cases += [("on_ramp", "outflow", 6, 90.0, 110.0), ("on_ramp", "outflow", 6, 150.0, 200.7)]
    cases += [("upstream", "off_ramp", 6, 250.0, 271.5), ("upstream", "off_ramp", 6, 377.0, 401.1)]
    cases += [("on_ramp", "off_ramp", 6, 120.0, 500.0), ("upstream", "off_ramp", 6, 450.0, 460.0)]
    return cases


def test_gaps_along_sumo_lanes_are_recorded_gaps(sumo):
    """``getLeader`` subtracts the own ``minGap`` from the gap."""
    for origin, destination, lane, behind, ahead in gap_cases():
        y = float(US101.lane_center(lane))
        for name, x in (("follower", behind), ("leader", ahead)):
            add(sumo, name, origin, destination)
            put(sumo, name, x, y)
        sumo.simulationStep()
        leader, gap = sumo.vehicle.getLeader("follower", 600)
        assert leader == "leader"
        recorded = ahead - behind - sumo.vehicle.getLength("leader")
        assert gap + sumo.vehicle.getMinGap("follower") == pytest.approx(recorded, abs=1e-3), (lane, behind, ahead)
        for name in ("follower", "leader"):
            sumo.vehicle.remove(name)
        sumo.simulationStep()


def test_distances_stay_exact_while_cars_cross_every_junction(sumo):
    """A platoon in every lane moves through the section.

    It varies its lateral position.
    """
    rng = np.random.default_rng(1)
    lanes = [(lane, "upstream", "outflow") for lane in range(1, 6)] + [(6, "on_ramp", "off_ramp")]
    for lane, origin, destination in lanes:
        for number in range(3):
            add(sumo, f"{lane}.{number}", origin, destination)
    for start in np.arange(45.0, 480.0, 1.7):
        x = start + np.array([0.0, 17.123, 55.456])
        for lane, *_ in lanes:
            for number in range(3):
                put(sumo, f"{lane}.{number}", x[number], US101.lane_center(lane) + rng.uniform(-0.8, 0.8))
        sumo.simulationStep()
        for (lane, *_), number in itertools.product(lanes, range(2)):
            name = f"{lane}.{number}"
            leader, gap = sumo.vehicle.getLeader(name, 100)
            assert leader == f"{lane}.{number + 1}"
            recorded = x[number + 1] - x[number] - sumo.vehicle.getLength(leader)
            assert gap + sumo.vehicle.getMinGap(name) == pytest.approx(recorded, abs=1e-3)


@given(x=st.floats(-250, 600), lane=st.integers(1, 8))
def test_place_and_coordinates_are_inverse(x, lane):
    where = NETWORK.place([x], [lane])
    back_x, back_y, back_lane = NETWORK.coordinates(where)
    assert back_x[0] == pytest.approx(x, abs=1e-6)
    if lane < 6:
        assert (back_lane[0], back_y[0]) == (lane, pytest.approx(float(US101.lane_center(lane))))
    else:
        assert back_lane[0] == (7 if x < ON_RAMP else 6 if x < OFF_RAMP else 8)


def test_place_outside_the_network_is_named():
    with pytest.raises(InputError, match=r"x = 2100 m, lane 3 is outside"):
        NETWORK.place([10.0, 2100.0], [2, 3])


def test_route_to_nowhere_is_named():
    with pytest.raises(InputError, match="no way from 'outflow' to 'upstream'"):
        NETWORK.route("outflow", "upstream")
    with pytest.raises(InputError, match="no edge 'Ventura'"):
        NETWORK.route("Ventura", "off_ramp")


def test_there_is_room_before_and_behind_the_section():
    assert NETWORK.load().getEdge("upstream").getShape()[0][0] <= -250
    assert NETWORK.load().getEdge("outflow").getShape()[-1][0] >= END + 500


def build(*arguments):
    command = [sys.executable, str(NETWORK_FOLDER / "build.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_committed_network_is_what_its_sources_give(tmp_path):
    pytest.importorskip("sumo", reason="netconvert comes with eclipse-sumo")
    assert build("-o", tmp_path / "again.net.xml").returncode == 0
    assert (tmp_path / "again.net.xml").read_text() == (NETWORK_FOLDER / "us101.net.xml").read_text()


def test_speed_limit_is_an_option(tmp_path):
    pytest.importorskip("sumo", reason="netconvert comes with eclipse-sumo")
    from sumolib.net import readNet

    assert build("--speed-limit-mph", 65, "-o", tmp_path / "fast.net.xml").returncode == 0
    fast, usual = readNet(str(tmp_path / "fast.net.xml")), NETWORK.load()
    np.testing.assert_allclose([edge.getSpeed() for edge in fast.getEdges()], 65 * 0.44704, atol=1e-3)
    np.testing.assert_allclose([edge.getSpeed() for edge in usual.getEdges()], US101.speed_limit, atol=1e-4)
    assert [edge.getLength() for edge in fast.getEdges()] == [edge.getLength() for edge in usual.getEdges()]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--speed-limit-mph", "-5"], "give a speed limit between"),
        (["-o", "no/such/folder/a.net.xml"], "does not exist; create it first"),
    ],
)
def test_bad_build_options_give_one_line(arguments, message):
    result = build(*arguments)
    assert result.returncode == 2
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


def test_a_main_lane_is_found_on_every_edge_by_its_number():
    assert NETWORK.strip(1) == ("upstream_4", "entry_4", "weave_5", "exit_4", "downstream_4", "outflow_4")
    for name in NETWORK.strip(3):
        edge, index = name.rsplit("_", 1)
        assert NETWORK.recorded_lane(edge, int(index)) == 3


def test_a_street_with_signals_has_no_network():
    with pytest.raises(InputError, match="'Main St' is a street with traffic lights"):
        network.of(replace(US101, name="Main St", network="", has_signals=True))
