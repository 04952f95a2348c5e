"""Data of a time-space diagram that can be zoomed: every vehicle's path once a second."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.colors import to_hex

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording

from .embedded import embedded

EVERY = 10  # frames between two points of a path: a second, in which a vehicle covers a car length or a few
# Safe for colour-blind readers; the end that would vanish on the page is left out.
LIGHT_PAGE, DARK_PAGE = (
    [to_hex(colormaps["cividis"](share)) for share in np.linspace(*ends, 32)] for ends in ((0.0, 0.8), (0.35, 1.0))
)
SPEED_STEP = 5.0  # m/s, to which the fastest colour is rounded
FINEST, SPEED_UNIT = 0.1, 0.25  # m and m/s of one step of the stored numbers


@dataclass(frozen=True)
class Mark:
    """A place, a time or both that a picture frames; ``None`` where it has no bound."""

    label: str
    place: tuple[float | None, float | None] = (None, None)
    time: tuple[float | None, float | None] = (None, None)


def diagram(
    key: str, title: str, recording: Recording, period: str, *, fastest: float, marks: Sequence[Mark] = ()
) -> dict[str, Any]:
    """Return what ``page/time_space.html.j2`` shows of one period.

    Parameters
    ----------
    key : str
        Names the diagram within its page.
    title : str
    recording : Recording
    period : str
    fastest : float
        Speed at the end of the colours (m/s).
    marks : sequence of Mark
        Framed stretches, times in seconds since the period's first frame.

    Returns
    -------
    dict
        ``key, title, lanes, slowest, fastest, ramp, ramp_dark, data``.
    """
    table = recording.of_period(period).table
    begin = int(table[c.FRAME].min())
    low, high = float(table[c.X].min()), float(table[c.X].max())
    unit = max(FINEST, (high - low) / np.iinfo(np.uint16).max)
    kept = table[(table[c.FRAME] - begin) % EVERY == 0]
    vehicle, frame = kept[c.VEHICLE].to_numpy(), kept[c.FRAME].to_numpy()
    breaks = np.flatnonzero((np.diff(vehicle) != 0) | (np.diff(frame) != EVERY)) + 1
    first = np.concatenate([[0], breaks]) if len(kept) else np.array([], dtype=np.int64)
    data = {
        "from": 0.0, "to": round(float((table[c.FRAME].max() - begin) * c.FRAME_STEP), 1),
        "low": low, "high": max(high, low + 1.0), "step": EVERY * c.FRAME_STEP,
        "ids": vehicle[first].tolist(), "first": first.tolist(),
        "start": np.round((frame[first] - begin) * c.FRAME_STEP, 1).tolist(),
        "x": _packed((kept[c.X].to_numpy() - low) / unit, np.uint16), "x_unit": unit,
        "v": _packed(kept[c.SPEED].to_numpy() / SPEED_UNIT, np.uint8), "v_unit": SPEED_UNIT,
        "lanes": _packed(kept[c.LANE].to_numpy(), np.uint8),
        "colours": LIGHT_PAGE, "colours_dark": DARK_PAGE, "fastest": fastest,
        "marks": [{"label": mark.label, "place": mark.place, "time": mark.time} for mark in marks],
    }  # fmt: skip
    return {
        "key": key, "title": title, "lanes": sorted(int(lane) for lane in kept[c.LANE].unique()), "slowest": 0,
        "fastest": f"{fastest:g}", "ramp": ", ".join(LIGHT_PAGE[::4]),
        "ramp_dark": ", ".join(DARK_PAGE[::4]), "data": embedded(data),
    }  # fmt: skip


def diagrams_of(recordings: Mapping[str, Recording], *, marks: Sequence[Mark] = ()) -> list[dict[str, Any]]:
    """Return a diagram of the first period of each recording.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By the title of the diagram.
    marks : sequence of Mark
        Framed in each.

    Returns
    -------
    list of dict
        See :func:`diagram`; a page shows them with the same stretch of road and time.
    """
    fastest = colours_end(recordings.values())
    return [
        diagram(str(number), title, one, one.periods[0], fastest=fastest, marks=marks)
        for number, (title, one) in enumerate(recordings.items(), 1)
    ]


def colours_end(recordings: Iterable[Recording]) -> float:
    """Return the speed (m/s) at the end of the colours, the same for all: nearly the fastest, rounded up."""
    most = max(float(one.table[c.SPEED].quantile(0.99)) for one in recordings)
    return max(SPEED_STEP, SPEED_STEP * float(np.ceil(most / SPEED_STEP)))


def _packed(values: npt.ArrayLike, kind: type[np.uint8 | np.uint16]) -> str:
    """Return numbers as little-endian bytes in base64, clipped to what the kind holds."""
    bounds = np.iinfo(kind)
    whole = np.clip(np.rint(np.asarray(values, dtype=np.float64)), bounds.min, bounds.max)
    return base64.b64encode(whole.astype(np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")
