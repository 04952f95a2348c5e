"""What goes to workers in a file, and what they leave: the same, whole, and nothing beside it."""

from __future__ import annotations

from pathlib import Path

import pytest

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.handover import handed_back, handed_over, received
from idm_sumo.runtime.siblings import scratch
from idm_sumo.runtime.spread import spread
from tests.helpers.cluster import HALF, leaving, until


def test_the_value_comes_as_it_was_and_nothing_is_left(tmp_path: Path) -> None:
    with handed_over(("a", [1.5]), tmp_path) as file:
        assert file.is_absolute()
        assert file.is_relative_to(tmp_path)
        assert received(file) == ("a", [1.5])
    assert list(tmp_path.iterdir()) == []


def test_who_does_not_see_the_folder_is_told_that_all_must(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all machines of a cluster must see"):
        received(tmp_path / "value.pickle")


def test_two_processes_that_leave_the_same_leave_it_whole(tmp_path: Path) -> None:
    """One ends, and only then the other begins to write: what is there stays whole all the time."""
    folder, marks = tmp_path / "results", tmp_path / "marks"
    folder.mkdir()
    marks.mkdir()

    def look(name: str) -> None:
        assert [file.name for file in folder.iterdir()] == ["table.csv"]
        assert (folder / "table.csv").read_text() == HALF + HALF
        (marks / name).touch()

    with scratch(tmp_path) as workshop:
        left = spread(leaving, [(folder, workshop, marks, *halves) for halves in ((0, 0), (2, 4))], jobs=2)
        assert next(left) == (0, None)
        look("after one")
        until(lambda: len(list(marks.iterdir())) == 3)
        look("amid the other")
        assert next(left) == (1, None)
        look("after both")
        assert list(workshop.iterdir()) == []


def test_a_block_that_fails_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    with scratch(tmp_path) as workshop, pytest.raises(RuntimeError), handed_back(tmp_path / "results", workshop) as own:
        (own / "half.csv").touch()
        raise RuntimeError
    assert [path.name for path in tmp_path.rglob("*")] == ["results"]


def test_who_comes_when_the_program_has_ended_fails_alone(tmp_path: Path) -> None:
    with scratch(tmp_path) as workshop:
        late = handed_back(tmp_path / "results", workshop)
        (late.__enter__() / "late.csv").touch()
    with pytest.raises(FileNotFoundError):
        late.__exit__(None, None, None)
    assert list(tmp_path.iterdir()) == []
