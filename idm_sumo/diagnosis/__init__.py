"""What the simulation gets wrong, and why: :func:`diagnose` a recording."""

from idm_sumo.diagnosis.diagnose import diagnose
from idm_sumo.diagnosis.law_misfit import LawMisfit
from idm_sumo.diagnosis.result import (
    CauseFound,
    Detectable,
    Diagnosis,
    Estimate,
    Gain,
    Law,
    Region,
    RuledOut,
    Scan,
    Unexplained,
)

__all__ = [
    "CauseFound", "Detectable", "Diagnosis", "Estimate", "Gain", "Law", "LawMisfit", "Region", "RuledOut", "Scan",
    "Unexplained", "diagnose",
]  # fmt: skip
