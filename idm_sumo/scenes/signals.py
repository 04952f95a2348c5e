"""Where drivers stand or brake for a traffic light.

There they follow nobody.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.leaders import row_ahead
from idm_sumo.recordings.recording import Recording

STANDS = 0.5  # m/s, below which a vehicle stands
BRAKES = -1.0  # m/s², stronger than letting off the pedal
NEAR, HEADWAY = 20.0, 3.0  # m and s: nobody brakes for a leader that is farther ahead than both together

Integers = npt.NDArray[np.int64]


def for_a_light(recording: Recording) -> npt.NDArray[np.bool_]:
    """Return which rows stand or brake without a leader near.

    Shape ``(rows,)``.

    Parameters
    ----------
    recording : Recording
    """
    table = recording.table
    ahead = row_ahead(table)
    front, length = table[c.X].to_numpy(), table[c.LENGTH].fillna(recording.road.car_length).to_numpy()
    gap = np.where(ahead >= 0, front[ahead] - length[ahead] - front, np.inf)
    speed = table[c.SPEED].to_numpy()
    stops = (speed < STANDS) | (table[c.ACCELERATION].to_numpy() < BRAKES)
    return np.asarray(stops & (gap > NEAR + HEADWAY * speed))


def following(recording: Recording, first: Integers, rows: Integers, frames: int) -> tuple[Integers, Integers]:
    """Leave out rows that stand or brake for a light.

    Return runs of rows without those that stand or brake for a light.

    Parameters
    ----------
    recording : Recording
    first, rows : int64, shape (runs,)
        First row and number of rows of each vehicle's run.
    frames : int
        Of a window.

    Returns
    -------
    first, rows : int64, shape (runs,)
        The longest part of each run without such rows, from the first one that is long enough.
    """
    light = for_a_light(recording)
    out_first, out_rows = first.copy(), rows.copy()
    for place, (begin, count) in enumerate(zip(first.tolist(), rows.tolist(), strict=True)):
        stops = np.flatnonzero(light[begin : begin + count])
        starts, ends = np.concatenate([[0], stops + 1]), np.append(stops, count)
        lengths = ends - starts
        enough = np.flatnonzero(lengths >= frames)
        best = int(enough[0]) if len(enough) else int(np.argmax(lengths))
        out_first[place], out_rows[place] = begin + starts[best], lengths[best]
    return out_first, out_rows
