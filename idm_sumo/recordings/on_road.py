"""Whether a recording lies on the road that it is read for."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.recordings import columns as c
from idm_sumo.roads import Road
from idm_sumo.roads.straight import FREE, lanes_of_labels, straight_road
from idm_sumo.runtime.errors import InputError

LEFT, RIGHT = 0.5, 3.0  # lane widths beside the main lanes within which a position may be: side lanes lie on the right
BEYOND = 30.0  # m; vehicles are recorded a little beyond the section
MOST_OUTSIDE = 0.05  # share of rows; more are of another road
WIDTH_TOLERANCE = 0.1  # relative: lanes whose middles are farther or nearer apart are another road's
REMEDY = (
    "name its network with --net-file, or give leader-follower pairs, which need none; with lane numbers a straight "
    "road can be made of them"
)
ENOUGH_LANES = 3  # labelled lanes that tell how wide lanes are

Flags = npt.NDArray[np.bool_]


def outside(x: pd.Series, y: pd.Series, road: Road, *, network: bool = False) -> Flags:
    """Return which positions (m) lie off the section, or off all of the road's network; shape ``(rows,)``."""
    first, last = road.reach if network and road.reach else (0.0, road.length)
    left, right = LEFT * road.widths[0], -road.width - RIGHT * road.widths[-1]
    return np.asarray(~x.between(first - BEYOND, last + BEYOND) | ~y.between(right, left))


def check_on_road(x: pd.Series, y: pd.Series, road: Road, source: str, *, network: bool = False) -> None:
    """Raise if more than :data:`MOST_OUTSIDE` of the positions lie off the road.

    Parameters
    ----------
    x, y : pandas.Series
        m.
    road : Road
    source : str
        What messages call the recording.
    network : bool, keyword-only
        Whether it may have been recorded anywhere in the road's network, as SUMO does, or only in the section.

    Raises
    ------
    InputError
        Says which share lies outside, and how far positions go.
    """
    if why := off_road(x, y, road, network=network):
        raise InputError(f"{source}: {why}: {REMEDY}")


def off_road(x: pd.Series, y: pd.Series, road: Road, *, network: bool = False) -> str:
    """Return what lies off the road if more than :data:`MOST_OUTSIDE` of the positions do; empty if not."""
    off = outside(x, y, road, network=network)
    if off.mean() <= MOST_OUTSIDE:
        return ""
    return (
        f"{off.mean():.0%} of the rows do not lie on {road.name} ({road.length:.0f} m, {road.main_lanes} main "
        f"lanes): x goes from {x.min():.1f} to {x.max():.1f} m, y from {y.min():.1f} to {y.max():.1f} m; it was "
        "recorded on another road"
    )


def foreign_edges(lanes: pd.Series, road: Road) -> list[str]:
    """Return the edges of another network if more than :data:`MOST_OUTSIDE` of the rows are on such; else none.

    Parameters
    ----------
    lanes : pandas.Series of str
        SUMO's lanes, such as ``entry_3``; empty where a row has none.
    road : Road
    """
    edges = lanes.dropna().astype(str).str.rsplit("_", n=1).str[0]
    edges = edges[(edges != "") & ~edges.str.startswith(":")]  # within a junction it is nobody's edge
    other = ~edges.isin(road.edges)
    if not road.edges or not len(edges) or other.mean() <= MOST_OUTSIDE:
        return []
    return sorted(edges[other].unique())


def check_foreign_lanes(lanes: pd.Series, y: pd.Series, edges: list[str], road: Road, source: str) -> None:
    """Raise if the lanes of another network are more, wider or narrower than the road's.

    Parameters
    ----------
    lanes, y : pandas.Series
        SUMO's lanes and lateral positions (m).
    edges : list of str
        Names of the other network's edges.
    road : Road
    source : str

    Raises
    ------
    InputError
        Names edges, and what of the lanes does not fit.
    """
    index = pd.to_numeric(lanes.astype(str).str.rsplit("_", n=1).str[-1], errors="coerce")
    middle = y.groupby(index).median()  # SUMO counts lanes from the right
    some, fitting = ", ".join(edges[:5]), road.main_lanes + bool(road.side_lanes)
    apart = float(middle.diff().dropna().median()) if len(middle) > 1 else road.widths[0]
    if len(middle) > fitting or abs(apart / road.widths[0] - 1.0) > WIDTH_TOLERANCE:
        raise InputError(
            f"{source}: its edges ({some}) are not those of {road.name}, and neither do its lanes fit: "
            f"{len(middle)} lanes "
            f"{apart:.2f} m apart where {road.name} has {road.main_lanes} main lanes of {road.widths[0]:.2f} m; "
            f"{REMEDY}"
        )


def check_lane_widths(table: pd.DataFrame, road: Road, source: str, labelled: Collection[int]) -> None:
    """Raise if labelled lanes are wider or narrower than the road's.

    Parameters
    ----------
    table : pandas.DataFrame
        ``lane`` and ``y`` (m).
    road : Road
    source : str
    labelled : collection of int
        Lane numbers to judge by.

    Raises
    ------
    InputError
        Says how far apart the middles of lanes are.
    """
    if why := other_lanes(table[table[c.LANE].isin(labelled)], road):
        raise InputError(f"{source}: {why}; it was recorded on another road: {REMEDY}")


def other_lanes(table: pd.DataFrame, road: Road) -> str:
    """Return how labelled lanes are wider or narrower than the road's; empty if they are not."""
    middle = table.groupby(c.LANE)[c.Y].median()
    if len(middle) < ENOUGH_LANES:
        return ""
    first, last = int(middle.index[0]), int(middle.index[-1])
    apart = float(middle.iloc[0] - middle.iloc[-1]) / (last - first)
    wide = float(road.lane_center(first) - road.lane_center(last)) / (last - first)
    if abs(apart / wide - 1.0) <= WIDTH_TOLERANCE:
        return ""
    return f"lanes {first} to {last} are {apart:.2f} m apart where those of {road.name} are {wide:.2f} m"


def why_foreign(table: pd.DataFrame, road: Road, *, network: bool = False) -> str:
    """Return why a table with lanes is not of a road; empty if it may be.

    Parameters
    ----------
    table : pandas.DataFrame
        ``x, y`` (m) and ``lane``.
    road : Road
    network : bool, keyword-only
        See :func:`check_on_road`.
    """
    main = table[table[c.LANE].between(1, road.main_lanes)]
    return off_road(table[c.X], table[c.Y], road, network=network) or other_lanes(main, road)


def road_of_lanes(table: pd.DataFrame, name: str, why: str, source: str, notes: list[str]) -> tuple[Road, pd.DataFrame]:
    """Return a straight road of the lanes that a table names, and the table on it.

    Parameters
    ----------
    table : pandas.DataFrame
        ``x, y`` (m), ``speed`` (m/s) and ``lane``.
    name : str
        Of the road.
    why : str
        Why the road is not a built-in one.
    source : str
        Name for messages.
    notes : list of str
        Gets a line that says all this.

    Raises
    ------
    InputError
        If the lanes make no road.
    """
    lanes = lanes_of_labels(table[c.Y], table[c.LANE], source)
    limit = float(table[c.SPEED].quantile(FREE))
    beside = bool((lanes.number == 0).any())
    road = straight_road(name, lanes.widths, length=float(table[c.X].max()), speed_limit=max(limit, 1.0), beside=beside)
    number = np.where(lanes.number > 0, lanes.number, road.main_lanes + 1)
    wide = ", ".join(f"{width:.2f}" for width in road.widths)
    notes.append(
        f"{why}: a straight road of the recorded lanes is taken, {road.main_lanes} lanes ({wide} m), "
        f"{road.length:.0f} m; desired speed {limit:.1f} m/s, which {1 - FREE:.0%} of the rows exceed "
        "(--desired-speed gives another)"
    )
    return road, table.assign(**{c.LANE: number, c.Y: road.lane_center(number) + lanes.offset})
