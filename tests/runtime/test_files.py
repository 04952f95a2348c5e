from __future__ import annotations

from pathlib import Path

import pytest

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import MANIFEST, new_file, new_folder


def test_file_appears_whole(tmp_path: Path) -> None:
    with new_file(tmp_path / "a.rou.xml") as part:
        part.write_text("<routes/>")
        assert part.name.endswith(".rou.xml")
        assert not (tmp_path / "a.rou.xml").exists()
    assert (tmp_path / "a.rou.xml").read_text() == "<routes/>"
    assert [p.name for p in tmp_path.iterdir()] == ["a.rou.xml"]


def test_failure_keeps_the_earlier_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("old")
    with pytest.raises(RuntimeError), new_file(tmp_path / "a.csv") as part:
        part.write_text("half")
        raise RuntimeError
    assert (tmp_path / "a.csv").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_folder_replaces_only_an_earlier_result(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for text in ("one", "two"):
        with new_folder(out) as part:
            (part / MANIFEST).write_text(text)
            (part / "table").write_text(text)
        (out / "mine").write_text("kept")
    assert sorted(p.name for p in out.iterdir()) == [MANIFEST, "mine", "table"]
    assert (out / "table").read_text() == "two"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    (out / MANIFEST).unlink()
    with pytest.raises(InputError, match="not empty"), new_folder(out):
        pass
    assert (out / "mine").exists()


def test_interrupt_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), new_folder(tmp_path / "out") as part:
        (part / "half").write_text("")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError), new_folder(path):
            pass
    with pytest.raises(InputError, match="cannot write"), new_file(tmp_path / "none" / "a"):
        pass
    with pytest.raises(InputError, match="folder"), new_file(tmp_path) as part:
        part.write_text("x")
