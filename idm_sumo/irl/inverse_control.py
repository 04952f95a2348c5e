r"""Continuous inverse optimal control: most likely weights of a reward.

A driver is assumed to choose controls :math:`u` with a density proportional to :math:`e^{R(u)}` for
the reward :math:`R = \theta^\top f` summed over the steps (maximum entropy). A second-order expansion
of the reward about the demonstration makes the density Gaussian (Laplace). With gradient :math:`g`
and :math:`A = -H > 0` the log-likelihood is

.. math:: L = -\tfrac12 g^\top A^{-1} g + \tfrac12 \log|A| - \tfrac n2 \log 2\pi .

:math:`g` and :math:`A` are linear in :math:`\theta`, so :math:`L` is concave where it exists: the first
term is a matrix-fractional function, the second a log-determinant. Newton steps with

.. math:: L_k = -g_k^\top w + \tfrac12 w^\top A_k w + \tfrac12\operatorname{tr}(A^{-1}A_k),\quad
    L_{kl} = -r_k^\top A^{-1} r_l - \tfrac12\operatorname{tr}(A^{-1}A_k A^{-1}A_l),

:math:`w = A^{-1}g`, :math:`r_k = g_k - A_k w`, find its only maximum.

Where :math:`A` is not positive definite the likelihood is undefined. The remedy of Levine and Koltun is
a dummy feature, minus half the squared deviation from the demonstrated controls. Its gradient is zero
there and its Hessian is minus the identity (in units of the controls' scales). Its weight starts so
large that every :math:`A` is positive definite, and an augmented Lagrangian drives it to zero. The
result holds the weight that remains.

Standard errors are sandwich estimates, with one score a demonstration; they stay valid where the model
is wrong. Source: Levine and Koltun (2012), Continuous inverse optimal control with locally optimal examples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from idm_sumo.irl import features
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.threads import one_blas_thread

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

ITERATIONS = 60
TOLERANCE = 1e-8  # Newton decrement per demonstration at which the search ends
DUMMY_GONE = 1e-6  # weight of the dummy feature that counts as zero
ROUNDS = 12  # of the augmented Lagrangian
CHUNK = 64  # demonstrations that are processed at once, which bounds the memory
FIRST_GUESS = 1.0  # weight of every feature at the start


@dataclass(frozen=True)
class Expansion:
    """Features summed along each demonstration, to second order.

    Attributes
    ----------
    gradient : float64, shape (demonstrations, features, n)
        Derivatives by the ``n`` controls.
    hessian : float64, shape (demonstrations, features, n, n)
        Second derivatives.
    scale : float64, shape (n,)
        Scales of the controls, for the dummy feature.
    """

    gradient: Floats
    hessian: Floats
    scale: Floats

    @classmethod
    def of(cls, gradient: Floats, hessian: Floats) -> Expansion:
        """Wrap the result of :func:`idm_sumo.irl.trajectory.derivatives`.

        Parameters
        ----------
        gradient : float64, shape (demonstrations, features, n)
            Derivatives by the controls.
        hessian : float64, shape (demonstrations, features, n, n)
            Second derivatives.

        Returns
        -------
        Expansion
            With the scales of the controls.
        """
        units = [features.ACCELERATION_SCALE, features.STEERING_SCALE]
        return cls(gradient, hessian, np.tile(units, gradient.shape[2] // 2))

    def __len__(self) -> int:
        """Return the number of demonstrations."""
        return len(self.gradient)


@dataclass(frozen=True)
class LearnedReward:
    """Weights by maximum likelihood.

    Attributes
    ----------
    weights, standard_errors : float64, shape (features,)
        0 for a feature that was left out; an error is NaN away from a maximum.
    covariance : float64, shape (features, features)
        Sandwich estimate.
    log_likelihood : float
        Mean over demonstrations.
    demonstrations : int
        Number of demonstrations.
    dummy : float
        Remaining weight of the dummy feature.
    converged : bool
        Whether the search ended at a maximum without the dummy feature.
    """

    weights: Floats
    standard_errors: Floats
    covariance: Floats
    log_likelihood: float
    demonstrations: int
    dummy: float
    converged: bool

    def to_json(self) -> dict[str, object]:
        """Return plain values, by feature.

        Returns
        -------
        dict
            Ready for JSON.
        """
        return {
            "weights": dict(zip(features.NAMES, self.weights.tolist(), strict=True)),
            "standard_errors": dict(zip(features.NAMES, self.standard_errors.tolist(), strict=True)),
            "log_likelihood": float(self.log_likelihood),
            "demonstrations": self.demonstrations,
            "dummy": float(self.dummy),
            "converged": bool(self.converged),
        }


def log_likelihood(expansion: Expansion, weights: npt.ArrayLike, dummy: float = 0.0) -> Floats:
    """Return the log-likelihood of each demonstration.

    Parameters
    ----------
    expansion : Expansion
        Features about the demonstrations.
    weights : array_like, shape (features,)
        Weights of the reward.
    dummy : float
        Weight of the dummy feature.

    Returns
    -------
    float64, shape (demonstrations,)
        Minus infinity where the reward is not concave.
    """
    theta = np.append(np.asarray(weights, dtype=np.float64), dummy)
    one_by_one = (
        Expansion(expansion.gradient[i : i + 1], expansion.hessian[i : i + 1], expansion.scale)
        for i in range(len(expansion))
    )
    return np.concatenate([_likelihoods(one, theta) for one in one_by_one])


@one_blas_thread
def learn_wanted(expansion: Expansion, free: LearnedReward, progress: Progress = silent) -> LearnedReward:
    """Find the most likely weights without negative ones.

    Every feature is written so that drivers are expected to want more of it. While a weight is negative,
    the most negative one is set to 0 and the others are learned again.

    Parameters
    ----------
    expansion : Expansion
        Features about the demonstrations.
    free : LearnedReward
        Weights learned without the bound.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    LearnedReward
        Weights of which none is negative.
    """
    learned = free
    use = tuple(name for name, weight in zip(features.NAMES, free.weights, strict=True) if weight != 0.0)
    while learned.weights.min() < 0.0:
        use = tuple(name for name in use if name != features.NAMES[int(np.argmin(learned.weights))])
        learned = learn(expansion, use=use, progress=progress)
    return learned


@one_blas_thread
def learn(expansion: Expansion, *, use: tuple[str, ...] = features.NAMES, progress: Progress = silent) -> LearnedReward:
    """Find the weights that make the demonstrations most likely.

    Parameters
    ----------
    expansion : Expansion
        Features about the demonstrations.
    use : tuple of str
        Features with a weight; the others keep 0.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    LearnedReward
        ``converged`` is false if the steps ran out, or if no weights make every demonstration's reward
        concave without the dummy feature.
    """
    free = np.array([features.NAMES.index(name) for name in use])
    theta = np.zeros(features.COUNT + 1)
    theta[free] = FIRST_GUESS
    price, stiffness = 0.0, 0.0
    if not np.isfinite(_likelihoods(expansion, theta)).all():
        theta[-1] = _enough_dummy(expansion, theta)
        price, stiffness = 1.0, 1.0
    searched = np.append(free, features.COUNT) if theta[-1] else free
    for round_ in range(ROUNDS):
        progress("inverse optimal control", round_, ROUNDS)
        theta, converged = _newton(expansion, theta, searched, price, stiffness)
        if theta[-1] <= DUMMY_GONE:
            break
        price, stiffness = price + stiffness * theta[-1], 4.0 * stiffness
    progress("inverse optimal control", ROUNDS, ROUNDS)
    converged = converged and theta[-1] <= DUMMY_GONE
    if converged and theta[-1]:
        plain = np.append(theta[:-1], 0.0)
        if np.isfinite(_likelihoods(expansion, plain)).all():
            theta, converged = _newton(expansion, plain, free, 0.0, 0.0)
    return _result(expansion, theta, free, converged)


def _enough_dummy(expansion: Expansion, theta: Floats) -> float:
    """Return a dummy weight that makes every reward concave."""
    trial = theta.copy()
    trial[-1] = 1.0
    while not np.isfinite(_likelihoods(expansion, trial)).all():
        trial[-1] *= 2.0
    return float(2.0 * trial[-1])


def _newton(expansion: Expansion, theta: Floats, free: Integers, price: float, stiffness: float) -> tuple[Floats, bool]:
    """Maximise the mean likelihood less the dummy's penalty.

    Damped Newton steps; the penalty is ``price * dummy + stiffness / 2 * dummy**2``.
    """
    for _ in range(ITERATIONS):
        value, slope, bend = _objective(expansion, theta, free, price, stiffness)
        step = np.zeros_like(theta)
        step[free] = np.linalg.solve(-bend, slope)
        decrement = float(slope @ step[free])
        if decrement < TOLERANCE:
            return theta, True
        size = 1.0
        while True:
            trial = theta + size * step
            trial[-1] = max(trial[-1], 0.0)
            new = _value(expansion, trial, price, stiffness)
            if new >= value + 0.1 * size * decrement or (trial[-1] == 0.0 < theta[-1] and new > value):
                break
            size *= 0.5
            if size < 1e-10:
                return theta, False
        theta = trial
        if theta[-1] == 0.0 and free[-1] == features.COUNT:
            return theta, True
    return theta, False


def _value(expansion: Expansion, theta: Floats, price: float, stiffness: float) -> float:
    penalty = price * theta[-1] + 0.5 * stiffness * theta[-1] ** 2
    return float(_likelihoods(expansion, theta).mean() - penalty)


def _objective(
    expansion: Expansion, theta: Floats, free: Integers, price: float, stiffness: float
) -> tuple[float, Floats, Floats]:
    """Return the objective of :func:`_newton` with gradient and Hessian.

    The derivatives are by the weights ``free``.
    """
    score, bend = _derivatives(expansion, theta, free)
    gradient, hessian = score.mean(axis=0), bend / len(expansion)
    if free[-1] == features.COUNT:
        gradient[-1] -= price + stiffness * theta[-1]
        hessian[-1, -1] -= stiffness
    return _value(expansion, theta, price, stiffness), gradient, hessian


def _expanded(gradient: Floats, hessian: Floats, scale: Floats, theta: Floats) -> tuple[Floats, Floats]:
    """Return the reward's gradient g and A, minus its Hessian."""
    g = np.einsum("k,ikm->im", theta[:-1], gradient)
    a = np.empty_like(hessian[:, 0])
    a[:] = np.diag(theta[-1] / scale**2)
    for k in np.flatnonzero(theta[:-1]):
        a -= theta[k] * hessian[:, k]
    return g, a


def _likelihoods(expansion: Expansion, theta: Floats) -> Floats:
    """Return the log-likelihood of each demonstration.

    All are minus infinity if one does not exist.
    """
    g, a = _expanded(expansion.gradient, expansion.hessian, expansion.scale, theta)
    try:
        lower = np.linalg.cholesky(a)
    except np.linalg.LinAlgError:
        return np.full(len(expansion), -np.inf)
    half_log_determinant = np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
    square = (g * np.linalg.solve(a, g[:, :, None])[:, :, 0]).sum(axis=1)
    return np.asarray(-0.5 * square + half_log_determinant - 0.5 * g.shape[1] * np.log(2.0 * np.pi))


def _derivatives(expansion: Expansion, theta: Floats, free: Integers) -> tuple[Floats, Floats]:
    """Return the scores and the sum of second derivatives.

    Shapes are (demonstrations, free) and (free, free).
    """
    score, bend = np.empty((len(expansion), len(free))), np.zeros((len(free), len(free)))
    for begin in range(0, len(expansion), CHUNK):
        part = slice(begin, begin + CHUNK)
        gradient, hessian = expansion.gradient[part], expansion.hessian[part]
        g, a = _expanded(gradient, hessian, expansion.scale, theta)
        inverse = np.linalg.inv(a)
        w = (inverse @ g[:, :, None])[:, :, 0]
        columns = [_one_weight(k, gradient, hessian, expansion.scale) for k in free]
        slopes = np.stack([slope for slope, _ in columns], axis=1)  # g_k
        bent = np.stack([np.einsum("imn,in->im", curvature, w) for _, curvature in columns], axis=1)  # A_k w
        solved = np.stack([inverse @ curvature for _, curvature in columns], axis=1)  # A^-1 A_k
        score[part] = (
            -np.einsum("ikm,im->ik", slopes, w)
            + 0.5 * np.einsum("ikm,im->ik", bent, w)
            + 0.5 * np.trace(solved, axis1=2, axis2=3)
        )
        rest = slopes - bent
        flat, turned = (m.reshape(*m.shape[:2], -1) for m in (solved, solved.swapaxes(2, 3)))
        bend -= (rest @ inverse @ rest.swapaxes(1, 2) + 0.5 * flat @ turned.swapaxes(1, 2)).sum(axis=0)
    return score, bend


def _one_weight(k: int, gradient: Floats, hessian: Floats, scale: Floats) -> tuple[Floats, Floats]:
    """Return g_k and A_k of a feature or the dummy."""
    if k < features.COUNT:
        return gradient[:, k], -hessian[:, k]
    return np.zeros_like(gradient[:, 0]), np.broadcast_to(np.diag(1.0 / scale**2), hessian[:, 0].shape)


def _result(expansion: Expansion, theta: Floats, free: Integers, converged: bool) -> LearnedReward:
    score, bend = _derivatives(expansion, theta, free)
    inverse = np.linalg.inv(-bend)
    covariance = np.zeros((features.COUNT, features.COUNT))
    covariance[np.ix_(free, free)] = inverse @ (score.T @ score) @ inverse
    return LearnedReward(
        theta[:-1],
        np.sqrt(np.where(np.diag(covariance) < 0.0, np.nan, np.diag(covariance))),
        covariance,
        float(_likelihoods(expansion, theta).mean()),
        len(expansion),
        float(theta[-1]),
        converged,
    )
