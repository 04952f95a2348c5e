"""Vehicle types of SUMO's route files: sizes and classes as SUMO itself has them."""

from __future__ import annotations

from pathlib import Path

import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.readers.fcd_on_network import SIZES, read_types
from idm_sumo.runtime.errors import InputError

libsumo = pytest.importorskip("libsumo")
NET = Path(__file__).parents[3] / "network" / "us101.net.xml"


def routes(folder: Path, *types: str) -> Path:
    path = folder / "a.rou.xml"
    path.write_text(f"<routes>{''.join(types)}</routes>")
    return path


def test_a_type_without_a_size_has_that_of_its_class_in_sumo(tmp_path: Path) -> None:
    classes = ("passenger", "taxi", "custom1", *SIZES)
    path = routes(tmp_path, *(f'<vType id="{name}" vClass="{name}"/>' for name in classes))
    types = read_types([path])
    libsumo.start(["sumo", "-n", str(NET), "-r", str(path), "--no-step-log", "--no-warnings"])
    try:
        for name in classes:
            assert types.lengths[name] == pytest.approx(libsumo.vehicletype.getLength(name))
            assert types.widths[name] == pytest.approx(libsumo.vehicletype.getWidth(name))
    finally:
        libsumo.close()
    assert [types.classes[name] for name in ("bus", "moped", "taxi")] == [c.TRUCK, c.MOTORCYCLE, c.CAR]


def test_types_of_a_distribution_count_and_the_same_type_may_come_twice(tmp_path: Path) -> None:
    one = '<vType id="a" length="4.5"/>'
    path = routes(tmp_path, one, f'<vTypeDistribution id="all">{one}<vType id="b" length="9"/></vTypeDistribution>')
    assert read_types([path, path]).lengths == {"a": 4.5, "b": 9.0}


@pytest.mark.parametrize(
    ("second", "complaint"),
    [
        ('<vType id="a" length="5"/>', "line 1: vType 'a' is there twice, with different sizes"),
        ('<vType id="b" length="0"/>', "vType 'b': length = '0' is no size"),
        ('<vType id="b" width="wide"/>', "vType 'b': width = 'wide' is no size"),
        ('<vType id="b"', "malformed XML"),
        (f'<vType id="b" name="{"x" * 2**21}"/>', "an element of more than 1 MB"),
    ],
)
def test_what_is_no_size_is_refused_with_its_line(second: str, complaint: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=complaint):
        read_types([routes(tmp_path, '<vType id="a" length="4.5"/>', second)])
