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


def test_a_law_that_is_not_surely_likelier_is_not_taken(monkeypatch):
    windows, _ = followers(law.of(laws.KRAUSS), np.random.default_rng(4))
    base = fit_drivers(windows, ro.PLAIN.copy(), START, rounds=4)
    monkeypatch.setattr(law, "SURE", 1e3)
    found = law.followed(windows, base, np.random.default_rng(1))
    assert found.fit is base
    assert found.likelier is None
    monkeypatch.setattr(law, "SURE", 0.0)
    surely = law.followed(windows, base, np.random.default_rng(1))
    assert law.law_of(surely.fit) == laws.KRAUSS


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
