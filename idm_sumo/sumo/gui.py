"""A run in sumo-gui, controlled through traci.

A traci connection has the functions of libsumo.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.plain_paths import plain
from idm_sumo.sumo.session import ALWAYS

DELAY = "20"  # ms a step, so that one can follow it


def gui_binary() -> str:
    """Return the path of sumo-gui.

    It is the one of the eclipse-sumo wheel, else the one on the search path.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If there is none, or no display to show it on.
    """
    wheel = importlib.util.find_spec("sumo")
    folders = [str(Path(place) / "bin") for place in (wheel.submodule_search_locations or [])] if wheel else []
    found = shutil.which("sumo-gui", path=os.pathsep.join(folders)) or shutil.which("sumo-gui")
    if found is None:
        raise InputError("--gui: sumo-gui is not installed; `pip install eclipse-sumo`, or put SUMO's bin on PATH")
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise InputError("--gui: no display (DISPLAY is not set); run without --gui, or under `xvfb-run`")
    return found


@contextmanager
def gui_simulation(options: Sequence[str], *, net: Path) -> Iterator[Any]:
    """Run sumo-gui on a network; yields a traci connection.

    Parameters
    ----------
    options : sequence of str
        As of :func:`idm_sumo.sumo.session.simulation`.
    net : Path
        The network.

    Yields
    ------
    traci.connection.Connection

    Raises
    ------
    InputError
        If sumo-gui is missing, does not start, or its window is closed before the end.
    """
    binary = gui_binary()
    import traci

    with plain(net, options) as (net_name, named):
        command = [binary, "--net-file", net_name, "--step-length", str(FRAME_STEP), *ALWAYS, *named,
                   "--start", "true", "--quit-on-end", "true", "--delay", DELAY]  # fmt: skip
        try:
            traci.start(command, numRetries=30, label="idm-sumo", stdout=None)
            connection = traci.getConnection("idm-sumo")
        except (traci.exceptions.FatalTraCIError, traci.exceptions.TraCIException) as error:
            reason = " ".join(str(error).split())
            raise InputError(
                f"--gui: sumo-gui does not start ({reason}); is the display {os.environ.get('DISPLAY', '')} usable?"
            ) from None
        try:
            yield connection
        except traci.exceptions.FatalTraCIError:
            raise InputError("--gui: sumo-gui was closed before the end; let it run, or leave out --gui") from None
        finally:
            with suppress(traci.exceptions.FatalTraCIError):  # it may be closed already
                connection.close()
