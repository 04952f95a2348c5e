r"""Features summed along a trajectory, with gradient and Hessian.

Both are exact and taken by the controls. With states :math:`x_{t+1} = F(x_t, u_t)` the sum of a feature,
:math:`R(u) = \sum_t f(x_{t+1}) + h(u_t)`, has the gradient
:math:`\partial R/\partial u_t = h_u + F_u^\top p_{t+1}` by the costate
:math:`p_t = f_x + F_x^\top p_{t+1}`. Its Hessian needs one more backward pass,

.. math:: P_t = f_{xx} + F_x^\top P_{t+1} F_x + p_{t+1}\!\cdot\! F_{xx},\qquad
    H_{tt} = h_{uu} + F_u^\top P_{t+1} F_u + p_{t+1}\!\cdot\! F_{uu},

and for an earlier control :math:`H_{ts} = (F_u^\top P_{t+1} F_x + p_{t+1}\!\cdot\!F_{ux})\,
\partial x_t/\partial u_s`. The dot is the sum over the components of the state. The time grows with
the square of the number of steps.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.irl import features
from idm_sumo.irl.demonstrations import Demonstrations
from idm_sumo.irl.dynamics import add_step_curvature, step_jacobian
from idm_sumo.irl.episodes import Episodes, Surroundings
from idm_sumo.models.bicycle import wheelbase

Floats = npt.NDArray[np.float64]


def step_features(demonstrations: Demonstrations, episodes: Episodes, around: Surroundings) -> Floats:
    """Return every feature after each step.

    Parameters
    ----------
    demonstrations : Demonstrations
        Paths and controls.
    episodes : Episodes
        The same windows.
    around : Surroundings
        Traffic.

    Returns
    -------
    float64, shape (windows, steps, features)
        Features.
    """
    n, steps = demonstrations.control.shape[:2]
    out = np.empty((n, steps, features.COUNT))
    _step_features(demonstrations.state, demonstrations.control, *episodes[1:], around, out)
    return out


def derivatives(demonstrations: Demonstrations, episodes: Episodes, around: Surroundings) -> tuple[Floats, Floats]:
    """Return the derivatives of every feature's sum.

    Parameters
    ----------
    demonstrations : Demonstrations
        Paths and controls.
    episodes : Episodes
        The same windows.
    around : Surroundings
        Traffic.

    Returns
    -------
    gradient : float64, shape (windows, features, 2 * steps)
        By acceleration and steering of the first step, then of the second, and so on.
    hessian : float64, shape (windows, features, 2 * steps, 2 * steps)
        Second derivatives.
    """
    n, steps = demonstrations.control.shape[:2]
    gradient = np.zeros((n, features.COUNT, 2 * steps))
    hessian = np.zeros((n, features.COUNT, 2 * steps, 2 * steps))
    _derivatives(
        np.ascontiguousarray(demonstrations.state), np.ascontiguousarray(demonstrations.control),
        *episodes[1:], around, gradient, hessian,
    )  # fmt: skip
    return gradient, hessian


@njit(cache=True)
def _step_features(state, control, length, width, cell, stride, lanes, own, around, out):  # type: ignore[no-untyped-def]
    for i in range(state.shape[0]):
        for k in range(control.shape[1]):
            x, y, psi, v = state[i, k + 1, 0], state[i, k + 1, 1], state[i, k + 1, 2], state[i, k + 1, 3]
            features.values(
                x, y, psi, v, control[i, k, 0], control[i, k, 1], length[i], width[i],
                cell[i] + k + 1, stride[i], lanes[i], own[i], around, out[i, k],
            )  # fmt: skip


@njit(cache=True)
def _derivatives(state, control, length, width, cell, stride, lanes, own, around, gradient, hessian):  # type: ignore[no-untyped-def]
    for i in range(state.shape[0]):
        steps = control.shape[1]
        first = np.empty((steps + 1, features.STATE_FEATURES, 4))
        second = np.empty((steps + 1, features.STATE_FEATURES, 4, 4))
        for t in range(1, steps + 1):
            x, y, psi, v = state[i, t, 0], state[i, t, 1], state[i, t, 2], state[i, t, 3]
            features.state_derivatives(
                x, y, psi, v, length[i], width[i], cell[i] + t, stride[i], lanes[i], own[i], around, first[t], second[t]
            )
        jacobian, sensitivity = _along(state[i], control[i], wheelbase(length[i]))
        for feature in range(features.STATE_FEATURES):
            _one_feature(
                state[i], control[i], wheelbase(length[i]), jacobian, sensitivity,
                first[:, feature], second[:, feature], gradient[i, feature], hessian[i, feature],
            )  # fmt: skip
        _efforts(control[i], gradient[i], hessian[i])


@njit(cache=True)
def _along(state, control, axles):  # type: ignore[no-untyped-def]
    """Return the Jacobians of the steps and of the states.

    Shapes are (steps, 4, 6) and, by all controls, (steps, 4, 2 * steps).
    """
    steps = control.shape[0]
    jacobian, sensitivity = np.empty((steps, 4, 6)), np.zeros((steps, 4, 2 * steps))
    for t in range(steps):
        step_jacobian(state[t, 2], state[t, 3], control[t, 0], control[t, 1], axles, jacobian[t])
        if t + 1 < steps:
            for row in range(4):
                for inner in range(4):
                    weight = jacobian[t, row, inner]
                    if weight != 0.0:
                        for u in range(2 * t):
                            sensitivity[t + 1, row, u] += weight * sensitivity[t, inner, u]
                for u in range(2):
                    sensitivity[t + 1, row, 2 * t + u] = jacobian[t, row, 4 + u]
    return jacobian, sensitivity


@njit(cache=True)
def _one_feature(state, control, axles, jacobian, sensitivity, first, second, gradient, hessian):  # type: ignore[no-untyped-def]
    steps = control.shape[0]
    costate, value, both = np.empty(4), np.empty((4, 4)), np.empty((6, 6))
    earlier = np.empty(4)
    for p in range(4):
        costate[p] = first[steps, p]
        for q in range(4):
            value[p, q] = second[steps, p, q]
    for t in range(steps - 1, -1, -1):
        # Second derivatives by state and controls of this step.
        for row in range(6):
            for column in range(row, 6):
                total = 0.0
                for p in range(4):
                    for q in range(4):
                        total += jacobian[t, p, row] * value[p, q] * jacobian[t, q, column]
                both[row, column] = both[column, row] = total
        add_step_curvature(state[t, 2], state[t, 3], control[t, 1], axles, costate, both)
        _write_controls(t, jacobian, sensitivity, costate, both, gradient, hessian)
        if t > 0:
            for p in range(4):
                total = first[t, p]
                for q in range(4):
                    total += jacobian[t, q, p] * costate[q]
                    value[p, q] = second[t, p, q] + both[p, q]
                earlier[p] = total
            for p in range(4):
                costate[p] = earlier[p]


@njit(cache=True)
def _write_controls(t, jacobian, sensitivity, costate, both, gradient, hessian):  # type: ignore[no-untyped-def]
    """Write the derivatives by the controls of step ``t``.

    Those by them and all earlier controls are included.
    """
    for u in range(2):
        row = 2 * t + u
        total = 0.0
        for p in range(4):
            total += jacobian[t, p, 4 + u] * costate[p]
        gradient[row] = total
        for other in range(2):
            hessian[row, 2 * t + other] = both[4 + u, 4 + other]
        for column in range(2 * t):
            total = 0.0
            for p in range(4):
                total += both[4 + u, p] * sensitivity[t, p, column]
            hessian[row, column] = hessian[column, row] = total


@njit(cache=True)
def _efforts(control, gradient, hessian):  # type: ignore[no-untyped-def]
    for t in range(control.shape[0]):
        for u, feature, scale in (
            (0, features.ACCELERATION, features.ACCELERATION_SCALE),
            (1, features.STEERING, features.STEERING_SCALE),
        ):
            _, slope, bend = features.effort(control[t, u], scale)
            gradient[feature, 2 * t + u] = slope
            hessian[feature, 2 * t + u, 2 * t + u] = bend
