"""Effects injected into a recording's own followers: large ones win, next to nothing does not, the model's own are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import columns as co
from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import injection
from idm_sumo.diagnosis import selection as se
from idm_sumo.diagnosis.chance import Noises, draws
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.injection import Injection, detectable
from idm_sumo.diagnosis.library import library_of
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.replicates import make_replicate
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.search import Found, Look
from idm_sumo.diagnosis.settings import SETTINGS
from idm_sumo.models.effects import BY_NAME
from idm_sumo.runtime.progress import silent
from tests.helpers.followers import followers

MOVING = Noises(Noise(4e-4, np.zeros(0), np.zeros(0)), Noise(0.0, np.array([0.01]), np.array([1.0])))


@pytest.fixture(scope="module")
def searched() -> tuple[ev.Subject, Found]:
    """Return followers without any effect, as a search leaves them that finds nothing."""
    smooth = followers(PLAIN, np.random.default_rng(1))[0]
    one, *chances = draws(smooth, MOVING, 5, np.random.default_rng(0))
    windows = make_replicate(smooth, fit_drivers(smooth, PLAIN.copy(), np.full(2, 1e-4)), one, is_smooth=True)
    subject = ev.Subject(windows, MOVING, True)
    fit = fit_drivers(windows, PLAIN.copy(), np.full(2, 1e-3))
    plan = co.plan_of(windows, fit, free=False)
    evidence = ev.examine(subject, fit, plan, chances)
    library = library_of(plan, SETTINGS)
    selection = se.compete(evidence, library, SETTINGS, evidence.score)
    look = Look(fit, (), evidence, library, evidence.score, selection, SETTINGS)
    return subject, Found(fit, look, look, SETTINGS)


@pytest.mark.parametrize("name", ["reaction_delay", "acceleration_asymmetry", "hysteresis", "perception_threshold"])
def test_twice_the_typical_size_wins_and_next_to_nothing_does_not(
    name: str, searched: tuple[ev.Subject, Found]
) -> None:
    subject, found = searched
    large = injection._usual(found.last, name, 2.0)
    tiny = replace(large, value=0.001 * large.value)
    chances = draws(subject.windows, subject.noises, 4, np.random.default_rng(3))

    def share(effect: injection.Placed) -> int:
        trial = Injection(subject, found.last, effect)
        return sum(trial.finds(chance) for chance in chances)

    assert share(large) >= 3
    assert share(tiny) <= 1


def test_every_effect_that_is_looked_for_is_injected_at_three_sizes(searched: tuple[ev.Subject, Found]) -> None:
    subject, found = searched
    every = detectable(subject, found, 1, np.random.default_rng(0), silent)
    names = {one.name for one in every}
    assert names == {name for name in found.last.library.names if name in BY_NAME}
    assert len(every) == len(injection.MULTIPLES) * len(names)
    assert all(0 <= one.found <= one.of == 1 for one in every)
    assert every == detectable(subject, found, 1, np.random.default_rng(0), silent)
    assert detectable(subject, found, 0, np.random.default_rng(0), silent) == ()
