"""Free fields: what no effect of the catalogue is, along what a driver may answer, places, times, and what moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import edges_of
from idm_sumo.diagnosis.plan import (
    BLOCKS,
    FREE_BINS,
    MOST_BINS,
    MOVING,
    QUANTILES,
    SWING,
    WIDTH,
    Axis,
    Group,
    Plan,
    coarser,
    periods_of,
)
from idm_sumo.models.effects.form import POSITION, TIME, Moments
from idm_sumo.recordings.columns import FRAME_STEP, TRUCK

Floats = npt.NDArray[np.float64]

SPEEDS = tuple(
    sign * speed for sign in (-1.0, 1.0) for speed in (1.5, 2.5, 4.0, 6.0)
)  # m/s, of such bands; traffic itself is faster
WIDEST_BAND, MOST_BANDS = 40.0, 24  # m; bins of them
STRONGEST = 3.0  # m/s² (per s), of the model's own acceleration and its change

# What may be different in a free field: some acceleration is added, the time headway is longer, the response is stronger, or later.
ACCELERATION, HEADWAY, RESPONSE, DELAY = "acceleration", "headway", "response", "delay"
ALONG_COVARIATES, CHANGES = (ACCELERATION, HEADWAY), (RESPONSE, DELAY)
# Of a free field: its unit and typical size.
TYPICAL = {
    ACCELERATION: ("m/s^2", 0.2),
    HEADWAY: ("1", 0.25),
    RESPONSE: ("1", 0.4),
    DELAY: ("s", 0.6),
}


def free_groups(windows: w.Windows, plan: Plan, places: Floats, times: Floats) -> Iterator[Group]:
    """Yield free fields along covariates, places, times, and rectangles of both, in all lanes and in each."""
    known = covariates(windows.seen[:, :, w.LEAD : -1], None)
    for name, values in known.items():
        axis = _axis(name, values)
        if axis is not None:
            for content in ALONG_COVARIATES:
                yield Group("", content=content, axes=(axis,))
    xs, ts = coarser(places, BLOCKS), coarser(times, BLOCKS)
    place, several = Axis(POSITION, coarser(places, FREE_BINS)), periods_of(windows)
    for content in CHANGES:
        yield Group("", content=content, axes=(place,))
    for content in (ACCELERATION, *CHANGES):
        for period in range(several) if several > 1 else (-1,):
            here = _times_of(windows, period, times)
            time, block = Axis(TIME, coarser(here, FREE_BINS)), Axis(TIME, coarser(here, BLOCKS))
            yield Group("", content=content, axes=(time,), period=period)
            yield Group("", content=content, axes=(Axis(POSITION, xs), block), period=period)
    if len(plan.lanes) > 1 and several == 1:
        for lane in plan.lanes:
            yield Group("", content=ACCELERATION, axes=(Axis(TIME, coarser(times, FREE_BINS)),), lane=lane)
            yield Group("", content=ACCELERATION, axes=(Axis(POSITION, xs), Axis(TIME, ts)), lane=lane)
    if several == 1:
        yield from _moving(plan, places)
        yield Group(SWING)


def _moving(plan: Plan, places: Floats) -> Iterator[Group]:
    """Yield bands that move along the road, each named by where it is in the middle of the recording."""
    seconds = plan.span[1] - plan.span[0]
    for speed in SPEEDS:
        half = 0.5 * abs(speed) * seconds
        bands = edges_of(np.array([places[0] - half, places[-1] + half]), WIDEST_BAND, MOST_BANDS)
        if half > bands[1] - bands[0]:
            yield Group("", content=ACCELERATION, axes=(Axis(_band(speed), bands),))


def moving(position: Floats, time: Floats, span: tuple[float, float]) -> dict[str, Floats]:
    """Return, by the axis of each speed, where the band is in the middle of the recording that passes a place at a time."""
    middle = 0.5 * (span[0] + span[1])
    return {_band(speed): position - speed * (time - middle) for speed in SPEEDS}


def _band(speed: float) -> str:
    """Return the name of the axis of bands of a speed."""
    return f"{MOVING}{speed:g} m/s"


def _times_of(windows: w.Windows, period: int, times: Floats) -> Floats:
    """Return the edges of times within one period, or all."""
    if period < 0:
        return times
    mine = np.unique(windows.period, return_inverse=True)[1][windows.driver] == period
    return edges_of(windows.seen[mine][:, w.TIME, w.LEAD : -1], WIDTH[TIME], MOST_BINS)


def _axis(name: str, values: Floats) -> Axis | None:
    """Return bins of a covariate: quantiles of what is known, or one bin of what is either there or not."""
    known = values[np.isfinite(values) & (np.abs(values) < 1e5)]
    if not len(known):
        return None
    distinct = np.unique(known[:: max(1, len(known) // 20_000)])
    if len(distinct) <= QUANTILES:
        edges = np.unique(np.concatenate([distinct[distinct > 0.0] - 0.5, [distinct.max() + 0.5]]))
        return Axis(name, edges) if (known > 0.0).any() and len(edges) > 1 else None
    edges = np.unique(np.quantile(known, np.linspace(0.0, 1.0, QUANTILES + 1)))
    return Axis(name, edges + np.concatenate([np.zeros(len(edges) - 1), [1e-9]])) if len(edges) > 2 else None


def content_of(content: str, see: Moments) -> Floats:
    """Return the acceleration that a little of a content is, in every frame."""
    if content == ACCELERATION:
        return np.ones_like(see.speed)
    if content == HEADWAY:
        return see.by_headway
    if content == RESPONSE:
        return np.clip(see.acceleration, -STRONGEST, STRONGEST)
    return -np.clip(np.gradient(see.acceleration, FRAME_STEP, axis=1), -STRONGEST, STRONGEST)


def covariates(seen: Floats, state: Floats | None) -> dict[str, Floats]:
    """Return what a driver may answer beside its leader, by frame; SI units, NaN or far away where unknown."""
    x = seen[:, w.X] if state is None else state[:, :, ro.BASE_X]
    v = seen[:, w.V] if state is None else state[:, :, ro.BASE_V]
    second = np.isfinite(seen[:, w.SECOND])
    known = {
        "rear_gap": np.where(np.isfinite(seen[:, w.BEHIND]), x - seen[:, w.BEHIND], np.nan),
        "leader_gap": np.where(second, seen[:, w.SECOND] - seen[:, w.REAR], np.nan),
        "adjacent_difference": v - seen[:, w.ADJACENT],
        "faster_difference": v - seen[:, w.FASTER],
        "truck_behind": (seen[:, w.BEHIND_KIND] == TRUCK).astype(np.float64),
        "truck_second": (seen[:, w.SECOND_KIND] == TRUCK).astype(np.float64),
    }
    return known | {name: seen[:, column] for name, column in SEEN.items()}


SEEN = {
    "since_change": w.SINCE, "until_own_change": w.UNTIL_OWN, "until_cut_in": w.UNTIL_CUT_IN,
    "leader_acceleration": w.ACCELERATION, "trucks_beside": w.TRUCKS_BESIDE, "braking_beside": w.BRAKING_BESIDE,
    "crowd_left": w.CROWD_LEFT, "crowd_right": w.CROWD_RIGHT, "abreast": w.ABREAST, "beside_gap": w.BESIDE_GAP,
    "nearest_beside": w.NEAREST_BESIDE, "motorcycles_beside": w.MOTORCYCLES, "leader_length": w.LENGTH,
    "since_standing": w.SINCE_STANDING, "since_braking": w.SINCE_BRAKING, "since_entry": w.SINCE_ENTRY, "unrest": w.UNREST,
}  # fmt: skip
