"""The law that drivers follow is found, and the IDM stays where it is no worse."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import law
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from tests.helpers.followers import followers

START = np.array([1e-4, 1e-4])
FORMS = [law.of(number) for number in range(len(laws.NAMES))]


@pytest.mark.parametrize("number", range(len(laws.NAMES)))
def test_drivers_follow_the_law_that_drove_them(number):
    windows, _ = followers(law.of(number), np.random.default_rng(4))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)
    found = law.followed(windows, base, np.random.default_rng(1))
    assert law.law_of(found.fit) == number
    assert (found.fit is base) is (number == laws.IDM)
    assert max(found.by_law, key=lambda name: found.by_law[name].log_likelihood) == laws.NAMES[number]
    assert (found.likelier is None) is (number == laws.IDM)


@pytest.mark.parametrize("reaction", [0.6, 0.9, 1.7])
def test_how_soon_drivers_of_krauss_reach_their_safe_speed(reaction):
    windows, _ = followers(law.of(laws.KRAUSS, reaction), np.random.default_rng(4))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)
    found = law.followed(windows, base, np.random.default_rng(1))
    assert law.law_of(found.fit) == laws.KRAUSS
    assert law.reaction_of(found.fit) == pytest.approx(reaction, rel=0.1)
    assert found.forms[laws.KRAUSS] == pytest.approx(found.fit.by_lane, abs=0.05)


def test_a_law_beneath_effects_keeps_them():
    m = law.of(laws.KRAUSS, 0.6)
    m[:, slots.DELAY] = 0.4
    other = law.beneath(m, law.of(laws.GIPPS))
    assert (other[:, slots.DELAY] == 0.4).all()
    assert (other[:, slots.LAW] == laws.GIPPS).all()
    assert (other[:, slots.REACTION_CHANGE] == 0.0).all()
    assert (m[:, slots.LAW] == laws.KRAUSS).all()


def test_a_law_that_is_not_surely_likelier_is_not_taken(monkeypatch):
    windows, _ = followers(law.of(laws.KRAUSS), np.random.default_rng(4))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=4)
    monkeypatch.setattr(law, "SURE", 1e3)
    found = law.followed(windows, base, np.random.default_rng(1))
    assert found.fit is base
    assert found.likelier is None
    assert found.runner_up == laws.KRAUSS
    monkeypatch.setattr(law, "SURE", 0.0)
    surely = law.followed(windows, base, np.random.default_rng(1))
    assert law.law_of(surely.fit) == laws.KRAUSS
    assert surely.runner_up not in (laws.KRAUSS, None)


def test_of_the_likeliest_laws_all_drivers_decide(monkeypatch):
    """Some drivers asked first, here 8, may say another one."""
    monkeypatch.setattr(law, "SOME", 8)
    windows, _ = followers(law.of(laws.GIPPS), np.random.default_rng(4))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=8)
    asked = list[int]()
    fitted = law.fit_drivers

    def fits(some, by_lane, *given, **more):
        asked.append(int(by_lane[0, slots.LAW])) if some.drivers > 8 else None
        return fitted(some, by_lane, *given, **more)

    monkeypatch.setattr(law, "fit_drivers", fits)
    found = law.followed(windows, base, np.random.default_rng(1))
    assert 1 <= len(asked) <= law.FITTED_TO_ALL
    assert law.law_of(found.fit) == laws.GIPPS in asked


def test_effects_act_on_top_of_each_law():
    for number in range(len(laws.NAMES)):
        m = law.of(number)
        windows, theta = followers(m, np.random.default_rng(4))
        longer = m.copy()
        longer[:, slots.PERIOD], longer[:, slots.PERIOD_END] = 0.3, 1e6
        behind = ro.positions(windows, theta, longer) - ro.positions(windows, theta, m)
        assert behind.mean() < -0.5


def test_another_law_with_its_causes_has_the_one_that_drove_for_a_rival_and_that_has_none():
    longer_at_speed = law.of(laws.FULL_VELOCITY_DIFFERENCE)
    longer_at_speed[:, slots.SPEED_HEADWAY], longer_at_speed[:, slots.PIVOT_SPEED] = 0.6, 9.0
    windows, _ = followers(longer_at_speed, np.random.default_rng(4))
    by_another = law.of(laws.KRAUSS)
    by_another[:, slots.SPEED_HEADWAY], by_another[:, slots.PIVOT_SPEED] = 0.4, 9.0
    for begin, rival in ((by_another, laws.FULL_VELOCITY_DIFFERENCE), (longer_at_speed, None)):
        fit = fit_drivers(windows, begin, START, rounds=8)
        assert law.rival(windows, fit, ["speed_dependent_headway"], FORMS, np.random.default_rng(1)) == rival


@pytest.mark.parametrize(
    ("some", "everybody", "rival"),
    [
        ((0.9, 1.1), (0.9, 1.1), laws.KRAUSS),
        ((-3.0, 3.5), (0.9, 1.1), laws.KRAUSS),
        ((-3.0, 3.5), (-3.0, 3.5), None),
        ((0.9, 1.1), (-1.1, -0.9), None),  # some were, all are not
        ((-1.1, -0.9), None, None),  # no law is likelier than their own: nobody else is asked
    ],
)
def test_all_drivers_are_asked_of_a_law_that_is_likelier_for_some(monkeypatch, some, everybody, rival):
    monkeypatch.setattr(law, "SOME", 10)
    windows, _ = followers(ro.PLAIN, np.random.default_rng(4))
    fit = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=0)
    asked = list[int]()

    def likelihoods(of, _fit, _names, form):
        asked.append(of.drivers)
        low, high = some if of.drivers == 10 else everybody
        own = np.tile([low, high], of.drivers // 2)
        return {laws.IDM: 0.0 * own, laws.KRAUSS: own}.get(int(form[0, slots.LAW]), own - 99.0)

    monkeypatch.setattr(law, "_likeliest_size", likelihoods)
    assert law.rival(windows, fit, [], FORMS, np.random.default_rng(1)) == rival
    assert (max(asked) > 10) is (everybody is not None)
