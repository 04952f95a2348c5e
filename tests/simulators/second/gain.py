"""What a hidden effect is worth to true drivers, each fitted to what was filmed."""

import math
from typing import Any

import numpy as np
from numba import njit
from scipy.optimize import minimize
from scipy.signal import savgol_filter

from tests.simulators.second import view as w
from tests.simulators.second.camera import noise_series
from tests.simulators.second.laws import LAWS
from tests.simulators.second.respond import ALL, possible, wish
from tests.simulators.second.road import DT

WINDOW = 120  # frames driven from a filmed state
DRIVERS = 80  # of more than these, some are chosen evenly
SMOOTHED = 21  # frames over which the film is smoothed by parabolas
WIDTH = 0.35  # of the first simplex, in logarithms of the five parameters
TRIES = 2  # searches, each from where the last one ended
BOUNDS = [(-4.0, 6.0)] * 5  # of the same logarithms
NOBODY = -2  # as the effect left out: all of them


def worth(got: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the mean position error (m) over drivers in windows of 12 s.

    Nothing hidden, everything, and of several effects without each in turn.

    In all of them each driver has the parameters that are best then. Paths of drivers and leaders are as filmed and
    smoothed, because what noise hides cannot be gained; `seed` draws the noise.
    """
    world, rng = got["world"], np.random.default_rng(seed)
    hidden, law = w.rows_of(got["hidden"]), LAWS.index(got["scene"]["law"])
    errors = []
    for driver, see, starts in some_tracks(got["memory"]):
        lag = round(world.lag[driver] / DT)
        film = as_filmed(see, lag, rng, got["scene"]["noise"])
        given = (film, film[:, w.X].copy(), starts, law, hidden, world.touched[driver], lag)
        errors.append(best_errors(world.theta[driver], given))
    base, extended, *without = np.mean(errors, axis=0).tolist()
    return {"base": base, "extended": extended, "without": without, "drivers": len(errors)}


def some_tracks(memory):
    """Per driver with a window behind a leader: number, views, and the windows' first frames."""
    memory, tracks = memory[np.lexsort((memory[:, 1], memory[:, 0]))], []
    for rows in np.split(memory, np.flatnonzero(np.diff(memory[:, 0])) + 1):
        see = rows[:, 2:]
        if len(starts := windows(rows[:, 1], see[:, w.S] < w.NONE_AHEAD)):
            tracks.append((int(rows[0, 0]), see, starts))
    return tracks[:: -(-len(tracks) // DRIVERS)]


def windows(step, led):
    """First frames of the windows, one after the other, that have a leader at every frame."""
    starts, k = [], 0
    whole = led & (np.diff(step, prepend=step[0] - 1) == 1)
    while k + WINDOW < len(step):
        gone = np.flatnonzero(~whole[k : k + WINDOW + 1])
        if len(gone):
            k += int(gone[-1]) + 1
        else:
            starts.append(k)
            k += WINDOW
    return np.array(starts, np.int64)


def as_filmed(see, lag, rng, noise):
    """Return views with what smoothing leaves of the noise in own and leader's position and speed.

    A speed beside of nobody is NaN.
    """
    film, (place, speed), (ahead, leaders) = see.copy(), *(left_over(rng, noise, len(see)) for _ in range(2))
    then = np.maximum(np.arange(len(see)) - lag, 0)
    for column in (w.SLOWER, w.FASTER):
        film[see[:, column] == see[:, w.V], column] = np.nan
    film[:, w.X] += place
    film[:, w.REAR] += place
    film[:, w.S] += ahead - place
    film[:, w.S_LAG] += ahead[then] - place[then]
    for column, error in ((w.V, speed), (w.V_LAG, speed[then]), (w.VL, leaders), (w.VL_LAG, leaders[then])):
        film[:, column] = np.maximum(0.0, film[:, column] + error)
    return film


def left_over(rng, noise, count):
    """Errors of position in m and speed in m/s after smoothing."""
    raw = noise_series(rng, noise, max(count, SMOOTHED))
    return [savgol_filter(raw, SMOOTHED, 2, deriv=order, delta=DT)[:count] for order in (0, 1)]


def best_errors(theta, given):
    """Least errors of one driver: nothing hidden, everything, and, of several effects, without each in turn."""
    several = len(given[4]) > 1
    left_out = [NOBODY, ALL, *range(len(given[4]) if several else 0)]
    found = [search(np.log(theta), out, given) for out in left_out]
    # What is best for one of them may be a good beginning for another, whose own search had ended early.
    crossed = [min((search(x, out, given, tries=1) for x, _ in found), key=lambda one: one[1]) for out in left_out]
    return [error for _, error in crossed]


def search(begin, out, given, tries=TRIES):
    """Logarithms of the best parameters and their error, by simplexes from `begin`."""

    def error(x):
        return driver_error(np.exp(x), out, *given)

    for _ in range(tries):
        simplex = np.vstack([begin, begin + WIDTH * np.eye(len(begin))])
        options = {"initial_simplex": simplex, "maxfev": 250, "xatol": 0.01, "fatol": 1e-3}
        best = minimize(error, begin, method="Nelder-Mead", bounds=BOUNDS, options=options)
        begin = best.x
    return best.x, best.fun


@njit(cache=True)
def driver_error(theta, out, see, here, starts, law, hidden, touched, lag):
    """Mean error in m over a driver's windows, with all effects but number `out`."""
    if out == NOBODY:
        touched = np.zeros_like(touched)
    total = 0.0
    for start in starts:
        total += window_error(theta, out, see, here, start, law, hidden, touched, lag)
    return total / len(starts)


@njit(cache=True)
def window_error(theta, out, see, here, start, law, hidden, touched, lag):
    """Mean absolute error in m of the positions of one window that is driven from the filmed state."""
    xs, vs = np.empty(WINDOW + 1), np.empty(WINDOW + 1)
    xs[0], vs[0] = here[start], see[start, w.V]
    total = 0.0
    for n in range(WINDOW):
        now = seen_from(see, start + n, xs[n], vs[n])
        if n >= lag:
            now[w.S_LAG] += here[start + n - lag] - xs[n - lag]
            now[w.V_LAG] = vs[n - lag]
        acc = possible(wish(law, now, theta, hidden, touched, out), now)
        vs[n + 1] = max(0.0, vs[n] + acc * DT)
        xs[n + 1] = xs[n] + 0.5 * (vs[n] + vs[n + 1]) * DT
        total += abs(xs[n + 1] - here[start + n + 1])
    return total / WINDOW


@njit(cache=True)
def seen_from(see, k, x, v):
    """View of frame `k` from another position (m) and speed (m/s) than the driver had."""
    now, further = see[k].copy(), x - see[k, w.X]
    now[w.X] = x
    now[w.S] -= further
    now[w.REAR] += further
    now[w.SIDE] -= further
    for column in (w.SLOWER, w.FASTER):
        if math.isnan(now[column]):
            now[column] = v
    now[w.V] = v
    return now
