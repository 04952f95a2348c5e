"""From a recording to its diagnosis: what the law, asked once more, makes of causes."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from idm_sumo import laws
from idm_sumo.diagnosis import atoms as at
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import fit_drivers
from idm_sumo.diagnosis.law import Followed
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.luck import Noises
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.search import Found
from idm_sumo.diagnosis.sizes import Tried, with_cause
from tests.test_diagnosis_choice import candidate
from tests.test_diagnosis_gates import evidence
from tests.test_diagnosis_rollout import QUIET, followers

diagnosing = sys.modules["idm_sumo.diagnosis.diagnose"]  # the package's name is that of the function


@pytest.mark.parametrize(
    ("names_again", "likelier", "outcome"),
    [
        (False, 0.2, "without gain"),  # another law, no cause, and likelier
        (False, -0.2, "named"),
        (True, 0.2, "named"),  # beyond the other law, too
        (True, 5.0, "again"),  # surely likelier
    ],
)
def test_what_is_named_beyond_one_law_and_not_beyond_a_likelier_one_is_no_cause(
    monkeypatch, names_again, likelier, outcome
):
    windows, _ = followers(ro.PLAIN, np.random.default_rng(5))
    fit = fit_drivers(windows, ro.PLAIN.copy(), np.array([1e-4, 1e-4]), rounds=1)
    subject = Subject(windows, Noises(QUIET, QUIET), at.grid_of(windows), True)
    tried = Tried(candidate(6.0), with_cause(fit, candidate(6.0)), 60.0)
    cause = Accepted(tried, 0.5, 0.01, Gain("ade_m", 1.0, 0.99, 0.01, (0.0, 0.02), 10, False), ())
    found = Found(fit, tried.fit, (cause,), (), evidence(0.0), evidence(0.0), ())
    again = replace(found, fit=fit, accepted=(cause,) if names_again else ())
    monkeypatch.setattr(diagnosing.law, "rival", lambda *_: laws.KRAUSS)
    monkeypatch.setattr(diagnosing, "search", lambda *_: again)
    gain = Gain("unlikelihood", 10.0, 10.0 - likelier, likelier, (likelier - 2.0, likelier + 2.0), 10, False)
    monkeypatch.setattr(diagnosing.law, "likelihood_gain", lambda *_: gain)
    followed = Followed(fit, None, {})
    _, after = diagnosing._by_the_law_with_causes(
        subject, followed, fit, found, np.random.default_rng(0), lambda *_: None
    )
    if outcome == "without gain":
        assert after.fit is found.base
        assert not after.accepted
        assert [one.name for one in after.without_gain] == ["perception_threshold"]
    else:
        assert after is (again if outcome == "again" else found)
