"""I-80 in Emeryville: its lanes and section; there is no SUMO network of it.

Source: FHWA (2006), Interstate 80 Freeway Dataset, FHWA-HRT-06-137: six main lanes of 12 ft, lane 1 for
vehicles of high occupancy, over about 1,650 ft; the on-ramp at Powell Street (lane 7) joins within.
"""

from idm_sumo.roads.road import Road, SideLane
from idm_sumo.roads.units import FOOT, MILE_PER_HOUR

I80 = Road(
    name="i-80",
    widths=(12 * FOOT,) * 6,
    length=1650 * FOOT,
    speed_limit=65 * MILE_PER_HOUR,
    side_lanes=(SideLane(7, "on-ramp", end=700 * FOOT, width=12 * FOOT),),
    car_length=15.5 * FOOT,
    car_width=6.4 * FOOT,
)
