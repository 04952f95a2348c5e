"""The shape that a car-following law lacks, in words."""

from __future__ import annotations

from idm_sumo.diagnosis.settings import SETTINGS

from . import contract as c
from .outcome import Outcome

ALT = "Missing acceleration as colours over gap and speed, and over gap and approach rate"
CAPTION = (
    "The acceleration that the car-following law lacks with the causes in the model, after each driver's own "
    "parameters took what they can, and less what null replicates show. Red: drivers accelerate more, or brake less, "
    "than the law; blue: the other way round. Hatched: within two standard errors of zero. Grey: fewer than five "
    "drivers were there."
)


def lacks(outcome: Outcome) -> str:
    """Return what the law lacks, where it is surest.

    Parameters
    ----------
    outcome : Outcome
        Of a diagnosis.

    Returns
    -------
    str
        Part of a sentence; empty if chance makes as much.
    """
    misfit = outcome.content.law_misfit
    if misfit is None or misfit.surest is None or misfit.p_value > SETTINGS.false_alarms:
        return ""
    cell = misfit.surest
    more = "accelerate more, or brake less," if cell.acceleration_m_s2 > 0.0 else "accelerate less, or brake harder,"
    near, far = cell.gap_m
    return (
        f"{_state(cell)}, with gaps of {near:.0f} to {far:.0f} m, drivers {more} by "
        f"{abs(cell.acceleration_m_s2):.2f} m/s² ({cell.drivers} drivers were there)"
    )


def _state(cell: c.MisfitCell) -> str:
    low, high = cell.x_m_s
    if cell.x_name == "speed":
        return f"at {low:.1f} to {high:.1f} m/s"
    if low >= 0.0:
        return f"closing in by {low:.1f} to {high:.1f} m/s"
    if high <= 0.0:
        return f"falling back by {-high:.1f} to {-low:.1f} m/s"
    return f"falling back by less than {-low:.1f} or closing in by less than {high:.1f} m/s"
