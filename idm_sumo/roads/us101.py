"""US-101, the Hollywood Freeway in Los Angeles: the built-in road.

Source: FHWA (2007), US Highway 101 Dataset, FHWA-HRT-07-030: five main lanes of 12 ft over 2,100 ft;
the on-ramp at Ventura Boulevard joins at 578 ft, the off-ramp to Cahuenga Boulevard leaves at 1,276 ft,
and an auxiliary lane connects the two.
"""

from idm_sumo.roads.road import Road, SideLane
from idm_sumo.roads.units import FOOT, MILE_PER_HOUR

ON_RAMP, OFF_RAMP = 578 * FOOT, 1276 * FOOT

US101 = Road(
    name="us-101",
    widths=(12 * FOOT,) * 5,
    length=2100 * FOOT,
    speed_limit=55 * MILE_PER_HOUR,
    side_lanes=(
        SideLane(6, "auxiliary", start=ON_RAMP, end=OFF_RAMP, width=12 * FOOT),
        SideLane(7, "on-ramp", end=ON_RAMP, width=12 * FOOT),
        SideLane(8, "off-ramp", start=OFF_RAMP, width=12 * FOOT),
    ),
    car_length=15.5 * FOOT,  # median of the cars labelled in the data set
    car_width=6.4 * FOOT,
    network="us101.net.xml",
    edges=("upstream", "entry", "weave", "exit", "downstream", "outflow", "on_ramp", "off_ramp"),
    reach=(-300.0, 1140.08),
)
