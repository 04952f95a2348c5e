"""Effects are put into the model at the size at which driven vehicles are likeliest."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import driving as dr
from idm_sumo.diagnosis import plan as pl
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.model import Placed
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.models.effects import BY_NAME
from tests.helpers.followers import followers

START = np.array([0.01, 0.01])


def placed(name: str, share: float) -> Placed:
    """Return an effect's first form at a share of its typical size."""
    form = BY_NAME[name].forms[0]
    return Placed(name, form, {}, 0, share * BY_NAME[name].parameters[0].typical)


@pytest.fixture(scope="module")
def late() -> dr.Road:
    """Return drivers with a delay of twice the typical size, and an IDM fitted to them."""
    by_lane = PLAIN.copy()
    by_lane[:, BY_NAME["reaction_delay"].parameters[0].slot] = 0.8
    windows, _ = followers(by_lane, np.random.default_rng(5))
    windows.seen[:, w.X] += 0.05 * np.random.default_rng(6).standard_normal(windows.seen[:, w.X].shape)
    base = fit_drivers(windows, PLAIN.copy(), START)
    return dr.Road(windows, base, pl.Plan((), 10.0, (1,), (0.0, 60.0)))


@pytest.mark.parametrize("top", [0.02, 0.15, 0.4, 1.3, 2.4, -0.3])
def test_a_size_is_where_the_curve_has_its_top(top):
    curve = dr._climbed(lambda size: 200.0 * (top**2 - (size - top) ** 2), placed("hysteresis", np.sign(top)))
    first = BY_NAME["hysteresis"].parameters[0]
    assert max(curve, key=lambda size: curve[size]) == pytest.approx(np.clip(top, first.lower, first.upper), abs=0.01)


def test_a_size_stays_within_its_bounds():
    tried = dr._climbed(lambda size: size, placed("hysteresis", 1.0))
    first = BY_NAME["hysteresis"].parameters[0]
    assert max(tried) == first.upper
    assert min(tried) >= first.lower


def test_a_slope_of_the_replicates_moves_the_size_by_as_much_as_its_variance():
    curve, one = lambda size: -200.0 * (size - 0.3) ** 2, placed("hysteresis", 1.0)  # variance 1/400
    with_slope = dr._climbed(lambda size: curve(size) - curve(0.0) - 20.0 * size, one)
    best = max(with_slope, key=lambda size: with_slope[size])
    assert best == pytest.approx(0.3 - 20.0 / 400.0, abs=0.01)


def test_a_large_delay_is_found_at_its_size_though_drivers_without_one_were_fitted(late):
    without = late.driven(())[0]
    found = late.sized((), placed("reaction_delay", 0.3), 0.0, without)
    assert found.last.value == pytest.approx(0.8, rel=0.1)
    assert found.total > 50.0


def test_what_is_not_there_has_no_support(late):
    beside = placed("reaction_delay", 2.0)
    without = late.driven((beside,))[0]
    found = late.sized((beside,), placed("hysteresis", 0.5), 0.0, without)
    assert found.total < 4.0


def test_sizes_that_hide_each_other_are_moved_together(late):
    low = [placed("reaction_delay", 1.7), placed("hysteresis", 0.1)]
    _, moved = late.together(low, [0.0, 0.0])
    assert moved[0].value > low[0].value
