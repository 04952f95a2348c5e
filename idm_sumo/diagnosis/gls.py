r"""Generalised least squares with random drivers, as sums over drivers.

For the windows of driver :math:`i`, :math:`r_i = J_i(\mu + b_i) + G_i\beta + e_i` with :math:`b_i \sim N(0, \Lambda)` and
window covariance :math:`V_w`. With :math:`B_i = \sum_w J^\top V^{-1} J + \Lambda^{-1}` every regressor's score and all Gram
entries follow from whitened products; everything after (single causes, joint fits, scans, bootstraps) is algebra on them.

References
----------
Laird and Ware (1982), Random-effects models for longitudinal data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.runtime.threads import in_threads

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Scores:
    """Scores of regressors, by driver, and their Gram matrix.

    Attributes
    ----------
    u : float64, shape (drivers, regressors)
    gram : float64, shape (regressors, regressors)
    part : float64, shape (drivers, regressors)
        Each driver's part of the diagonal of ``gram``, before anything common to all is projected out.
    """

    u: Floats
    gram: Floats
    part: Floats

    def without(self, nuisance: Integers) -> Scores:
        """Project the nuisance regressors out of all others (which keep their places; the nuisance's become zero)."""
        if not len(nuisance):
            return self
        by = scaled_inverse(self.gram[np.ix_(nuisance, nuisance)]) @ self.gram[nuisance]
        u = self.u - self.u[:, nuisance] @ by
        gram = self.gram - self.gram[:, nuisance] @ by
        u[:, nuisance] = 0.0
        gram[nuisance], gram[:, nuisance] = 0.0, 0.0
        return Scores(u, gram, self.part)


def scaled_inverse(gram: Floats) -> Floats:
    """Return the pseudo-inverse of a Gram matrix whose rows may be of very different sizes."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    both = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(gram / both, rcond=1e-9, hermitian=True) / both)


def whitener(covariance: Floats) -> Floats:
    r"""Return :math:`L^{-1}` for each window, with :math:`V = LL^\top`; both of shape ``(windows, moments, moments)``.

    Raises
    ------
    numpy.linalg.LinAlgError
        If a covariance is not positive definite.
    """
    out = np.zeros_like(covariance)
    in_threads(_whiten, len(covariance), covariance, out)
    if not np.isfinite(out).all():
        raise np.linalg.LinAlgError("a covariance of what windows leave is not positive definite")
    return out


# For matrices as small as these, LAPACK spends most of the time on the way to and from each of them.
@njit(cache=True, nogil=True, error_model="numpy")
def _whiten(first, last, covariance, out):  # type: ignore[no-untyped-def]
    size = covariance.shape[1]
    root = np.zeros((size, size))
    for i in range(first, last):
        for k in range(size):
            for j in range(k + 1):
                rest = covariance[i, k, j]
                for n in range(j):
                    rest -= root[k, n] * root[j, n]
                root[k, j] = np.sqrt(rest) if k == j else rest / root[j, j]
        for k in range(
            size
        ):  # forward substitution, row by row: each is the unit's less what the rows before it explain
            for n in range(k):
                for j in range(n + 1):
                    out[i, k, j] -= root[k, n] * out[i, n, j]
            for j in range(k):
                out[i, k, j] /= root[k, k]
            out[i, k, k] = 1.0 / root[k, k]


def by_driver(values: Floats, driver: Integers, drivers: int) -> Floats:
    """Sum over the windows of each driver; windows are sorted by driver. Drivers without one get zero."""
    out = np.zeros((drivers, *values.shape[1:]), dtype=values.dtype)
    if len(driver):
        first = np.flatnonzero(np.concatenate([[True], np.diff(driver) > 0]))
        out[driver[first]] = np.add.reduceat(values, first, axis=0)
    return out


def scores(residual: Floats, own: Floats, regressors: Floats, prior: Floats, driver: Integers, drivers: int) -> Scores:
    """Return the scores of whitened regressors after the drivers' own parameters took what they can.

    Parameters
    ----------
    residual : float64, shape (windows, moments, 1)
        Whitened, as are the next two.
    own : float64, shape (windows, moments, parameters)
    regressors : float64, shape (windows, moments, regressors)
    prior : float64, shape (parameters, parameters)
        Inverse covariance of the drivers' parameters.
    driver : int64, shape (windows,)
        Sorted.
    drivers : int
    """
    own_t, regressors_t = own.transpose(0, 2, 1), regressors.transpose(0, 2, 1)
    inner = np.linalg.inv(by_driver(own_t @ own, driver, drivers) + prior)
    own_r = by_driver(own_t @ residual, driver, drivers)
    own_g = by_driver(own_t @ regressors, driver, drivers)
    direct = by_driver(regressors_t @ residual, driver, drivers)[:, :, 0]
    u = direct - np.einsum("ipa,ipq,iq->ia", own_g, inner, own_r[:, :, 0], optimize=True)
    flat = regressors.reshape(-1, regressors.shape[2])
    taken = np.einsum("ipq,iqa->ipa", inner, own_g, optimize=True).reshape(-1, regressors.shape[2])
    gram = flat.T @ flat - own_g.reshape(-1, regressors.shape[2]).T @ taken
    part = by_driver((regressors**2).sum(axis=1), driver, drivers) - np.einsum(
        "ipa,ipq,iqa->ia", own_g, inner, own_g, optimize=True
    )
    return Scores(u, gram, part)
