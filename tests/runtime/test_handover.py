"""A value handed over in a file: the same, and gone afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.handover import handed_over, received


def test_the_value_comes_as_it_was_and_nothing_is_left(tmp_path: Path) -> None:
    with handed_over(("a", [1.5]), tmp_path) as file:
        assert file.is_absolute()
        assert file.is_relative_to(tmp_path)
        assert received(file) == ("a", [1.5])
    assert list(tmp_path.iterdir()) == []


def test_who_does_not_see_the_folder_is_told_that_all_must(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="all machines of a cluster must see"):
        received(tmp_path / "value.pickle")
