"""A population on a network of one's own: an on-ramp that joins three full lanes, and nobody brakes in an emergency."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path
from xml.etree.ElementTree import parse

import pytest

from idm_sumo.sumo.export.distribution import export_distribution
from tests.helpers.exports import drivers

NODES = '<nodes><node id="a" x="0" y="0"/><node id="r" x="600" y="-120"/><node id="m" x="1000" y="0"/>' \
        '<node id="e" x="1250" y="0"/><node id="z" x="2000" y="0"/></nodes>'  # fmt: skip
EDGES = '<edges><edge id="up" from="a" to="m" numLanes="3" speed="29.06" priority="2"/>' \
        '<edge id="ramp" from="r" to="m" numLanes="1" speed="22" priority="1"/>' \
        '<edge id="merge" from="m" to="e" numLanes="4" speed="29.06" priority="2"/>' \
        '<edge id="down" from="e" to="z" numLanes="3" speed="29.06" priority="2"/></edges>'  # fmt: skip
WAYS = (("up", 0, "merge", 1), ("up", 1, "merge", 2), ("up", 2, "merge", 3), ("ramp", 0, "merge", 0),
        ("merge", 1, "down", 0), ("merge", 2, "down", 1), ("merge", 3, "down", 2))  # fmt: skip
FLOWS = (("up", 4500), ("ramp", 600))  # vehicles an hour


def program(name: str) -> str:
    wheel = importlib.util.find_spec("sumo")
    if wheel is None or not wheel.submodule_search_locations:
        pytest.skip("eclipse-sumo is not installed")
    return str(Path(wheel.submodule_search_locations[0]) / "bin" / name)


def network(folder: Path) -> Path:
    """Build three lanes with an on-ramp whose lane ends after 250 m."""
    ways = "".join(f'<connection from="{a}" fromLane="{i}" to="{b}" toLane="{j}"/>' for a, i, b, j in WAYS)
    parts = {"nod": NODES, "edg": EDGES, "con": f"<connections>{ways}</connections>"}
    for kind, text in parts.items():
        (folder / f"n.{kind}.xml").write_text(text)
    path = folder / "ramp.net.xml"
    command = [program("netconvert"), "-n", str(folder / "n.nod.xml"), "-e", str(folder / "n.edg.xml"),
               "-x", str(folder / "n.con.xml"), "-o", str(path), "--no-turnarounds"]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    return path


def test_nobody_brakes_in_an_emergency_or_is_left_out(tmp_path: Path) -> None:
    types = export_distribution(drivers(n=60), tmp_path / "population.add.xml").file
    flows = "".join(
        f'<flow id="{edge}" type="calibrated" begin="0" end="300" vehsPerHour="{flow}" departLane="best" '
        f'departSpeed="desired"><route edges="{edge} merge down"/></flow>'
        for edge, flow in FLOWS
    )
    routes, statistics = tmp_path / "flows.rou.xml", tmp_path / "statistics.xml"
    routes.write_text(f"<routes>{flows}</routes>")
    command = [program("sumo"), "-n", str(network(tmp_path)), "-r", str(routes), "-a", str(types),
               "--step-length", "0.1", "--end", "600", "--statistic-output", str(statistics), "--no-step-log",
               "--time-to-teleport", "-1"]  # fmt: skip
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "emergency" not in run.stderr
    found = parse(statistics).getroot()
    vehicles, safety = found.find("vehicles"), found.find("safety")
    assert vehicles is not None
    assert safety is not None
    assert int(vehicles.attrib["loaded"]) == int(vehicles.attrib["inserted"]) == 425
    assert safety.attrib["collisions"] == safety.attrib["emergencyBraking"] == "0"
