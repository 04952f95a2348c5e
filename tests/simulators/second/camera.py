"""What the camera writes: noisy positions in the raw NGSIM layout, in feet."""

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.signal import lfilter

from tests.simulators.second.road import DT

FOOT = 0.3048  # m
LANE_WIDTH = 12.0  # ft
CHANGE_FRAMES = 41  # frames that a lane change lasts to the side
SPEED_FRAMES = 5  # frames to each side over which positions are differentiated
CLIP = 11.2  # ft/s2, where NGSIM cuts accelerations
SHORTEST = 50  # frames; shorter tracks are left out
EPOCH_MS = 1118846980000  # 15 June 2005, 07:49:40 local time
NOISES = ("white", "ar1", "smoothed")


def noise_series(rng, noise, count):
    """Position error in m of one vehicle for `count` frames, stationary with the given standard deviation."""
    pad = 60
    white = rng.standard_normal(count + pad)
    if noise["kind"] == "ar1":
        keep = np.exp(-DT / noise["memory_s"])
        white = lfilter([np.sqrt(1.0 - keep * keep)], [1.0, -keep], white)
    elif noise["kind"] == "smoothed":
        width = noise["memory_s"] / DT
        white = gaussian_filter1d(white, width) * np.sqrt(2.0 * width * np.sqrt(np.pi))
    return noise["sigma_m"] * white[pad // 2 : pad // 2 + count]


def long_table(world, first, last, section):
    """Clean rows (frame, driver, lane, position in m) of the drivers in the section, vehicle by vehicle."""
    start, end = section
    x, lanes = world.xs[first:last], world.lanes[first:last]
    driver, frame = np.nonzero(((lanes > 0) & (x >= start) & (x < end)).T)
    rows = pd.DataFrame({"driver": driver, "frame": frame, "lane": lanes[frame, driver].astype(np.int64)})
    rows["y"], rows["v"] = x[frame, driver] - start, world.vs[first:last][frame, driver]
    return rows[rows.groupby("driver").frame.transform("size") >= SHORTEST].reset_index(drop=True)


def slope(series):
    """Return the derivative per second by differences over up to a second, one-sided at the ends of the track."""
    n = len(series)
    lo, hi = np.maximum(np.arange(n) - SPEED_FRAMES, 0), np.minimum(np.arange(n) + SPEED_FRAMES, n - 1)
    return (series[hi] - series[lo]) / ((hi - lo) * DT)


def measure(rng, rows, noise):
    """Add noisy position, speed and acceleration, and the position across, in feet."""
    parts = []
    for _, index in rows.groupby("driver").indices.items():
        y = (rows.y.to_numpy()[index] + noise_series(rng, noise, len(index))) / FOOT
        across = uniform_filter1d((rows.lane.to_numpy()[index] - 0.45) * LANE_WIDTH, CHANGE_FRAMES, mode="nearest")
        weave = 4.0 * gaussian_filter1d(rng.standard_normal(len(index)), 15.0, mode="nearest")
        weave += 0.6 * rng.standard_normal()
        v = slope(y)
        parts.append(pd.DataFrame({"Y": y, "X": across + weave, "V": np.abs(v), "A": slope(v)}, index=index))
    return rows.join(pd.concat(parts))


def link(rows):
    """Add the driver ahead and behind in the lane (0 for none) and the space headway in feet."""
    rows = rows.sort_values(["frame", "lane", "y"]).reset_index(drop=True)
    same = rows.frame.eq(rows.frame.shift(-1)) & rows.lane.eq(rows.lane.shift(-1))
    rows["ahead"] = rows.vehicle.shift(-1).where(same, 0).astype(np.int64)
    rows["space"] = (rows.Y.shift(-1) - rows.Y).where(same, 0.0)
    back = same.shift(1, fill_value=False)
    rows["behind"] = rows.vehicle.shift(1).where(back, 0).astype(np.int64)
    return rows.sort_values(["vehicle", "frame"]).reset_index(drop=True)


def film(world, rng, first, last, section, noise):
    """NGSIM table of the recording (18 columns, feet) and the clean rows it was made from."""
    clean = long_table(world, first, last, section)
    order = clean.groupby("driver").agg(frame=("frame", "min"), y=("y", "max")).sort_values(["frame", "y"])
    clean["vehicle"] = clean.driver.map(pd.Series(np.arange(1, len(order) + 1), order.index))
    rows = link(measure(rng, clean, noise))
    frame0, length = int(rng.integers(1, 400)), np.round(2.0 * world.length / FOOT) / 2.0
    frames = rows.frame + frame0
    x, y = rows.X.round(3), rows.Y.round(3)
    still = np.where(rows.V > 0.0, rows.space / rows.V.clip(lower=1e-3), 9999.99)
    table = pd.DataFrame({
        "Vehicle_ID": rows.vehicle, "Frame_ID": frames, "Total_Frames": rows.groupby("vehicle").frame.transform("size"),
        "Global_Time": EPOCH_MS + 100 * frames, "Local_X": x, "Local_Y": y,
        "Global_X": 6451000.0 + (y + x) / np.sqrt(2.0), "Global_Y": 1873300.0 - (y - x) / np.sqrt(2.0),
        "v_Length": length[rows.driver], "v_Width": np.choose(world.kind[rows.driver] - 1, (3.0, 6.5, 8.0)),
        "v_Class": world.kind[rows.driver], "v_Vel": rows.V, "v_Acc": rows.A.clip(-CLIP, CLIP), "Lane_ID": rows.lane,
        "Preceding": rows.ahead, "Following": rows.behind, "Space_Headway": rows.space,
        "Time_Headway": np.where(rows.ahead > 0, np.minimum(still, 9999.99), 0.0),
    })  # fmt: skip
    digits = dict.fromkeys(("v_Vel", "v_Acc", "Space_Headway", "Time_Headway"), 2) | {"Global_X": 3, "Global_Y": 3}
    return table.round(digits), clean
