"""The damped Gauss-Newton step inside the bounds.

For several parameter sets side by side.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.calibration.coordinates import LOWER, PARAMETERS, UPPER
from idm_sumo.calibration.lanes import LANES, PAIRS

Floats = npt.NDArray[np.float64]

L = LANES
LEAST_SCALE = 1e-3  # of the largest diagonal element: damps what the window says nothing of
TINY = 1e-12

# Rows, as in idm_sumo.calibration.lanes: the matrix (lower triangle, row by row), gradient, where the
# step starts, its damping; where it ends; which coordinates are free (1 or 0) and how far the others move.
MATRIX, GRADIENT, AT, DAMPING = 0, PAIRS * L, (PAIRS + 5) * L, (PAIRS + 10) * L
THERE, FREE, FIXED, HIT = (PAIRS + 11) * L, (PAIRS + 16) * L, (PAIRS + 21) * L, (PAIRS + 26) * L
STEPS = (PAIRS + 27) * L

LOW_0, LOW_1, LOW_2, LOW_3, LOW_4 = LOWER.tolist()
TOP_0, TOP_1, TOP_2, TOP_3, TOP_4 = UPPER.tolist()


@njit(cache=True, error_model="numpy")
def step_lanes(s):  # type: ignore[no-untyped-def]
    """Fill ``THERE``, the ends of every lane's step.

    Coordinates at a bound towards which the descent points stay there; those that the step
    takes over a bound are put on it and the others are solved again (Bertsekas, 1982).

    Parameters
    ----------
    s : float64, shape (STEPS,)
        Matrices, gradients, starts and dampings; the rest is changed.
    """
    for j in range(L):
        for m in range(PARAMETERS):
            at, uphill = s[AT + m * L + j], s[GRADIENT + m * L + j]
            outwards = (at <= LOWER[m] and uphill > 0.0) or (at >= UPPER[m] and uphill < 0.0)
            s[FREE + m * L + j], s[FIXED + m * L + j] = 0.0 if outwards else 1.0, 0.0
    for _ in range(PARAMETERS):
        solve_free(s)
        hits = 0.0
        for j in range(L):
            hits += s[HIT + j]
        if not hits > 0.0:
            break


def steps_from(z: Floats, gradient: Floats, normal: Floats, dampings: Floats) -> Floats:
    """Return the ends of steps with several dampings.

    Parameters
    ----------
    z : float64, shape (5,)
        Where they start, in search coordinates.
    gradient : float64, shape (5,)
    normal : float64, shape (5, 5)
    dampings : float64, shape (LANES,)

    Returns
    -------
    float64, shape (LANES, 5)
    """
    rows = np.zeros((STEPS // L, L))
    triangle = normal[np.tril_indices(PARAMETERS)]
    rows[: DAMPING // L] = np.concatenate([triangle, gradient, z])[:, None]
    rows[DAMPING // L] = dampings
    step_lanes(rows.reshape(-1))
    return np.ascontiguousarray(rows[THERE // L : THERE // L + PARAMETERS].T)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def solve_free(s):  # type: ignore[no-untyped-def]
    r"""Solve every lane's system for its free coordinates.

    By :math:`LDL^\top`, written out so that the lanes fill vectors. A coordinate that is not
    free has a row of the identity and its known move for a right side. Coordinates that hit a bound
    are free no more.

    Parameters
    ----------
    s : float64, shape (STEPS,)
        As for :func:`step_lanes`, changed.
    """
    for j in range(L):
        m00, m10, m11, m20, m21 = s[j], s[L + j], s[2 * L + j], s[3 * L + j], s[4 * L + j]
        m22, m30, m31, m32, m33 = s[5 * L + j], s[6 * L + j], s[7 * L + j], s[8 * L + j], s[9 * L + j]
        m40, m41, m42, m43, m44 = s[10 * L + j], s[11 * L + j], s[12 * L + j], s[13 * L + j], s[14 * L + j]
        f0, f1, f2, f3, f4 = s[FREE + j], s[FREE + L + j], s[FREE + 2 * L + j], s[FREE + 3 * L + j], s[FREE + 4 * L + j]
        x0, x1, x2 = s[FIXED + j], s[FIXED + L + j], s[FIXED + 2 * L + j]
        x3, x4 = s[FIXED + 3 * L + j], s[FIXED + 4 * L + j]
        damping, least = s[DAMPING + j], LEAST_SCALE * max(max(max(m00, m11), max(m22, m33)), m44)
        r0 = x0 - f0 * (s[GRADIENT + j] + m10 * x1 + m20 * x2 + m30 * x3 + m40 * x4)
        r1 = x1 - f1 * (s[GRADIENT + L + j] + m10 * x0 + m21 * x2 + m31 * x3 + m41 * x4)
        r2 = x2 - f2 * (s[GRADIENT + 2 * L + j] + m20 * x0 + m21 * x1 + m32 * x3 + m42 * x4)
        r3 = x3 - f3 * (s[GRADIENT + 3 * L + j] + m30 * x0 + m31 * x1 + m32 * x2 + m43 * x4)
        r4 = x4 - f4 * (s[GRADIENT + 4 * L + j] + m40 * x0 + m41 * x1 + m42 * x2 + m43 * x3)
        a00 = 1.0 + f0 * (m00 + damping * (m00 + least) + TINY - 1.0)
        a11 = 1.0 + f1 * (m11 + damping * (m11 + least) + TINY - 1.0)
        a22 = 1.0 + f2 * (m22 + damping * (m22 + least) + TINY - 1.0)
        a33 = 1.0 + f3 * (m33 + damping * (m33 + least) + TINY - 1.0)
        a44 = 1.0 + f4 * (m44 + damping * (m44 + least) + TINY - 1.0)
        a10, a20, a30, a40 = m10 * f1 * f0, m20 * f2 * f0, m30 * f3 * f0, m40 * f4 * f0
        a21, a31, a41, a32, a42, a43 = (
            m21 * f2 * f1,
            m31 * f3 * f1,
            m41 * f4 * f1,
            m32 * f3 * f2,
            m42 * f4 * f2,
            m43 * f4 * f3,
        )
        i0 = 1.0 / a00
        l10, l20, l30, l40 = a10 * i0, a20 * i0, a30 * i0, a40 * i0
        i1 = 1.0 / (a11 - l10 * a10)
        u21, u31, u41 = a21 - l20 * a10, a31 - l30 * a10, a41 - l40 * a10
        l21, l31, l41 = u21 * i1, u31 * i1, u41 * i1
        i2 = 1.0 / (a22 - l20 * a20 - l21 * u21)
        u32, u42 = a32 - l30 * a20 - l31 * u21, a42 - l40 * a20 - l41 * u21
        l32, l42 = u32 * i2, u42 * i2
        i3 = 1.0 / (a33 - l30 * a30 - l31 * u31 - l32 * u32)
        u43 = a43 - l40 * a30 - l41 * u31 - l42 * u32
        l43 = u43 * i3
        i4 = 1.0 / (a44 - l40 * a40 - l41 * u41 - l42 * u42 - l43 * u43)
        y1 = r1 - l10 * r0
        y2 = r2 - l20 * r0 - l21 * y1
        y3 = r3 - l30 * r0 - l31 * y1 - l32 * y2
        y4 = r4 - l40 * r0 - l41 * y1 - l42 * y2 - l43 * y3
        q4 = y4 * i4
        q3 = y3 * i3 - l43 * q4
        q2 = y2 * i2 - l32 * q3 - l42 * q4
        q1 = y1 * i1 - l21 * q2 - l31 * q3 - l41 * q4
        q0 = r0 * i0 - l10 * q1 - l20 * q2 - l30 * q3 - l40 * q4
        z0, z1, z2, z3, z4 = s[AT + j], s[AT + L + j], s[AT + 2 * L + j], s[AT + 3 * L + j], s[AT + 4 * L + j]
        t0, t1, t2, t3, t4 = z0 + q0, z1 + q1, z2 + q2, z3 + q3, z4 + q4
        c0, c1 = min(max(t0, LOW_0), TOP_0), min(max(t1, LOW_1), TOP_1)
        c2, c3, c4 = min(max(t2, LOW_2), TOP_2), min(max(t3, LOW_3), TOP_3), min(max(t4, LOW_4), TOP_4)
        b0, b1, b2 = f0 if c0 != t0 else 0.0, f1 if c1 != t1 else 0.0, f2 if c2 != t2 else 0.0
        b3, b4 = f3 if c3 != t3 else 0.0, f4 if c4 != t4 else 0.0
        s[THERE + j], s[THERE + L + j], s[THERE + 2 * L + j], s[THERE + 3 * L + j], s[THERE + 4 * L + j] = (
            c0,
            c1,
            c2,
            c3,
            c4,
        )
        s[FREE + j], s[FREE + L + j], s[FREE + 2 * L + j] = f0 - b0, f1 - b1, f2 - b2
        s[FREE + 3 * L + j], s[FREE + 4 * L + j] = f3 - b3, f4 - b4
        s[FIXED + j], s[FIXED + L + j] = x0 + b0 * (c0 - z0), x1 + b1 * (c1 - z1)
        s[FIXED + 2 * L + j], s[FIXED + 3 * L + j] = x2 + b2 * (c2 - z2), x3 + b3 * (c3 - z3)
        s[FIXED + 4 * L + j] = x4 + b4 * (c4 - z4)
        s[HIT + j] = b0 + b1 + b2 + b3 + b4
