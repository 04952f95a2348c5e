"""The algebra of the scores against a dense reference."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import gls

DRIVER = np.array([0, 0, 0, 1, 2, 2])
DRIVERS, MOMENTS, OWN, REGRESSORS = 3, 7, 2, 4


@pytest.fixture(name="case")
def make_case():
    rng = np.random.default_rng(5)
    windows = len(DRIVER)
    root = rng.normal(size=(windows, MOMENTS, MOMENTS))
    covariance = root @ root.transpose(0, 2, 1) + np.eye(MOMENTS)
    spread = np.array([[0.5, 0.1], [0.1, 0.3]])
    error = rng.normal(size=(windows, MOMENTS, 1))
    own = rng.normal(size=(windows, MOMENTS, OWN))
    regressors = rng.normal(size=(windows, MOMENTS, REGRESSORS))
    return covariance, spread, error, own, regressors


def test_whiteners_are_the_inverse_of_the_cholesky_factor(case):
    covariance = case[0]
    np.testing.assert_allclose(gls.whitener(covariance), np.linalg.inv(np.linalg.cholesky(covariance)), atol=1e-12)


def test_no_whitener_of_what_is_no_covariance(case):
    covariance = case[0].copy()
    covariance[2] = -np.eye(MOMENTS)
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        gls.whitener(covariance)


def whole(case):
    covariance, spread, error, own, regressors = case
    e, j, g = (gls.whitener(covariance) @ part for part in (error, own, regressors))
    return gls.scores(e, j, np.concatenate([j, g], axis=2), np.linalg.inv(spread), DRIVER, DRIVERS)


def dense(case):
    """Stack every window into one system with the full covariance of all observations."""
    covariance, spread, error, own, regressors = case
    size = len(DRIVER) * MOMENTS
    total = np.zeros((size, size))
    for n in range(len(DRIVER)):
        part = slice(n * MOMENTS, (n + 1) * MOMENTS)
        total[part, part] += covariance[n]
        for k in np.flatnonzero(DRIVER[n] == DRIVER):
            total[part, k * MOMENTS : (k + 1) * MOMENTS] += own[n] @ spread @ own[k].T
    design = np.concatenate([own, regressors], axis=2).reshape(size, -1)
    return design, total, error.reshape(size)


def test_scores_and_gram_are_those_of_the_dense_system(case):
    design, total, error = dense(case)
    found = whole(case)
    np.testing.assert_allclose(found.u.sum(axis=0), design.T @ np.linalg.solve(total, error), rtol=1e-9)
    np.testing.assert_allclose(found.gram, design.T @ np.linalg.solve(total, design), rtol=1e-9)


def test_estimates_after_projection_are_those_of_the_joint_fit(case):
    design, total, error = dense(case)
    joint = np.linalg.solve(design.T @ np.linalg.solve(total, design), design.T @ np.linalg.solve(total, error))
    left = whole(case).without(np.arange(OWN))
    inner = left.gram[OWN:, OWN:]
    np.testing.assert_allclose(np.linalg.solve(inner, left.u.sum(axis=0)[OWN:]), joint[OWN:], rtol=1e-8)


def test_projection_kills_what_it_projects_out_and_what_is_a_copy_of_it(case):
    covariance, spread, error, own, regressors = case
    regressors[:, :, 0] = own @ np.array([0.7, -0.2])
    left = whole((covariance, spread, error, own, regressors)).without(np.arange(OWN))
    np.testing.assert_allclose(left.u[:, : OWN + 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(left.gram[: OWN + 1], 0.0, atol=1e-9)


def test_a_sum_of_bins_is_an_interval(case):
    mix = np.zeros((OWN + REGRESSORS, 1))
    mix[OWN : OWN + 2] = 1.0
    covariance, spread, error, own, regressors = case
    regressors[:, :, 2] = regressors[:, :, 0] + regressors[:, :, 1]
    found = whole((covariance, spread, error, own, regressors))
    np.testing.assert_allclose((found.u @ mix)[:, 0], found.u[:, OWN + 2], rtol=1e-9)
    np.testing.assert_allclose((mix.T @ found.gram @ mix)[0, 0], found.gram[OWN + 2, OWN + 2], rtol=1e-9)


def test_windows_are_summed_by_driver_and_a_driver_without_windows_gets_nothing():
    values = np.arange(6.0).reshape(6, 1)
    np.testing.assert_array_equal(gls.by_driver(values, np.array([0, 0, 2, 2, 2, 4]), 5)[:, 0], [1, 0, 9, 0, 5])
