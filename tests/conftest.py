"""What tests of several modules need."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# No timed assertion: the first call of a kernel compiles it.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder with real trajectories: ``IDM_SUMO_DATA``, or ``../shared/data`` beside the clone."""
    root = Path(__file__).parents[1]
    folder = Path(os.environ.get("IDM_SUMO_DATA", root.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real trajectories at {folder}; set IDM_SUMO_DATA to run this test")
    return folder


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Yield a Chromium, one for all tests of a process; a test skips where there is none."""
    from tests.helpers.browser import open_browser

    with open_browser() as driver:
        yield driver
