"""Inputs that tests of several rooms share; what takes long is made once, by whichever worker comes first."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from filelock import FileLock
from hypothesis import settings

from tests.helpers import runs

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


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Return a function that fills a folder unless another test, of any worker, has filled it."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent

    def made(name: str, make: Callable[..., None], *given: Path) -> Path:
        folder, done = shared / name, shared / f"{name}.done"
        with FileLock(shared / f"{name}.lock"):
            if not done.exists():
                folder.mkdir(exist_ok=True)
                make(folder, *given)
                done.touch()
        return folder

    return made


@pytest.fixture(scope="session")
def platoons(made_once: Callable[..., Path]) -> Path:
    """A recording of two periods, 48 vehicles in platoons."""
    return made_once("platoons", runs.write_platoons) / "platoons.parquet"


@pytest.fixture(scope="session")
def platoon_drivers(made_once: Callable[..., Path], platoons: Path) -> Path:
    """The platoons' drivers, calibrated."""
    return made_once("platoon_drivers", runs.calibrate, platoons) / "drivers.parquet"


@pytest.fixture(scope="session")
def platoon_study(made_once: Callable[..., Path], platoons: Path) -> Path:
    """What ``reproduce --quick`` leaves of the platoons."""
    return made_once("platoon_study", runs.reproduce, platoons) / "study"


@pytest.fixture(scope="session")
def slow_place(made_once: Callable[..., Path]) -> Path:
    """A folder with ``planted.txt``, traffic that is slower at one place, and its ``diagnosis``."""
    return made_once("slow_place", runs.diagnose)
