r"""The speed of stop-and-go waves, which travel upstream.

A disturbance at :math:`x` reaches :math:`x - \Delta x` after :math:`\tau = \Delta x / w`. So the speeds at
two positions are most alike when the upstream one is read :math:`\tau` later. The lag of the largest
cross-correlation is found for several distances, and the wave speed is the robust (Theil-Sen) slope of
distance over lag. Sources: Zielke, Bertini and Treiber (2008), Empirical measurement of freeway
oscillation characteristics, Transportation Research Record 2088 (cross-correlation); Treiber and Kesting
(2013), chapter 18: about -15 to -20 km/h everywhere, -4 to -5.5 m/s.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy.ndimage import uniform_filter1d

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording

Floats = npt.NDArray[np.float64]

CELL_LENGTH = 20.0  # m
CELL_TIME = 1.0  # s
NEARLY_ALL = 0.8  # least share of a lane's times with known speeds everywhere
LONGEST_GAP = 15.0  # s, longest time over which empty cells are interpolated
SLOW = 180.0  # s; slower variations come from the demand, not from waves
DISTANCES = tuple(range(3, 16))  # cells, 60 to 300 m; at shorter distances one car is seen at both positions
SLOWEST_WAVE, FASTEST_WAVE = 2.0, 12.0  # m/s, the range that is searched
LEAST_CORRELATION = 0.15  # least correlation of the speeds at two positions with a common wave


def wave_speeds(recording: Recording) -> pd.DataFrame:
    """Return the speed of backward-moving waves by lane.

    Parameters
    ----------
    recording : Recording
        Recorded or simulated traffic.

    Returns
    -------
    pandas.DataFrame
        ``period, lane, wave_speed_m_s`` (negative: upstream) and ``correlation`` (mean over the distances at
        their best lags), by period and main lane. NaN where too few vehicles were recorded for a field of
        speeds, or no wave is found.
    """
    rows = []
    for period in recording.periods:
        table = recording.of_period(period).table
        for lane in range(1, recording.road.main_lanes + 1):
            field = speed_field(table[table[c.LANE] == lane], recording.road.length)
            speed, correlation = (np.nan, np.nan) if field is None else wave_of(field)
            rows.append((period, lane, speed, correlation))
    return pd.DataFrame(rows, columns=[c.PERIOD, c.LANE, "wave_speed_m_s", "correlation"])


def speed_field(table: pd.DataFrame, length: float) -> Floats | None:
    """Return one lane's mean speeds in space and time.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows of one lane and period.
    length : float
        Length of the section (m).

    Returns
    -------
    float64, shape (positions, times), or None
        Mean speed (m/s) in cells of 20 m and 1 s; None if there are too few vehicles.
    """
    positions = int(length // CELL_LENGTH)
    inside = table[table[c.X].between(0.0, positions * CELL_LENGTH, inclusive="left")]
    if inside.empty:
        return None
    place = (inside[c.X] // CELL_LENGTH).astype(np.int64).to_numpy()
    per_cell = round(CELL_TIME / FRAME_STEP)
    time = ((inside[c.FRAME] - inside[c.FRAME].min()) // per_cell).to_numpy()
    cell, shape = place * (time.max() + 1) + time, (positions, int(time.max()) + 1)
    count = np.bincount(cell, minlength=shape[0] * shape[1]).reshape(shape)
    total = np.bincount(cell, weights=inside[c.SPEED].to_numpy(), minlength=count.size).reshape(shape)
    field = pd.DataFrame(np.divide(total, count, out=np.full(shape, np.nan), where=count > 0))
    filled = field.interpolate(axis=1, limit=round(LONGEST_GAP / CELL_TIME), limit_direction="both").to_numpy()
    known = np.isfinite(filled).all(axis=0)  # without the ends of a recording, when the section fills and empties
    if known.mean() < NEARLY_ALL or known.sum() < 2 * SLOW / CELL_TIME:
        return None
    first, last = np.flatnonzero(known)[[0, -1]]
    whole = pd.DataFrame(filled[:, first : last + 1]).interpolate(axis=1, limit_direction="both")
    return np.asarray(whole.to_numpy())


def wave_of(field: Floats) -> tuple[float, float]:
    """Return the wave speed of a field of speeds.

    Parameters
    ----------
    field : float64, shape (positions, times)
        As :func:`speed_field` returns it.

    Returns
    -------
    speed : float
        Wave speed (m/s, negative); NaN where there is no wave.
    correlation : float
        Mean correlation; NaN where there is no wave.
    """
    from scipy.stats import theilslopes  # here: scipy.stats takes long to load

    deviation = field - uniform_filter1d(field, round(SLOW / CELL_TIME), axis=1, mode="nearest")
    lags, distances, heights = [], [], []
    for cells in DISTANCES:
        shortest = int(np.floor(cells * CELL_LENGTH / FASTEST_WAVE / CELL_TIME))
        longest = int(np.ceil(cells * CELL_LENGTH / SLOWEST_WAVE / CELL_TIME))
        curve = np.array([_correlation(deviation, cells, lag) for lag in range(shortest, longest + 1)])
        best = int(np.argmax(curve))
        if 0 < best < len(curve) - 1 and curve[best] >= LEAST_CORRELATION:
            lags.append((shortest + best + _vertex(curve[best - 1 : best + 2])) * CELL_TIME)
            distances.append(cells * CELL_LENGTH)
            heights.append(curve[best])
    if len(lags) < len(DISTANCES) // 2:
        return np.nan, np.nan
    # The fit is lag over distance, since distances are exact and lags are measured; then it is inverted.
    slope = float(theilslopes(lags, distances).slope)
    if not 1.0 / FASTEST_WAVE <= slope <= 1.0 / SLOWEST_WAVE:
        return np.nan, np.nan
    return -1.0 / slope, float(np.mean(heights))


def _correlation(deviation: Floats, cells: int, lag: int) -> float:
    """Return the correlation of speeds at a lag.

    The upstream position is ``cells`` away and read ``lag`` later; all positions are used.
    """
    times = deviation.shape[1] - lag
    downstream, upstream = deviation[cells:, :times], deviation[:-cells, lag:]
    scale = np.sqrt((downstream**2).sum() * (upstream**2).sum())
    return float((downstream * upstream).sum() / scale) if scale > 0 else 0.0


def _vertex(three: Floats) -> float:
    """Return the maximum of a parabola through three equidistant values.

    Counted from the middle value.
    """
    bend = three[0] - 2.0 * three[1] + three[2]
    return float(0.5 * (three[0] - three[2]) / bend) if bend < 0 else 0.0
