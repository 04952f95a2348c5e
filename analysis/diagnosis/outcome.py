"""What a diagnosis came to, as one object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from idm_sumo.calibration.identifiability import at_bound
from idm_sumo.diagnosis import Diagnosis
from idm_sumo.models.effects import BY_NAME, Cause, ExtendedModel
from idm_sumo.models.effects.telling import Median, Telling

from . import contract as c
from .content import Range, contract, extent

FITTED = ("a", "b", "T", "d0")  # of the drivers' own parameters; a diagnosis leaves d1 at zero
COLLISIONS = "collisions"


@dataclass(frozen=True)
class Outcome:
    """A diagnosis by its contract, models and drivers.

    Attributes
    ----------
    content : contract.Diagnosis
        Content of ``diagnosis.json``.
    model, base : ExtendedModel
        With and without the named causes.
    drivers : pandas.DataFrame
        One row a driver, as in ``tables/drivers.csv``.
    collisions : (float, float) or None
        Share of windows with a collision, base and extended; None where it was not measured.
    whole : dict of str to (float, float)
        Extent of what was seen: ``position`` (m), ``time`` (s).
    speeds : (float, float)
        Between which most of the driving was (m/s).
    notes : tuple of str
        What a reader must know of the data.
    """

    content: c.Diagnosis
    model: ExtendedModel
    base: ExtendedModel
    drivers: pd.DataFrame
    collisions: tuple[float, float] | None
    whole: dict[str, Range]
    speeds: Range
    notes: tuple[str, ...]

    @property
    def windows(self) -> int:
        """Number of windows."""
        return int(self.drivers["windows"].sum()) if len(self.drivers) else 0

    @property
    def median(self) -> Median:
        """The base model's median driver."""
        return Median(self.base.parameters.T, self.base.parameters.d0, self.base.desired_speed)

    def bounded(self, name: str, interval: Range | None) -> Range | None:
        """Return an interval unless it is all that was seen.

        Parameters
        ----------
        name : str
            ``position`` or ``time``.
        interval : (float, float) or None
            From the contract, which has no open ends.

        Returns
        -------
        (float, float) or None
            The interval, None for everywhere or always.
        """
        return None if interval is None or tuple(interval) == self.whole[name] else (interval[0], interval[1])

    def modelled(self, cause: c.Cause) -> Cause | None:
        """Return a cause as the extended model has it.

        Parameters
        ----------
        cause : contract.Cause
            Named or without gain.

        Returns
        -------
        Cause or None
            None if the model does not have it.
        """
        return next((one for one in self.model.causes if one.name == cause.name), None)

    def drivers_at_bound(self) -> dict[str, float]:
        """Return the share of drivers at a bound.

        Returns
        -------
        dict of str to float
            By symbol, and of any of them as ``any``; empty without drivers.
        """
        if not len(self.drivers) or not {*FITTED} <= {*self.drivers.columns}:
            return {}
        theta = self.drivers.reindex(columns=[*FITTED, "d1"], fill_value=0.0).to_numpy(np.float64)
        reached = at_bound(theta[np.isfinite(theta).all(axis=1)])[:, : len(FITTED)]
        if not len(reached):
            return {}
        return dict(zip(FITTED, reached.mean(axis=0).tolist(), strict=True)) | {
            "any": float(reached.any(axis=1).mean())
        }


def outcome_of(found: Diagnosis) -> Outcome:
    """Return a diagnosis as its outcome.

    Parameters
    ----------
    found : Diagnosis
        What the finder returns.

    Returns
    -------
    Outcome
        From which the page is made.
    """
    speed = found.residuals["speed"].dropna().to_numpy(np.float64) if len(found.residuals) else np.zeros(0)
    low, high = np.quantile(speed, [0.1, 0.9]) if len(speed) else (0.0, 0.0)
    crashed = next((one for one in found.other_gains if one.metric == COLLISIONS), None)
    return Outcome(
        content=c.Diagnosis.model_validate(contract(found)),
        model=found.model,
        base=found.base_model,
        drivers=found.drivers,
        collisions=None if crashed is None else (crashed.base, crashed.extended),
        whole=extent(found),
        speeds=(float(low), float(high)),
        notes=tuple(found.notes),
    )


def told(cause: c.Cause) -> Telling | None:
    """Return how a cause is told, by its magnitude.

    Parameters
    ----------
    cause : contract.Cause
        Named or without gain.

    Returns
    -------
    Telling or None
        None for an effect without words of its own.
    """
    effect = BY_NAME.get(cause.name)
    return next((one for one in effect.told if one.symbol in cause.parameters), None) if effect else None
