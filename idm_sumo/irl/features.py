"""Features of the reward: smooth functions of state and controls.

The paper names five: distance to the middle of the lane, distance to the boundaries of the
road, forward speed, heading along the road, and the collision risk of the ellipsoidal Gaussian.
It gives no formulas. The formulas here have no unit, a size of about 1 where they matter, and
second derivatives, since the likelihood of a demonstration needs gradient and Hessian. Two more
features charge the effort of acceleration and steering. Without them the likelihood does not
exist: the last acceleration moves nothing within the horizon, and the exponential of a reward
that does not depend on it has no integral.

Every function returns its value followed by its first and second derivatives, so that the
environment and the inverse control share one formula. The state is that of the vehicle's
middle: ``x, y`` (m), heading ``psi`` (rad, 0 along the road) and speed ``v`` (m/s).
"""

from __future__ import annotations

from math import cos, exp, sin

import numpy as np
from numba import njit

from idm_sumo.evaluation.collisions import first_row_from
from idm_sumo.evaluation.risk import risk_derivatives
from idm_sumo.irl.ground import Ground

LANE, BOUNDARY, SPEED, HEADING, COLLISION, ACCELERATION, STEERING = range(7)
NAMES = ("lane", "boundary", "speed", "heading", "collision", "acceleration", "steering")
COUNT = len(NAMES)
STATE_FEATURES = 5  # the first ones depend on the state, the others on the controls

LANE_SPREAD = 0.25  # lane widths, standard deviation of the bump over a lane's middle
BOUNDARY_DECAY = 1.0  # m, within which the nearness of the road's edge falls to 1/e
HEADING_SCALE = 0.05  # rad, a quick lane change
ACCELERATION_SCALE = 1.0  # m/s^2
STEERING_SCALE = 0.01  # rad, a lateral acceleration of 0.9 m/s^2 at 16 m/s
VIEW = 60.0  # m, beyond it a risk is below 1e-12 of the full one for all but the longest trucks


@njit(cache=True)
def lane_middle(y: float, ground: Ground) -> tuple[float, float, float]:
    r"""Return the nearness to the middle of a lane.

    .. math:: \sum_i e^{-(y - y_i)^2 / 2 s^2}

    Parameters
    ----------
    y : float
        Lateral position (m).
    ground : Ground
        The road.

    Returns
    -------
    value, first, second : float
        Feature, 1 on a middle, and its derivatives by ``y``.
    """
    value = first = second = 0.0
    for lane in range(len(ground.middles)):
        spread = LANE_SPREAD * ground.widths[lane]
        z = (y - ground.middles[lane]) / spread
        bump = exp(-0.5 * z * z)
        value += bump
        first -= bump * z / spread
        second += bump * (z * z - 1.0) / spread**2
    return value, first, second


@njit(cache=True)
def boundaries(y: float, ground: Ground) -> tuple[float, float, float]:
    """Return minus the nearness to the road's edges.

    .. math:: -e^{y/s} - e^{-(y + w)/s}

    Parameters
    ----------
    y : float
        Lateral position (m).
    ground : Ground
        The road.

    Returns
    -------
    value, first, second : float
        Feature, -1 on an edge and less beyond, and its derivatives by ``y``.
    """
    left, right = exp(y / BOUNDARY_DECAY), exp(-(y + ground.width) / BOUNDARY_DECAY)
    return -left - right, (right - left) / BOUNDARY_DECAY, -(left + right) / BOUNDARY_DECAY**2


@njit(cache=True)
def forward_speed(v: float, psi: float, speed_limit: float) -> tuple[float, float, float, float, float]:
    r"""Return the speed along the road, over the limit.

    .. math:: v\cos\psi/v_0

    Parameters
    ----------
    v, psi : float
        Speed (m/s) and heading (rad).
    speed_limit : float
        m/s.

    Returns
    -------
    value : float
        Feature, 1 at the speed limit :math:`v_0`.
    v, psi, v_psi, psi_psi : float
        Its derivatives.
    """
    c, s = cos(psi) / speed_limit, sin(psi) / speed_limit
    return v * c, c, -v * s, -s, -v * c


@njit(cache=True)
def along_road(psi: float) -> tuple[float, float, float]:
    r"""Return minus the deviation from the road's direction.

    .. math:: (\cos\psi - 1)/s^2 \approx -\psi^2/2s^2

    Parameters
    ----------
    psi : float
        Heading (rad).

    Returns
    -------
    value, first, second : float
        Feature and its derivatives by ``psi``.
    """
    weight = 1.0 / HEADING_SCALE**2
    return weight * (cos(psi) - 1.0), -weight * sin(psi), -weight * cos(psi)


@njit(cache=True)
def effort(u: float, scale: float) -> tuple[float, float, float]:
    r"""Return minus the effort of a control.

    .. math:: -\tfrac12 (u/s)^2

    Parameters
    ----------
    u, scale : float
        Control and its scale, in the same unit.

    Returns
    -------
    value, first, second : float
        Feature and its derivatives by ``u``.
    """
    return -0.5 * (u / scale) ** 2, -u / scale**2, -1.0 / scale**2


@njit(cache=True)
def collision(x, y, psi, length, width, cell, stride, lanes, own, around):  # type: ignore[no-untyped-def]
    """Return minus the collision risk of all vehicles in view.

    The risks are added and divided by that of two cars in the same place.

    Parameters
    ----------
    x, y, psi : float
        Middle of the vehicle (m) and heading (rad).
    length, width : float
        Its size (m).
    cell, stride, lanes : int
        Cell of the leftmost lane at this frame, distance to the next lane's cell, number of lanes.
    own : int
        Number of the recorded vehicle, which is left out.
    around : Surroundings
        Traffic.

    Returns
    -------
    value : float
        Feature.
    x, y, psi : float
        First derivatives.
    xx, xy, xpsi, yy, ypsi, psipsi : float
        Second derivatives.
    """
    total = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for lane in range(lanes):
        here = cell + lane * stride
        row, end = around.offsets[here], around.offsets[here + 1]
        row = first_row_from(around.front, row, end, x - VIEW)
        while row < end and around.front[row] < x + VIEW + around.reach:
            if around.vehicle[row] != own:
                r = risk_derivatives(
                    x - around.x[row], y - around.y[row], psi, length, width,
                    around.heading[row], around.length[row], around.width[row],
                )  # fmt: skip
                total = (
                    total[0] + r[0], total[1] + r[1], total[2] + r[2], total[3] + r[3], total[4] + r[4],
                    total[5] + r[5], total[6] + r[6], total[7] + r[7], total[8] + r[8], total[9] + r[9],
                )  # fmt: skip
            row += 1
    f = -1.0 / around.ground.full_risk
    return (
        f * total[0], f * total[1], f * total[2], f * total[3], f * total[4],
        f * total[5], f * total[6], f * total[7], f * total[8], f * total[9],
    )  # fmt: skip


@njit(cache=True)
def values(x, y, psi, v, acceleration, steering, length, width, cell, stride, lanes, own, around, out):  # type: ignore[no-untyped-def]
    """Write all features of a state and its controls.

    Parameters
    ----------
    x, y, psi, v : float
        State of the vehicle's middle.
    acceleration, steering : float
        Controls that led to it (m/s², rad).
    length, width, cell, stride, lanes, own, around
        As in :func:`collision`.
    out : float64, shape (features,)
        Written.
    """
    out[LANE] = lane_middle(y, around.ground)[0]
    out[BOUNDARY] = boundaries(y, around.ground)[0]
    out[SPEED] = forward_speed(v, psi, around.ground.speed_limit)[0]
    out[HEADING] = along_road(psi)[0]
    out[COLLISION] = collision(x, y, psi, length, width, cell, stride, lanes, own, around)[0]
    out[ACCELERATION] = effort(acceleration, ACCELERATION_SCALE)[0]
    out[STEERING] = effort(steering, STEERING_SCALE)[0]


@njit(cache=True)
def state_derivatives(x, y, psi, v, length, width, cell, stride, lanes, own, around, gradient, hessian):  # type: ignore[no-untyped-def]
    """Write the derivatives of the state features.

    Parameters
    ----------
    x, y, psi, v : float
        State of the vehicle's middle.
    length, width, cell, stride, lanes, own, around
        As in :func:`collision`.
    gradient : float64, shape (STATE_FEATURES, 4)
        Written: derivatives by ``x, y, psi, v``.
    hessian : float64, shape (STATE_FEATURES, 4, 4)
        Written: second derivatives.
    """
    gradient[:] = 0.0
    hessian[:] = 0.0
    _, gradient[LANE, 1], hessian[LANE, 1, 1] = lane_middle(y, around.ground)
    _, gradient[BOUNDARY, 1], hessian[BOUNDARY, 1, 1] = boundaries(y, around.ground)
    _, gradient[SPEED, 3], gradient[SPEED, 2], cross, hessian[SPEED, 2, 2] = forward_speed(
        v, psi, around.ground.speed_limit
    )
    hessian[SPEED, 2, 3] = hessian[SPEED, 3, 2] = cross
    _, gradient[HEADING, 2], hessian[HEADING, 2, 2] = along_road(psi)
    c = collision(x, y, psi, length, width, cell, stride, lanes, own, around)
    gradient[COLLISION, 0], gradient[COLLISION, 1], gradient[COLLISION, 2] = c[1], c[2], c[3]
    h = hessian[COLLISION]
    h[0, 0], h[1, 1], h[2, 2] = c[4], c[7], c[9]
    h[0, 1] = h[1, 0] = c[5]
    h[0, 2] = h[2, 0] = c[6]
    h[1, 2] = h[2, 1] = c[8]


def weights_from(named: dict[str, float]) -> np.ndarray:
    """Return weights in the order of :data:`NAMES`.

    Parameters
    ----------
    named : dict of str to float
        Weights by feature; a feature that is not named has weight 0.

    Returns
    -------
    float64, shape (features,)
        Weights.

    Raises
    ------
    ValueError
        If a feature is unknown.
    """
    unknown = set(named) - set(NAMES)
    if unknown:
        raise ValueError(f"no feature {sorted(unknown)[0]!r}; there are {', '.join(NAMES)}")
    return np.array([named.get(name, 0.0) for name in NAMES])
