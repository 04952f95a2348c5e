"""Statements: how sure a size is."""

from __future__ import annotations

import pytest

from idm_sumo.diagnosis.statements import FORM_DOUBT, LAW_DOUBT, form_doubt
from tests.test_diagnosis_gates import evidence


@pytest.mark.parametrize(("delay", "doubt"), [(-6.0, LAW_DOUBT), (-2.0, FORM_DOUBT), (6.0, FORM_DOUBT)])
def test_a_size_is_less_sure_where_drivers_seem_to_act_before_their_leader(delay, doubt):
    assert form_doubt(evidence(delay)) == doubt
