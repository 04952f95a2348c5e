"""Whether a simulated recording is sound traffic, and its summary."""

import numpy as np

from tests.simulators.second.road import DT

SPEEDS = (4.7, 19.0)  # m/s, mean speeds that are accepted
CHANGES = (0.2, 0.75)  # lane changes per vehicle that are aimed at
FEWEST_CHANGES = 0.1  # lane changes per vehicle below which another scene is drawn
MOST_VEHICLES = 720
HARD_SHARE, LATE_SHARE = 0.003, 0.01  # of the moments may be braking harder than 4 m/s2; where drivers are late


def true_gaps(got):
    """Gaps in m between the vehicles of a lane at all moments of the recording, from the clean positions."""
    rows = got["clean"].sort_values(["frame", "lane", "y"])
    same = rows.frame.eq(rows.frame.shift(-1)) & rows.lane.eq(rows.lane.shift(-1))
    length = got["world"].length[rows.driver]
    rear = rows.y.to_numpy() - length
    return (np.r_[rear[1:], 0.0] - rows.y.to_numpy())[same.to_numpy()]


def true_accelerations(got):
    """Accelerations in m/s2 from the clean speeds, frame by frame."""
    rows = got["clean"].sort_values(["driver", "frame"])
    same = rows.driver.eq(rows.driver.shift(-1)).to_numpy()
    return (np.diff(rows.v.to_numpy(), append=0.0) / DT)[same]


def summary(got):
    """Figures of a recording for its truth file."""
    clean, scene = got["clean"], got["scene"]
    changes = (clean.groupby("driver").lane.diff().fillna(0) != 0).sum()
    gaps, accelerations = true_gaps(got), true_accelerations(got)
    return {
        "vehicles": int(clean.driver.nunique()), "seconds": scene["seconds"], "lanes": scene["lanes"],
        "section_m": scene["section_m"], "mean_speed": round(float(clean.v.mean()), 2),
        "speed_spread": round(float(clean.v.std()), 2), "standing_share": round(float((clean.v < 0.5).mean()), 4),
        "lane_changes_per_vehicle": round(float(changes / clean.driver.nunique()), 3),
        "smallest_gap_m": round(float(gaps.min()), 2),
        "acceleration_range": [round(float(accelerations.min()), 2), round(float(accelerations.max()), 2)],
        "acceleration_sd": round(float(accelerations.std()), 3),
        "share_below_minus_4": round(float((accelerations < -4.0).mean()), 5),
    }  # fmt: skip


def faults(got):
    """Return what is wrong with a recording, in words; empty if nothing is."""
    found = summary(got)
    wrong = []
    if found["smallest_gap_m"] <= 0.0:
        wrong.append(f"gap of {found['smallest_gap_m']} m")
    if max(map(abs, found["acceleration_range"])) > 6.0:
        wrong.append(f"accelerations of {found['acceleration_range']} m/s2")
    if not SPEEDS[0] <= found["mean_speed"] <= SPEEDS[1]:
        wrong.append(f"mean speed of {found['mean_speed']} m/s")
    if found["share_below_minus_4"] > (LATE_SHARE if got["late"] else HARD_SHARE):
        wrong.append("too much hard braking")
    if found["vehicles"] > MOST_VEHICLES:
        wrong.append(f"{found['vehicles']} vehicles")
    return wrong


def eagerness_missing(got):
    """Change in m/s2 of the braking accepted at lane changes that brings their number nearer to its range."""
    rate = summary(got)["lane_changes_per_vehicle"]
    if CHANGES[0] <= rate <= CHANGES[1]:
        return 0.0
    return 1.0 if rate < CHANGES[0] else -1.0
