"""First and second derivatives of the bicycle model's step.

The likelihood of a demonstration needs them. The step itself is :func:`idm_sumo.models.bicycle.step`.
The state is ``x, y, psi, v`` of the centre of mass, the controls are ``acceleration, steering``, in this order.
"""

from __future__ import annotations

from math import atan, cos, sin, tan

from numba import njit

from idm_sumo.models.bicycle import REAR_SHARE
from idm_sumo.recordings.columns import FRAME_STEP

X, Y, PSI, V, ACC, STEER = range(6)


@njit(cache=True)
def slip_derivatives(steering: float) -> tuple[float, float, float]:
    r"""Return the slip angle and its derivatives by the steering.

    Parameters
    ----------
    steering : float
        Steering angle :math:`\delta` (rad).

    Returns
    -------
    slip : float
        :math:`\beta = \arctan(\rho\tan\delta)` (rad).
    first, second : float
        Its derivatives by :math:`\delta`.
    """
    t = tan(steering)
    below = 1.0 + (REAR_SHARE * t) ** 2
    first = REAR_SHARE * (1.0 + t * t) / below
    second = 2.0 * REAR_SHARE * t * (1.0 - REAR_SHARE**2) * (1.0 + t * t) / below**2
    return atan(REAR_SHARE * t), first, second


@njit(cache=True)
def step_jacobian(psi, v, acceleration, steering, axles, jacobian):  # type: ignore[no-untyped-def]
    """Write the derivatives of the next state.

    Parameters
    ----------
    psi, v : float
        Heading (rad) and speed (m/s).
    acceleration, steering : float
        Controls (m/s², rad).
    axles : float
        Wheelbase (m).
    jacobian : float64, shape (4, 6)
        Written: derivatives by state and controls.

    Notes
    -----
    Where the next speed is not positive it depends on nothing, since the vehicle stands.
    """
    dt = FRAME_STEP
    slip, b, _ = slip_derivatives(steering)
    c, s = cos(psi + slip), sin(psi + slip)
    rear = REAR_SHARE * axles
    jacobian[:] = 0.0
    jacobian[X, X] = jacobian[Y, Y] = jacobian[PSI, PSI] = 1.0
    jacobian[X, PSI], jacobian[X, V], jacobian[X, STEER] = -v * s * dt, c * dt, -v * s * b * dt
    jacobian[Y, PSI], jacobian[Y, V], jacobian[Y, STEER] = v * c * dt, s * dt, v * c * b * dt
    jacobian[PSI, V], jacobian[PSI, STEER] = sin(slip) * dt / rear, v * cos(slip) * b * dt / rear
    if v + acceleration * dt > 0.0:
        jacobian[V, V], jacobian[V, ACC] = 1.0, dt


@njit(cache=True)
def add_step_curvature(psi, v, steering, axles, costate, out):  # type: ignore[no-untyped-def]
    """Add the weighted second derivatives of the next state.

    Parameters
    ----------
    psi, v : float
        Heading (rad) and speed (m/s).
    steering, axles : float
        Steering angle (rad) and wheelbase (m).
    costate : float64, shape (4,)
        Weights of the state's components.
    out : float64, shape (6, 6)
        Changed in place: derivatives by state and controls.
    """
    dt = FRAME_STEP
    slip, b, b2 = slip_derivatives(steering)
    c, s = cos(psi + slip), sin(psi + slip)
    rear = REAR_SHARE * axles
    px, py, ppsi = costate[X] * dt, costate[Y] * dt, costate[PSI] * dt / rear
    along, across = px * c + py * s, -px * s + py * c
    psi_v, psi_steer = across, -v * along * b
    v_steer = across * b + ppsi * cos(slip) * b
    out[PSI, PSI] -= v * along
    out[PSI, V] += psi_v
    out[V, PSI] += psi_v
    out[PSI, STEER] += psi_steer
    out[STEER, PSI] += psi_steer
    out[V, STEER] += v_steer
    out[STEER, V] += v_steer
    out[STEER, STEER] += v * (across * b2 - along * b * b) + v * ppsi * (cos(slip) * b2 - sin(slip) * b * b)
