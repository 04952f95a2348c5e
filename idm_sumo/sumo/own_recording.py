"""A recording kept with the user's network as its road."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from idm_sumo.recordings.reading import read_recording, write_parquet
from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.cache import kept
from idm_sumo.runtime.environment import fingerprint
from idm_sumo.sumo.own_network import road_of

PACKAGE = Path(__file__).parents[1]


def read_on_network(
    recording: Path, net: Path, *, corridor: Sequence[str] = (), route_files: Sequence[Path] = (), location: str
) -> Recording:
    """Read a recording on the edges of a network.

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
    """Return the file of a recording on a network.

    It holds what :func:`read_on_network` returns and is made if the cache lacks it; other sources of the
    program, which may read it another way, make their own.
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

    def write(path: Path) -> None:
        found = read_on_network(recording, net, corridor=corridor, route_files=route_files, location=location)
        write_parquet(found, path)

    stem = recording.name.partition(".")[0][:40]
    return kept(f"networks/{stem}", ".parquet", [fingerprint(PACKAGE), told, list(corridor), location], write)
