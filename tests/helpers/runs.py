"""Commands run once for many tests: the files that they leave."""

from __future__ import annotations

import io
import shutil
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from idm_sumo.cli import main
from tests.helpers.hostile import HOSTILE_NAME
from tests.helpers.platoons import platoon_recording

if TYPE_CHECKING:
    from tests.simulators.first import Plan

LATER = "0805-0820"  # the second period of the platoons


def write_platoons(folder: Path) -> None:
    """Write the small recording of two periods."""
    platoon_recording().to_parquet(folder / "platoons.parquet")


def calibrate(folder: Path, recording: Path) -> None:
    """Calibrate the platoons' drivers, as a user does."""
    main(["calibrate", str(recording), "-o", str(folder / "drivers.parquet")])


def reproduce(folder: Path, recording: Path) -> None:
    """Make the tables of the study in small, driven in SUMO; the recording's name tries to become markup."""
    named = shutil.copy(recording, folder / f"{HOSTILE_NAME}.parquet")
    main(["reproduce", str(named), "-o", str(folder / "study"), "--quick", "--no-agents"])


def slow_place() -> Plan:
    """Return the plan of a recording in which everybody is slower at one place."""
    from tests.simulators.first import plan  # needed by few tests, and slow to import

    return plan(
        5, effect="location", size="large", drivers=200, minutes=3.5, form="usual", underlying="idm", noise="white"
    )


def diagnose(folder: Path) -> None:
    """Write the recording of :func:`slow_place`, diagnose it, and keep what the command said."""
    from tests.simulators.first import simulate, write

    write(simulate(slow_place()), folder / "planted.txt")
    said = io.StringIO()
    with redirect_stdout(said):
        main(["diagnose", str(folder / "planted.txt"), "-o", str(folder / "diagnosis"), "--jobs", "1"])
    (folder / "said.txt").write_text(said.getvalue())
