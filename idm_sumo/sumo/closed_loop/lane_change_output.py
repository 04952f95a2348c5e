"""Lane changes as SUMO itself counts them.

SUMO writes each change of its model, one that is taken back at once as well. Ours counts a vehicle that stays in the
new lane for a second (:func:`idm_sumo.evaluation.macroscopic.lane_changes`), in recordings and runs alike.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import iterparse

import numpy as np
import numpy.typing as npt

from idm_sumo.sumo.network import Place, RoadNetwork


def changes_between_main_lanes(path: Path, network: RoadNetwork) -> int:
    """Count the changes between main lanes within the section.

    Parameters
    ----------
    path : Path
        What SUMO's option ``--lanechange-output`` left.
    network : RoadNetwork

    Returns
    -------
    int
    """
    rows = [dict(element.attrib) for _, element in iterparse(path) if element.tag == "change"]
    on_road = [row for row in rows if row["from"].rpartition("_")[0] in network.mainline]
    if not on_road:
        return 0
    before, after = (_places(network, [row[end] for row in on_road], on_road) for end in ("from", "to"))
    inside = (before[0] >= 0.0) & (before[0] <= network.road.length)
    main = (before[1] <= network.road.main_lanes) & (after[1] <= network.road.main_lanes)
    return int((inside & main).sum())


def _places(
    network: RoadNetwork, lanes: list[str], rows: list[dict[str, str]]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Return ``x`` (m) and recorded lane."""
    edge, index = zip(*((name.rpartition("_")[0], int(name.rpartition("_")[2])) for name in lanes), strict=True)
    position = np.array([float(row["pos"]) for row in rows])
    x, _, lane = network.coordinates(Place(np.array(edge), np.array(index), position))
    return x, lane
