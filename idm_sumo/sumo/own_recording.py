"""A recording on a user's own network.

Kept as one file that names its road.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.cache import cache_folder
from idm_sumo.sumo.own_network import road_of


def read_on_network(
    recording: Path, net: Path, *, corridor: Sequence[str] = (), route_files: Sequence[Path] = (), location: str
) -> Recording:
    """Read a recording on edges of a network.

    Return a recording of the road that edges of a network make up.

    Parameters
    ----------
    recording : Path
        In any layout; floating car data name their lanes, others lie along the corridor from its start.
    net : Path
    corridor : sequence of str
        Edges in driving order; see :func:`idm_sumo.sumo.own_network.road_of`.
    route_files : sequence of Path
        With the vehicle types of floating car data.
    location : str
        Which location to keep of a file that mixes several.
    """
    road = road_of(net, corridor)
    found = read_recording(recording, location=location, road=road, route_files=route_files)
    return replace(found, source=recording.name)


def kept_on_network(
    recording: Path, net: Path, *, corridor: Sequence[str] = (), route_files: Sequence[Path] = (), location: str
) -> Path:
    """Return a file of a recording on a network.

    Return a file of the recording that :func:`read_on_network` returns, made if the cache lacks it.

    Whatever reads it knows the road, so that programs which pass on the path of a recording need not.

    Parameters
    ----------
    recording, net : Path
    corridor : sequence of str
        Edges in driving order.
    route_files : sequence of Path
    location : str
    """
    files = [recording, net, *route_files]
    told = [[str(path.resolve()), path.stat().st_size, path.stat().st_mtime_ns] for path in files if path.exists()]
    name = hashlib.sha256(json.dumps([told, list(corridor), location]).encode()).hexdigest()[:12]
    path = cache_folder() / "networks" / f"{recording.name.partition('.')[0][:40]}-{name}.parquet"
    if not path.is_file():
        found = read_on_network(recording, net, corridor=corridor, route_files=route_files, location=location)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_parquet(found, path)
    return path
