"""Effects injected into a recording's own followers: large ones stand out, next to nothing does not, the model's own are left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from idm_sumo.diagnosis.look import Subject

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import injection
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.chance import Noises, draws
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.injection import Laboratory, detectable
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.replicates import make_replicate
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.search import Found
from idm_sumo.runtime.progress import silent
from tests.helpers.followers import followers

MOVING = Noises(Noise(4e-4, np.zeros(0), np.zeros(0)), Noise(0.0, np.array([0.01]), np.array([1.0])))


@pytest.fixture(scope="module")
def searched() -> tuple[Subject, Found]:
    """Return followers without any effect, as a search leaves them that finds nothing."""
    smooth = followers(PLAIN, np.random.default_rng(1))[0]
    one, *chances = draws(smooth, MOVING, 4, np.random.default_rng(0))
    windows = make_replicate(smooth, fit_drivers(smooth, PLAIN.copy(), np.full(2, 1e-4)), one, is_smooth=True)
    subject = Subject(windows, MOVING, rg.grid_of(windows), True)
    fit = fit_drivers(windows, PLAIN.copy(), np.full(2, 1e-3))
    first = ev.examine(subject, fit, chances, progress=silent, stage="")
    return subject, Found(fit, fit, (), (), first, first, ())


@pytest.fixture(scope="module")
def laboratory(searched: tuple[Subject, Found]) -> Laboratory:
    subject, found = searched
    return Laboratory(subject, found.fit, np.random.default_rng(3))


@pytest.mark.parametrize("name", ["reaction_delay", "acceleration_asymmetry", "hysteresis", "perception_threshold"])
def test_twice_the_typical_size_stands_out_and_next_to_nothing_does_not(
    name: str, searched: tuple[Subject, Found], laboratory: Laboratory
) -> None:
    effect = next(one for one in hy.candidates(searched[1].first) if one.name == name)
    large = injection._usual(effect, 2.0, laboratory.looked.regressors)
    tiny = replace(large, value=0.001 * large.value)
    assert laboratory.trial(large, 4).found >= 3
    assert laboratory.trial(tiny, 4).found <= 1


def test_every_effect_that_is_looked_for_is_injected_at_three_sizes_but_those_in_the_model(
    searched: tuple[Subject, Found], monkeypatch: pytest.MonkeyPatch
) -> None:
    subject, found = searched
    monkeypatch.setattr(injection, "with_its_noise", lambda subject, *_: subject)
    every = detectable(subject, found, 1, np.random.default_rng(0), silent)
    names = {one.name for one in every}
    assert names == {one.name for one in hy.candidates(found.first)} - set(ev.ENDOGENOUS)
    assert len(every) == len(injection.MULTIPLES) * len(names)
    assert all(0 <= one.found <= one.of == 1 for one in every)
    again = detectable(subject, found, 1, np.random.default_rng(0), silent)
    assert every == again
