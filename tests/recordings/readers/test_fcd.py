"""FCD files here are written by SUMO itself, on the study's network."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.reading import read_recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError

libsumo = pytest.importorskip("libsumo")
NET = Path(__file__).parents[3] / "network" / "us101.net.xml"
ROUTES = """<routes><vType id="car" length="4.5" carFollowModel="IDM"/><route id="main" edges="entry weave exit"/>
<route id="from_ahead" edges="upstream entry weave exit"/>
<vehicle id="17" type="car" route="main" depart="0" departLane="3" departPos="100" departSpeed="15"/>
<vehicle id="car.1" type="car" route="main" depart="0" departLane="4" departPos="150" departSpeed="15"/>
<vehicle id="0" type="car" route="from_ahead" depart="0" departLane="0" departPos="100" departSpeed="20"/></routes>"""
END = 10.0


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FCD of one simulation, written in each format."""
    folder = tmp_path_factory.mktemp("fcd")
    (folder / "a.rou.xml").write_text(ROUTES)
    files = {name: folder / f"fcd.{name}" for name in ("xml", "xml.gz", "parquet", "bare.xml")}
    for name, path in files.items():
        simulate(folder / "a.rou.xml", path, *([] if name == "bare.xml" else ["--fcd-output.acceleration"]))
    return files


def simulate(routes: Path, out: Path, *options: str) -> dict[str, list[float]]:
    """Write FCD and return the longitudinal positions SUMO itself reports at each step."""
    libsumo.start([
        "sumo", "-n", str(NET), "-r", str(routes), "--fcd-output", str(out), "--precision", "6", "--no-step-log",
        "--xml-validation", "never", "--no-warnings", *(() if "--step-length" in options else ("--step-length", "0.1")),
        *options,
    ])  # fmt: skip
    positions: dict[str, list[float]] = {}
    while libsumo.simulation.getTime() < END:
        libsumo.simulationStep()
        for name in libsumo.vehicle.getIDList():
            positions.setdefault(name, []).append(libsumo.vehicle.getPosition(name)[0])
    libsumo.close()
    return positions


@pytest.mark.parametrize("name", ["xml", "xml.gz", "parquet"])
def test_sumo_coordinates_are_ours(run: dict[str, Path], name: str) -> None:
    result = read_recording(run[name])
    table = result.table
    assert set(table[c.VEHICLE]) == {17, 18, 19}  # 17 keeps its number, the others get the next free ones
    assert any("car.1 = 18, 0 = 19" in note for note in result.notes)
    first = table[table[c.VEHICLE] == 17].iloc[0]
    assert (first[c.LANE], first[c.FRAME]) == (2, 0)
    assert first[c.Y] == pytest.approx(float(US101.lane_center(2)), abs=1e-6)
    assert first[c.SPEED] == pytest.approx(15.0)
    assert first[c.HEADING] == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(first[c.LENGTH])


def test_positions_are_sumos_own_and_rows_before_the_section_are_booked(run: dict[str, Path], tmp_path: Path) -> None:
    truth = simulate(run["xml"].parent / "a.rou.xml", tmp_path / "again.xml")
    result = read_recording(tmp_path / "again.xml")
    table = result.table
    np.testing.assert_allclose(table[c.X][table[c.VEHICLE] == 17], truth["17"], atol=1e-5)
    before = int((np.array(truth["0"]) < 0).sum())
    assert before > 0
    assert result.accounting.dropped == {"outside the section": before}
    assert result.accounting.total == sum(map(len, truth.values()))


def test_xml_gzip_and_parquet_say_the_same(run: dict[str, Path]) -> None:
    xml, packed, parquet = (read_recording(run[name]).table for name in ("xml", "xml.gz", "parquet"))
    pd.testing.assert_frame_equal(xml, packed)
    pd.testing.assert_frame_equal(xml, parquet, atol=1e-5, check_exact=False)  # SUMO writes 32-bit speeds to Parquet


def test_acceleration_is_found_where_sumo_did_not_write_it(run: dict[str, Path]) -> None:
    own, found = (read_recording(run[name]).table for name in ("xml", "bare.xml"))
    later = (own[c.FRAME] > own.groupby(c.VEHICLE)[c.FRAME].transform("min")).to_numpy()
    np.testing.assert_allclose(found[c.ACCELERATION][later], own[c.ACCELERATION][later], atol=1e-4)


def test_another_step_length_is_resampled(tmp_path: Path) -> None:
    rows = "".join(
        f'<timestep time="{t}"><vehicle id="7" x="{50 + 10 * t}" y="-1.8" angle="90" speed="10"/></timestep>'
        for t in range(8)
    )
    (tmp_path / "slow.xml").write_text(f"<fcd-export>{rows}</fcd-export>")
    recording = read_recording(tmp_path / "slow.xml")
    np.testing.assert_allclose(recording.table[c.X], 50 + np.arange(71), atol=1e-9)
    assert recording.accounting.added == {"interpolated to frames of 0.1 s": 63}


def test_another_network_is_refused(run: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "far.xml").write_text(run["xml"].read_text().replace(' y="-', ' y="-9'))
    with pytest.raises(InputError, match="no position lies in the study section"):
        read_recording(tmp_path / "far.xml")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: text[: len(text) // 2], r"line \d+: malformed XML .* cut short"),
        (
            lambda text: text.replace('speed="15.000000"', 'speed="fast"', 1),
            r"line \d+: 17: speed = 'fast' is not a number",
        ),
        (lambda text: text.replace("fcd-export", "routes"), "root element is <routes>"),
        (lambda _: "<fcd-export></fcd-export>", "no vehicles"),
        (lambda text: text.replace(" angle=", " angel="), "FCD attribute 'angle' is missing"),
    ],
)
def test_bad_files_are_named_in_one_line(run: dict[str, Path], tmp_path: Path, edit: object, message: str) -> None:
    (tmp_path / "bad.xml").write_text(edit(run["xml"].read_text()))
    with pytest.raises(InputError, match=f"bad.xml: {message}") as caught:
        read_recording(tmp_path / "bad.xml")
    assert "\n" not in str(caught.value)


def test_a_broken_archive_is_named(run: dict[str, Path], tmp_path: Path) -> None:
    packed = gzip.compress(run["xml"].read_bytes())
    (tmp_path / "cut.xml.gz").write_bytes(packed[: len(packed) // 2])
    with pytest.raises(InputError, match=r"cut.xml.gz: cannot be (unpacked|read)"):
        read_recording(tmp_path / "cut.xml.gz")
