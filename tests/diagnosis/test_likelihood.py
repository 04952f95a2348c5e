"""The marginal likelihood of drivers is that of a multivariate t with the covariance that they and their own parameters make."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_t

from idm_sumo.diagnosis import law
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import FREEDOM, fit_drivers, linearise
from idm_sumo.diagnosis.likelihood import log_likelihood
from idm_sumo.models import laws
from tests.helpers.followers import followers

START = np.array([0.01, 0.01])


def test_it_is_the_density_of_a_multivariate_t():
    rng = np.random.default_rng(4)
    windows, _ = followers(law.of(laws.IDM), rng)
    windows.seen[:, w.X] += rng.normal(0.0, 0.2, (len(windows.seen), windows.seen.shape[2]))
    fit = fit_drivers(windows, law.of(laws.IDM), START, rounds=3)
    fit.weight[:] = 1.0
    line = linearise(windows, fit)
    found = log_likelihood(windows, fit)
    for driver in (0, windows.drivers - 1):
        rows = np.flatnonzero(windows.driver == driver)
        error, jacobian = line.error[rows].ravel(), line.jacobian[rows].reshape(-1, 5)
        covariance = jacobian @ fit.spread @ jacobian.T
        for number, row in enumerate(rows):
            block = slice(number * line.error.shape[1], (number + 1) * line.error.shape[1])
            root = np.linalg.inv(line.whitener[row])
            covariance[block, block] += root @ root.T
        expected = multivariate_t(np.zeros(len(error)), covariance, df=FREEDOM).logpdf(error)
        assert found[driver] == pytest.approx(expected, rel=1e-6)
