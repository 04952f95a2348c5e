"""Scores of single pulses of acceleration, from which the score of any acceleration field is a sum.

What half a second more of acceleration in one window would do for the fit is worth knowing once: a field over place, time, lane
or any covariate is a weighting of these pulses, so that hundreds of fields cost little more than one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo.diagnosis import gls
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.regressors import FORM, Answer, tamed
from idm_sumo.diagnosis.rollout import BIN
from idm_sumo.recordings.columns import TRUCK

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Pulses:
    """Scores of pulses, orthogonal to what drivers, population and the car-following's form absorb.

    Attributes
    ----------
    windows : Windows
    state : float64, shape (windows, horizon, 7)
        Of the rollouts, as :func:`idm_sumo.diagnosis.rollout.respond` notes it.
    score : float64, shape (windows, pulses)
    """

    windows: w.Windows
    state: Floats
    score: Floats
    _inner: Floats  # (windows, pulses, pulses), Gram matrix of the pulses of one window
    _own: Floats  # (windows, pulses, 5), of pulses with the driver's parameters
    _free: Floats  # (drivers, 5, 5), covariance of the driver's parameters
    _common: Floats  # (windows, pulses, nuisances), of pulses with what is common to all
    _bound: Floats  # (nuisances, nuisances), inverse Gram matrix of that

    @property
    def variance(self) -> Floats:
        """Variance of each score before anything is projected out, shape ``(windows, pulses)``."""
        return np.diagonal(self._inner, axis1=1, axis2=2)

    def along(self, number: Integers, value: Floats, count: int) -> tuple[Floats, Floats]:
        """Return each driver's scores and the Gram matrix of a field that acts in one of ``count`` bins only, and of the whole.

        Parameters
        ----------
        number : int64, shape (windows, horizon)
            Bin of each frame, -1 for none.
        value : float64, shape (windows, horizon)
            The field (m/s²).
        count : int

        Returns
        -------
        float64, shapes (drivers, count + 1) and (count + 1, count + 1)
            The last is the field everywhere.
        """
        u = np.zeros((self.windows.drivers, count + 1))
        own = np.zeros((self.windows.drivers, self._own.shape[2], count + 1))
        common, gram = np.zeros((self._common.shape[2], count + 1)), np.zeros((count + 1, count + 1))
        _gather(
            np.ascontiguousarray(number), np.ascontiguousarray(value), self.windows.driver, self.score, self._inner,
            self._own, self._common, u, own, common, gram,
        )  # fmt: skip
        held = (self._free @ own).reshape(-1, count + 1)
        return u, gram - own.reshape(-1, count + 1).T @ held - common.T @ self._bound @ common

    def information(self, field: Floats) -> Floats:
        """Return each driver's information on one field ``(windows, pulses)``, before anything common is projected out."""
        each = np.einsum("wp,wpq,wq->w", field, self._inner, field, optimize=True)
        own = gls.by_driver(np.einsum("wpa,wp->wa", self._own, field), self.windows.driver, self.windows.drivers)
        direct = gls.by_driver(each, self.windows.driver, self.windows.drivers)
        return np.asarray(direct - np.einsum("ia,iab,ib->i", own, self._free, own, optimize=True))


def pulses_of(windows: w.Windows, fit: Fit, answer: Answer) -> Pulses:
    """Return the scores of all pulses of the windows at a fit."""
    line, response, state = answer.line, tamed(answer.response), answer.state
    form = answer.pulses[:, :, FORM]
    truck = (windows.seen[:, w.OWN_KIND, -1] == TRUCK)[:, None, None]
    common = [line.jacobian * truck] if truck.any() else []
    parts = (line.error[:, :, None], line.jacobian, response, *common, tamed(response @ form))
    error, own, moved, *rest = (line.whitener @ part for part in parts)
    own_t, driver, drivers = own.transpose(0, 2, 1), windows.driver, windows.drivers
    free = np.linalg.inv(gls.by_driver(own_t @ own, driver, drivers) + np.linalg.inv(fit.spread))

    def without_own(values: Floats) -> Floats:
        return np.asarray(values - own @ (free @ gls.by_driver(own_t @ values, driver, drivers))[driver])

    nuisance = np.concatenate([own, *rest], axis=2)
    kept, flat = without_own(nuisance), (-1, nuisance.shape[2])
    bound = gls.scaled_inverse(kept.reshape(flat).T @ nuisance.reshape(flat))
    taken = kept @ (bound @ (kept.reshape(flat).T @ error.reshape(-1)))
    moved_t = moved.transpose(0, 2, 1)
    score = (moved_t @ (without_own(error) - taken[:, :, None]))[:, :, 0]
    inner, along, shared = (np.ascontiguousarray(moved_t @ other) for other in (moved, own, kept))
    return Pulses(windows, state, score, inner, along, free, shared, bound)


@njit(cache=True, nogil=True)
def _gather(number, value, driver, score, inner, own, common, u, by_own, by_common, gram):  # type: ignore[no-untyped-def]
    """Add up, window by window, what a field in bins has of the pulses: only the few bins that a window is in take part."""
    most, last = number.shape[1] * 2, u.shape[1] - 1
    pulse, place, size = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    for i in range(len(number)):
        entries = 0
        for p in range(score.shape[1]):
            first, whole = entries, 0.0
            for k in range(p * BIN, (p + 1) * BIN):
                whole += value[i, k] / BIN
                if number[i, k] < 0:
                    continue
                if entries == first or place[entries - 1] != number[i, k]:
                    pulse[entries], place[entries], size[entries] = p, number[i, k], 0.0
                    entries += 1
                size[entries - 1] += value[i, k] / BIN
            pulse[entries], place[entries], size[entries] = p, last, whole
            entries += 1
        for e in range(entries):
            p, a = pulse[e], place[e]
            u[driver[i], a] += size[e] * score[i, p]
            for n in range(own.shape[2]):
                by_own[driver[i], n, a] += size[e] * own[i, p, n]
            for n in range(common.shape[2]):
                by_common[n, a] += size[e] * common[i, p, n]
            for f in range(entries):
                gram[a, place[f]] += size[e] * inner[i, p, pulse[f]] * size[f]
