"""The network that exported routes are for: ours.

Or another build of it.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.net_check import read_net
from idm_sumo.sumo.network import RoadNetwork


def checked_net(own: RoadNetwork, net_file: Path | str | None, desired_speed: float) -> Path:
    """Return the path of a suitable network.

    Parameters
    ----------
    own : RoadNetwork
        Of the drivers' road.
    net_file : Path or str or None
        Another build of it; by default the one in the package.
    desired_speed : float
        m/s, the highest of the drivers.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If it is no build of that network, or its limit is below the desired speed.
    """
    path = own.file if net_file is None else Path(net_file)
    if not path.is_file():
        raise InputError(f"{path}: no such network; build it with `python network/build.py`")
    net = read_net(path, internal=False)
    _check_edges(own, net, path)
    for name in own.mainline:
        limit = net.getEdge(name).getSpeed()
        if limit < desired_speed - 1e-4:
            raise InputError(
                f"{path}: edge {name!r} allows {limit:g} m/s, below the desired speed {desired_speed:g} m/s, "
                "which would cap every driver; build it with a higher --speed-limit-mph or lower desired_speed_m_s"
            )
    return path


def _check_edges(own: RoadNetwork, net: Any, path: Path) -> None:
    """Raise unless a network has our edges.

    With as many lanes, and leads from one to the next.
    """
    routes = [own.route(origin, end) for origin in own.origins for end in own.destinations]
    for name in dict.fromkeys(name for route in routes for name in route):
        if not net.hasEdge(name):
            raise InputError(f"{path}: has no edge {name!r}; routes are for builds of our own network")
        lanes, wanted = net.getEdge(name).getLaneNumber(), own.load().getEdge(name).getLaneNumber()
        if lanes != wanted:
            raise InputError(f"{path}: edge {name!r} has {lanes} lanes, not {wanted}; routes are for builds of our own")
    for one, following in dict.fromkeys(pair for route in routes for pair in pairwise(route)):
        if net.getEdge(following) not in net.getEdge(one).getOutgoing():
            raise InputError(f"{path}: no way from edge {one!r} to {following!r}; routes are for builds of our own")
