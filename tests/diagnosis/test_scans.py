"""Scans find the stretch that was planted, on a line and on a plane, and count what correlated bins share."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from idm_sumo.diagnosis.scans import Stretch, best_stretch, beyond_margins, corrected_p

RNG = np.random.default_rng(3)


def correlated(count: int) -> np.ndarray:
    """Return a Gram matrix in which neighbouring bins share a part."""
    near = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    return 10.0 * np.exp(-near / 1.5)


def test_it_finds_the_planted_interval():
    gram = correlated(20)
    planted = np.zeros(20)
    planted[6:11] = 1.0
    found = best_stretch(gram @ planted, gram, (20,))
    assert found is not None
    assert (found.first, found.last) == ((6,), (11,))
    assert found.score / found.information == pytest.approx(1.0)
    np.testing.assert_array_equal(found.inside((20,)), planted)


def test_it_finds_the_planted_rectangle():
    gram = correlated(30)
    planted = np.zeros((5, 6))
    planted[1:3, 2:5] = -0.5
    found = best_stretch(gram @ planted.ravel(), gram, (5, 6))
    assert found is not None
    assert (found.first, found.last) == ((1, 2), (3, 5))
    assert found.score / found.information == pytest.approx(-0.5)


def test_beyond_margins_is_what_a_rectangle_says_and_no_row_or_column():
    shape, gram = (5, 6), correlated(30)
    rectangle = Stretch((1, 2), (3, 5), 1, 0.0, 0.0)
    of_rows, of_columns = RNG.standard_normal((5, 1)), RNG.standard_normal((1, 6))
    additive = gram @ (of_rows + of_columns).ravel()
    assert beyond_margins(additive, gram, rectangle, shape) == pytest.approx(0.0, abs=1e-6)
    own = gram @ rectangle.inside(shape)
    alone = beyond_margins(own, gram, rectangle, shape)
    assert 0.0 < alone < np.sqrt(rectangle.inside(shape) @ own)
    assert beyond_margins(additive - 2.0 * own, gram, rectangle, shape) == pytest.approx(-2.0 * alone)


@pytest.mark.parametrize("shape", [(9,), (3, 4)])
def test_it_is_the_best_of_all_stretches(shape):
    count = int(np.prod(shape))
    gram, total = correlated(count), RNG.standard_normal(count)
    best = 0.0
    ranges = [[(a, b) for a in range(n) for b in range(a + 1, n + 1)] for n in shape]
    for edges in itertools.product(*ranges):
        mask = np.zeros(shape)
        mask[tuple(slice(a, b) for a, b in edges)] = 1.0
        mix = mask.ravel()
        best = max(best, (total @ mix) ** 2 / (mix @ gram @ mix))
    found = best_stretch(total, gram, shape)
    assert found is not None
    assert found.score**2 / found.information == pytest.approx(best)
    assert found.looks == np.prod([len(one) for one in ranges])


def test_limits_of_width_hold():
    total = np.array([0.0, 5.0, 0.0, 0.0, 0.0, 0.0])
    narrow = best_stretch(total, np.eye(6), (6,), 3)
    assert narrow is not None
    assert narrow.last[0] - narrow.first[0] == 3
    wide = best_stretch(np.ones(6), np.eye(6), (6,), 1, 0.5)
    assert wide is not None
    assert wide.last[0] - wide.first[0] == 3
    one = best_stretch(total, np.eye(6), (6,), 1, 1.0 / 6.0)
    assert one is not None
    assert one.looks == 6


def test_nothing_known_is_nothing_found():
    assert best_stretch(np.zeros(4), np.zeros((4, 4)), (4,)) is None


def test_of_two_stretches_the_one_of_the_wanted_sign_is_taken():
    planted = np.zeros(20)
    planted[3:6], planted[12:18] = 1.0, -1.0
    gram = correlated(20)
    either, more = (best_stretch(gram @ planted, gram, (20,), of_sign=sign) for sign in (0.0, 1.0))
    assert (either.first, either.last) == ((12,), (18,))
    assert (more.first, more.last) == ((3,), (6,))
    assert best_stretch(gram @ planted.clip(0.0), gram, (20,), of_sign=-1.0) is None


def test_p_values_are_two_sided_and_corrected_for_looks():
    assert corrected_p(1.959964, 1) == pytest.approx(0.05, rel=1e-5)
    assert corrected_p(-1.959964, 10) == pytest.approx(0.5, rel=1e-5)
    assert corrected_p(0.5, 100) == 1.0
