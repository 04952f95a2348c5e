"""Ways to learn a reward: features that are left out stay out, signs and penalties are as asked for."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.irl import features
from idm_sumo.irl.learning import Lessons, learn_reward, lessons_of
from idm_sumo.irl.simulation import COLLIDED, RUNNING
from idm_sumo.irl.variants import PAPERS_FEATURES, VARIANTS, Variant, learn_variant
from idm_sumo.runtime.errors import InputError
from tests.helpers.irl_traffic import busy


@pytest.fixture(scope="module")
def lessons() -> Lessons:
    return lessons_of([busy(40, seed=3)])


def test_the_default_is_the_reward_of_the_study(lessons: Lessons) -> None:
    learned, reward = learn_variant(lessons, Variant("as here", demonstrations=20), seed=2)
    report = learn_reward(lessons, most=20, seed=2)
    np.testing.assert_allclose(learned.weights, report.wanted.weights, rtol=1e-9)
    assert (reward.scale, reward.shift) == pytest.approx((report.scale, report.shift), rel=1e-9)


def test_effort_stays_out_of_the_papers_features(lessons: Lessons) -> None:
    for any_sign in (False, True):
        variant = Variant("five", demonstrations=20, use=PAPERS_FEATURES, any_sign=any_sign)
        learned, _ = learn_variant(lessons, variant)
        assert not learned.weights[features.STATE_FEATURES :].any()
        assert learned.weights[: features.STATE_FEATURES].any()
        assert any_sign or learned.weights.min() >= 0.0


def test_the_penalty_is_taken_once_and_only_at_the_end(lessons: Lessons) -> None:
    _, mild = learn_variant(lessons, Variant("mild", demonstrations=20, penalty=3.0))
    steps = np.zeros((2, features.COUNT))
    running, hit = mild.in_training(steps, np.array([RUNNING, COLLIDED]))
    assert running - hit == pytest.approx(3.0)


def test_names_are_different_and_the_first_is_the_studys() -> None:
    assert len({variant.name for variant in VARIANTS}) == len(VARIANTS)
    assert VARIANTS[0] == Variant(VARIANTS[0].name)


def test_drivers_who_stand_teach_nothing(lessons: Lessons) -> None:
    demonstrations = lessons.demonstrations
    standing = demonstrations._replace(state=demonstrations.state * np.array([1.0, 1.0, 1.0, 0.0]))
    with pytest.raises(InputError, match="keeps moving"):
        learn_variant(lessons._replace(demonstrations=standing), Variant("as here"))
