"""The summary across recordings, held against what is known of it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.many.summary import pooled

VALUE, ERROR = st.floats(-50.0, 50.0), st.floats(0.1, 10.0)


def test_an_example_worked_by_hand() -> None:
    # w = 1, 1, 4; fixed mean 2.5; Q = 2.25 + 0.25 + 1 = 3.5; C = 6 - 18 / 6 = 3; tau2 = (3.5 - 2) / 3 = 0.5
    found = pooled([1.0, 2.0, 3.0], [1.0, 1.0, 0.5])
    weights = 1.0 / np.array([1.5, 1.5, 0.75])
    assert found is not None
    assert found["between_sd"] ** 2 == pytest.approx(0.5)
    assert found["value"] == pytest.approx(np.average([1.0, 2.0, 3.0], weights=weights))
    assert found["ci95"][1] - found["value"] == pytest.approx(1.96 / np.sqrt(weights.sum()))
    assert found["agreement"] == pytest.approx(2 / 3.5)


def test_one_recording_is_itself_and_none_is_nothing() -> None:
    one = pooled([3.0, np.nan], [0.5, 1.0])
    assert one == {"value": 3.0, "ci95": [3.0 - 0.98, 3.0 + 0.98], "between_sd": 0.0, "recordings": 1,
                   "agreement": None}  # fmt: skip
    assert pooled([1.0], [0.0]) is None


@given(st.lists(st.tuples(VALUE, ERROR), min_size=2, max_size=8), st.floats(-10.0, 10.0), st.floats(0.1, 10.0))
def test_it_moves_and_scales_with_the_estimates(studies: list[tuple[float, float]], shift: float, unit: float) -> None:
    values, errors = np.array(studies).T
    plain, moved = pooled(values, errors), pooled(unit * values + shift, unit * errors)
    assert plain is not None
    assert moved is not None
    assert moved["value"] == pytest.approx(unit * plain["value"] + shift, abs=1e-6)
    assert moved["between_sd"] == pytest.approx(unit * plain["between_sd"], abs=1e-4)
    assert moved["agreement"] == pytest.approx(plain["agreement"], abs=1e-6)
    assert values.min() - 1e-9 <= plain["value"] <= values.max() + 1e-9


def test_its_interval_covers_the_truth_as_often_as_it_says() -> None:
    rng, hits = np.random.default_rng(3), 0
    for _ in range(400):
        errors = rng.uniform(0.2, 1.0, 30)
        found = pooled(rng.normal(2.0, 0.5, 30) + rng.normal(0.0, errors), errors)
        assert found is not None
        hits += found["ci95"][0] < 2.0 < found["ci95"][1]
    assert 0.90 < hits / 400 < 0.98
