"""Errors of the measurement that look like behaviour.

Examples are camera seams, stops, vehicle lengths and smoothing. They have no term in the
acceleration; :mod:`idm_sumo.diagnosis` tests for them first.
"""

from __future__ import annotations

from idm_sumo.models.effects.record import Effect
from idm_sumo.models.effects.telling import Median, Telling, Values


def _size(values: Values, _one: Median) -> str:
    return f"{abs(values['shift']):.2f} m"


EFFECT = Effect(
    name="measurement_artefact",
    summary="errors of the measurement, fixed to places, stops or lengths",
    parameters=(),
    required_stimuli=("x",),
    confusable_with=("location", "multi_leader_anticipation", "leader_class"),
    source="Montanino and Punzo (2015); Coifman and Li (2017), A critical evaluation of NGSIM",
    told=(
        Telling(
            "shift",
            more="do not cause this: recorded positions jump ahead at one place",
            less="do not cause this: recorded positions jump back at one place",
            when="where two cameras meet",
            size=_size,
            advice="Repair the positions beyond this place before calibrating.",
        ),
    ),
)
