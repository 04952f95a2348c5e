"""Probabilities of causes: between nothing and certainty, shared with what looks alike, larger the surer the cause is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.probability import NOTHING, log_bayes_factor, probability
from idm_sumo.diagnosis.result import Gain
from tests.helpers.followers import candidate, tried

GAIN = Gain("ade_m", 1.0, 0.9, 0.1, (0.05, 0.15), 20)


def cause(z: float, support: float = 0.0, rivals: tuple[str, ...] = ()) -> Accepted:
    return Accepted(tried(z, support=support), 0.5, 0.01, GAIN, rivals)


@given(st.floats(0.0, 30.0), st.floats(0.001, 2.0))
def test_the_bayes_factor_is_the_ratio_of_both_densities_of_the_estimate(z: float, error: float) -> None:
    one = replace(candidate(z, "hysteresis"), error=error)
    typical, estimate = 0.12, z * error
    with_it, without = norm(0.0, np.hypot(error, typical)), norm(0.0, error)
    assert log_bayes_factor(one, z**2) == pytest.approx(with_it.logpdf(estimate) - without.logpdf(estimate), abs=1e-6)


@given(st.floats(0.0, 20.0), st.floats(0.0, 20.0))
def test_it_grows_with_the_cause_and_falls_with_its_rivals(z: float, other: float) -> None:
    rival = candidate(other, "hysteresis", 0.2)
    here = probability(cause(z), [rival])
    assert 0.0 <= here <= 1.0
    assert probability(cause(z + 1.0), [rival]) >= here
    assert probability(cause(z), [replace(rival, z=other + 1.0)]) <= here + 1e-12
    assert probability(cause(z), []) >= here * NOTHING


def test_what_cannot_be_told_apart_shares_it_and_what_cannot_be_is_no_rival() -> None:
    assert probability(cause(9.0), []) > 0.999
    assert probability(cause(9.0, rivals=("hysteresis",)), []) == pytest.approx(0.5, abs=1e-3)
    impossible = candidate(40.0, "reaction_delay", -0.4)
    assert probability(cause(9.0), [impossible]) > 0.999
    assert probability(cause(2.0, support=400.0), [candidate(9.0, "hysteresis", 0.2)]) > 0.999
    assert probability(cause(0.0), []) < 0.1
