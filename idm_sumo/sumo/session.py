"""Running SUMO inside this process, through libsumo."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.plain_paths import plain

# What every simulation shares.
ALWAYS = (
    "--xml-validation", "never",
    "--no-step-log", "true",
    "--time-to-teleport", "-1",  # no vehicle is removed from a jam
)  # fmt: skip

STANDARD_ERROR = 2

# What a replay needs: SUMO holds vehicles and names leaders; their motion is decided outside.
REPLAY = (
    # Without sublanes the order of a lane goes stale when a moved vehicle passes another, and
    # getLeader names the wrong one. One sublane a lane is enough to have it sorted every step.
    "--lateral-resolution", "3.66",
    # No vehicle drives itself, so none needs to plan: a third of the time of a step.
    "--default.action-step-length", "1000",
    # Collisions are judged by our own rectangles (SUMO's check ignores moved vehicles anyhow).
    "--collision.action", "none",
    # SUMO would warn of the two choices above, and of recorded drivers that brake hard.
    "--no-warnings", "true",
)  # fmt: skip


def load_libsumo() -> Any:
    """Return the module libsumo.

    Returns
    -------
    module

    Raises
    ------
    InputError
        If it is not installed, or a library of the system that it needs is missing.
    """
    try:
        import libsumo
    except (ImportError, OSError) as error:
        reason = str(error).strip().splitlines()[-1]
        raise InputError(
            f"libsumo cannot be loaded ({reason}): `pip install libsumo`; on a slim system also "
            "the packages libx11-6 libxext6 libxrender1 libgl1 libatomic1 libexpat1"
        ) from None
    return libsumo


@contextmanager
def simulation(options: Sequence[str] = REPLAY, *, net: Path, step_length: float = FRAME_STEP) -> Iterator[Any]:
    """Run SUMO on a network; yields the module libsumo.

    Parameters
    ----------
    options : sequence of str
        Options of ``sumo`` beside those every simulation shares.
    net : Path
        The network, for example ``network.of(road).file``.
    step_length : float
        Length of a simulation step (s); by default a recorded frame.

    Yields
    ------
    module
        libsumo, with the simulation loaded.

    Raises
    ------
    InputError
        If libsumo or the network cannot be loaded, or SUMO refuses an option or what it reads on its way.
    RuntimeError
        If a simulation already runs in this process: libsumo holds one.
    """
    _check_net(net)
    sumo = load_libsumo()
    if sumo.isLoaded():
        raise RuntimeError("one simulation a process: leave the first `with simulation()` before the next")
    with plain(net, options) as (net_name, named):
        command = ["sumo", "--net-file", net_name, "--step-length", str(step_length), *ALWAYS, *named]
        said: list[str] = []
        try:
            with _heard(said):
                sumo.start(command)
        except sumo.TraCIException as error:
            reason = " ".join([*said, str(error)])
            raise InputError(
                f"{net}: SUMO does not start ({reason}); check this network and {' '.join(options)}"
            ) from None
        try:
            yield sumo
        except sumo.FatalTraCIError as error:
            raise InputError(f"{net}: SUMO stopped ({error}); check this network and {' '.join(options)}") from None
        finally:
            sumo.close()


@contextmanager
def _heard(said: list[str]) -> Iterator[None]:
    """Collect what SUMO itself writes to standard error.

    Keep what SUMO itself writes to standard error from there and collect it, for one message to tell it.
    """
    sys.stderr.flush()
    with tempfile.TemporaryFile() as aside:
        usual = os.dup(STANDARD_ERROR)
        os.dup2(aside.fileno(), STANDARD_ERROR)
        try:
            yield
        finally:
            os.dup2(usual, STANDARD_ERROR)
            os.close(usual)
            aside.seek(0)
            said += aside.read().decode("utf-8", "replace").splitlines()


def _check_net(path: Path) -> None:
    """Refuse a broken network file, which would crash libsumo."""
    if not path.is_file():
        raise InputError(f"{path}: no such network; build it with `python network/build.py`")
    try:
        edges = ElementTree.parse(path).getroot().find("edge")
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: {error}; build the network anew with `python network/build.py`") from None
    if edges is None:
        raise InputError(f"{path}: has no edge; build the network anew with `python network/build.py`")
