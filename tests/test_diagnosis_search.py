"""The search: the cause that drives nearest is chosen."""

from __future__ import annotations

import numpy as np

from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.atoms import Atom
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.luck import Noises
from idm_sumo.diagnosis.search import _strongest
from idm_sumo.diagnosis.sizes import gain_of
from idm_sumo.effects import slots
from tests.test_diagnosis_rollout import QUIET, followers


def candidate(z, name="perception_threshold", value=0.5, fixed=()):
    return Candidate(name, value, 0.01, z, 1e-9, Atom(name, value, fixed), 1.0, 0.0)


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
