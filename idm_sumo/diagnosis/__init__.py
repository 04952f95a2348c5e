"""What the simulation gets wrong, and why: :func:`diagnose` a recording."""

from idm_sumo.diagnosis.result import (
    CauseFound,
    Diagnosis,
    Estimate,
    Gain,
    Law,
    OtherLaw,
    Power,
    Region,
    RuledOut,
    Scan,
    Unexplained,
)

__all__ = [
    "CauseFound", "Diagnosis", "Estimate", "Gain", "Law", "OtherLaw", "Power", "Region", "RuledOut", "Scan", "Unexplained", "diagnose",
]  # fmt: skip
