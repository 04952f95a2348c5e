"""Gates of the search: what is sure needs less gain, what comes further needs more."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.atoms import Atom
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.luck import Noises
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import _stands_out, _strongest, _worth_it
from idm_sumo.diagnosis.sizes import gain_of
from idm_sumo.effects import slots
from tests.test_diagnosis_rollout import QUIET, followers


def gain(difference, margin):
    return Gain("ade_m", 1.0, 1.0 - difference, difference, (difference - margin, difference + margin), 100, False)


def candidate(z, name="perception_threshold", value=0.5, fixed=()):
    return Candidate(name, value, 0.01, z, 1e-9, Atom(name, value, fixed), 1.0, 0.0)


@pytest.mark.parametrize(
    ("difference", "margin", "z", "first", "further"),
    [
        (0.02, 0.01, 3.0, True, True),  # clearly better
        (0.02, 0.025, 3.0, False, True),  # nine to one
        (0.02, 0.04, 3.0, False, False),
        (0.001, 0.04, 5.0, True, False),  # surely there, and no worse
        (-0.005, 0.04, 5.0, False, False),
        (-0.005, 0.04, 9.0, True, False),  # beyond doubt, and no worse than chance
        (-0.05, 0.01, 9.0, False, False),
    ],
)
def test_what_is_sure_needs_less_gain_and_what_comes_further_more(difference, margin, z, first, further):
    one = candidate(z)
    assert _worth_it(gain(difference, margin), one, further=False) is first
    assert _worth_it(gain(difference, margin), one, further=True) is further


@pytest.mark.parametrize(("difference", "accepted"), [(0.01, False), (0.03, True)])
def test_what_has_no_null_twin_must_gain_more(difference, accepted):
    pressed = candidate(9.0, "follower_pressure")
    assert _worth_it(gain(difference, 0.005), pressed, further=False) is accepted
    assert _worth_it(gain(0.01, 0.005), candidate(9.0), further=False)


@pytest.mark.parametrize(
    ("covariate", "z", "stands_out"),
    [
        ("position", 6.0, True),
        ("position", 5.0, False),
        ("delay over position in lane 2", 6.0, False),  # a response that changes: most looks
        ("delay over time", 7.0, True),
        ("headway over leader_gap", 7.0, False),  # another car-following model looks like it
        ("headway over leader_gap", 9.5, True),
    ],
)
def test_what_is_looked_at_more_must_stand_out_more(covariate, z, stands_out):
    assert _stands_out(LeftOver(covariate, (0.0, 1.0), None, None, 0.2, -z, 1e-9, True)) is stands_out
    assert not _stands_out(LeftOver(covariate, (0.0, 1.0), None, None, 0.2, z, 1e-9, False))


def test_the_cause_that_drives_clearly_nearer_is_chosen():
    m = ro.PLAIN.copy()
    m[:, slots.BAND] = 1.0
    windows, _ = followers(m, np.random.default_rng(5))
    base = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=8)
    subject = Subject(windows, Noises(QUIET, QUIET), at.grid_of(windows), True)
    right = candidate(9.0, "perception_threshold", 0.8, ((slots.BAND, 0.6),))
    wrong = candidate(9.0, "acceleration_asymmetry", 0.3)
    rng = np.random.default_rng(0)
    best, _ = _strongest(subject, base, [wrong, right], rng)
    assert best.candidate.name == "perception_threshold"
    assert gain_of(subject, base, best.fit, rng).ci95[0] > 0.0
