"""Network files of strangers, checked before sumolib reads them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from idm_sumo.recordings.coercion import EARTH
from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.inputs import existing_file
from idm_sumo.runtime.xml import scan

ROOTS = {"net": "a SUMO network"}
WIDEST_LANE = 100.0  # m; SUMO's own default is 3.2


def read_net(path: Path, *, internal: bool) -> Any:
    """Return the :class:`sumolib.net.Net` of a file.

    Parameters
    ----------
    path : Path
        A ``.net.xml``, plain or gzip.
    internal : bool
        Whether with the edges within junctions.

    Raises
    ------
    InputError
        As of :func:`check_net_file`, or if sumolib stumbles over it.
    """
    from sumolib.net import readNet

    check_net_file(path)
    try:
        return readNet(str(path), withInternal=internal)
    except Exception as error:  # of any kind: sumolib takes every attribute for sound
        raise InputError(f"{path}: not a SUMO network ({type(error).__name__}: {error})") from None


def check_net_file(path: Path) -> None:
    """Raise for what is no network.

    A lane of an impossible size is refused, too.

    Parameters
    ----------
    path : Path
        A ``.net.xml``, plain or gzip.

    Raises
    ------
    InputError
        Names the line, and what to do.
    """
    edges: set[str] = set()
    with existing_file(path, "name a network (.net.xml)").open("rb") as stream:
        if stream.read(6).startswith((b"BZh", b"\xfd7zXZ\x00")):
            raise InputError(f"{path}: unpack it first; SUMO reads networks plain or packed by gzip")

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if tag == "edge":
            _new_name(attributes, edges)
        elif tag == "lane":
            _check_lane(attributes)

    scan(path, path, begin, roots=ROOTS, advice="is it whole?")
    if not edges:
        raise InputError(f"{path}: has no edge; is it a network that netconvert made?")


def _new_name(attributes: dict[str, str], edges: set[str]) -> None:
    name = attributes.get("id", "")
    if not name or name in edges:
        raise ValueError(f"edge {shown(name)} is there twice" if name else "an edge has no id")
    edges.add(name)


def _check_lane(attributes: dict[str, str]) -> None:
    name = shown(attributes.get("id", ""))
    for key, highest in (("length", EARTH), ("speed", math.inf), ("width", WIDEST_LANE)):
        text = attributes.get(key, "1" if key == "width" else "")
        if not 0.0 < _number(text) <= highest:
            raise ValueError(f"lane {name}: {key} = {shown(text)} is impossible; build the network with netconvert")
    points = [[_number(one) for one in point.split(",")] for point in attributes.get("shape", "").split()]
    good = all(len(point) in (2, 3) and all(abs(one) <= EARTH for one in point) for point in points)
    if len(points) < 2 or not good:
        raise ValueError(f"lane {name}: its shape is not two points or more; build the network with netconvert")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
