"""The road that traffic was recorded on."""

from idm_sumo.roads.i80 import I80
from idm_sumo.roads.road import Road, SideLane
from idm_sumo.roads.us101 import US101

__all__ = ["BUILT_IN", "DEFAULT", "US101", "Road", "SideLane", "road_at"]

DEFAULT = US101  # of files that do not name their road
BUILT_IN = {road.name: road for road in (US101, I80)}


def road_at(location: str) -> Road:
    """Return the built-in road of a location.

    Parameters
    ----------
    location : str
        Name of a study area, as the data portal spells it, for example ``us-101``.

    Returns
    -------
    Road
        :data:`DEFAULT` for a location whose road is not built in.
    """
    return BUILT_IN.get(location.lower(), DEFAULT)
