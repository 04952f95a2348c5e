"""Speeds that the road imposes in a closed loop.

All vehicles have one desired speed or their own, but some places let nobody drive it: a narrow lane, a curve, a merge,
a queue behind the section. Variable speed signs hold these speeds, so that plain ``sumo`` imposes them too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import numpy.typing as npt
from scipy.ndimage import uniform_filter1d

from idm_sumo.calibration.place_speeds import INTERVAL, SETTING, PlaceSpeeds
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads import Road
from idm_sumo.sumo import network
from idm_sumo.sumo.export.translation import save
from idm_sumo.sumo.export.vtypes import number

Floats = npt.NDArray[np.float64]

LAST_STRETCH = 40.0  # m, before the section's end, whose speeds are imposed behind it
SIGN_INTERVAL = 1.0  # s between two settings of the speed behind the section
SMOOTHED_OVER = 7.0  # s
SLOWEST_SIGN = 0.5  # m/s; a limit of zero would close the road


@dataclass(frozen=True)
class SpeedSign:
    """A variable speed sign over some lanes.

    Attributes
    ----------
    name : str
    lanes : tuple of str
        SUMO's names.
    interval : float
        Time (s) between two settings, the first at the start.
    speeds : float64, shape (settings,)
        m/s.
    """

    name: str
    lanes: tuple[str, ...]
    interval: float
    speeds: Floats


def boundary_speeds(recording: Recording) -> Floats:
    """Return recorded speeds at the section's end.

    Means of the vehicles on the last 40 m in each lane and second, interpolated in time where a lane is empty, smoothed
    over 7 s, at least ``SLOWEST_SIGN`` and at most the speed limit.

    Parameters
    ----------
    recording : Recording
        One period.

    Returns
    -------
    float64, shape (seconds, main lanes)
        m/s.
    """
    table, road = recording.table, recording.road
    end = table[c.X].between(road.length - LAST_STRETCH, road.length) & (table[c.LANE] <= road.main_lanes)
    first, last = table[c.FRAME].min(), table[c.FRAME].max()
    seconds = int((last - first) * FRAME_STEP / SIGN_INTERVAL) + 1
    here = table[end]
    second = ((here[c.FRAME] - first) * FRAME_STEP // SIGN_INTERVAL).astype(np.int64)
    mean = here.groupby([second, here[c.LANE].astype(np.int64)])[c.SPEED].mean().unstack()
    mean = mean.reindex(index=range(seconds), columns=range(1, road.main_lanes + 1))
    filled = mean.interpolate(limit_direction="both").fillna(road.speed_limit).to_numpy()
    smooth = uniform_filter1d(filled, round(SMOOTHED_OVER / SIGN_INTERVAL), axis=0, mode="nearest")
    return np.asarray(np.clip(smooth, SLOWEST_SIGN, road.speed_limit))


def boundary_signs(recording: Recording) -> list[SpeedSign]:
    """Return signs with the recorded speeds behind the section.

    Recorded traffic is held up by what lies downstream of it; without these speeds a closed loop runs free there.

    Parameters
    ----------
    recording : Recording
        One period.

    Returns
    -------
    list of SpeedSign
        One a main lane; none where the network ends with the section.
    """
    net = network.of(recording.road)
    behind = net.layout.downstream
    if not behind:
        return []
    return [
        SpeedSign(f"{behind}.lane{lane}", (net.main_lane(behind, lane),), SIGN_INTERVAL, speeds)
        for lane, speeds in enumerate(boundary_speeds(recording).T, 1)
    ]


def place_signs(places: PlaceSpeeds, road: Road) -> list[SpeedSign]:
    """Return signs with the desired speed of every edge.

    Parameters
    ----------
    places : PlaceSpeeds
        Of the road's recording.
    road : Road

    Returns
    -------
    list of SpeedSign
        One an edge that holds drivers up.
    """
    net = network.of(road)
    lanes = {name: tuple(str(lane.getID()) for lane in net.load().getEdge(name).getLanes()) for name in net.mainline}
    times = np.arange(0.0, len(places.speeds) * INTERVAL, SETTING)
    signs = []
    for edge, speeds, end in zip(net.mainline, places.speeds.T, places.ends, strict=True):
        if np.isfinite(speeds).any():
            here = places.at(np.full(len(times), end - 1.0), times)
            signs.append(SpeedSign(f"{edge}.desired", lanes[edge], SETTING, np.minimum(here, road.speed_limit)))
    return signs


def write_signs(signs: Sequence[SpeedSign], path: Path) -> None:
    """Write speed signs.

    Parameters
    ----------
    signs : sequence of SpeedSign
    path : Path
        Additional file to write.
    """
    root = Element("additional")
    for one in signs:
        sign = SubElement(root, "variableSpeedSign", id=one.name, lanes=" ".join(one.lanes))
        for setting, speed in enumerate(one.speeds.tolist()):
            SubElement(sign, "step", time=number(setting * one.interval), speed=f"{speed:.3f}")
    save(root, path)
