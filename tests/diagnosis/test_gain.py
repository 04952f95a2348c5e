"""Gains: the mean over drivers, and the typical driver's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from idm_sumo.diagnosis.gain import compare, typical_gain

BLOCKS = np.repeat(np.arange(10), 4)


@given(st.floats(0.2, 5.0), st.integers(0, 2**32 - 1))
def test_errors_that_all_change_by_a_factor_change_by_its_logarithm(factor, seed):
    rng = np.random.default_rng(seed)
    base = rng.lognormal(0.0, 1.0, len(BLOCKS))
    gain = typical_gain(base, factor * base, BLOCKS, rng, held_out=True)
    assert (gain.difference, *gain.ci95) == pytest.approx([-np.log(factor)] * 3)


def test_the_typical_driver_gains_where_one_at_the_edge_of_stability_hides_it_from_the_mean():
    base, rng = np.full(len(BLOCKS), 0.5), np.random.default_rng(0)
    extended = 0.8 * base
    extended[7] = 3.0
    mean = compare("ade_m", base, extended, BLOCKS, rng, held_out=True)
    typical = typical_gain(base, extended, BLOCKS, rng, held_out=True)
    assert mean.ci95[0] < 0.0 < typical.ci95[0]
    assert typical.base == 1.0
