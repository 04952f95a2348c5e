"""Statements: how sure a size is, and of which law the car-following."""

from __future__ import annotations

import pytest

from idm_sumo.diagnosis.statements import FORM_DOUBT, LAW_DOUBT, form_doubt, other_law
from tests.test_diagnosis_gates import evidence


@pytest.mark.parametrize(("delay", "doubt"), [(-6.0, LAW_DOUBT), (-2.0, FORM_DOUBT), (6.0, FORM_DOUBT)])
def test_a_size_is_less_sure_where_drivers_seem_to_act_before_their_leader(delay, doubt):
    assert form_doubt(evidence(delay)) == doubt


@pytest.mark.parametrize(("delay", "said"), [(-6.0, True), (-3.5, False), (6.0, False)])
def test_who_surely_acts_before_the_leader_has_another_law(delay, said):
    law = other_law(evidence(delay))
    assert (law is not None) is said
    if law is not None:
        assert (law.name, law.symbol, law.unit) == ("reaction_delay", "tau", "s")
        assert law.value < 0.0
        assert law.standard_errors == pytest.approx(6.0, rel=0.01)
