"""Why the population stands in for a driver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

OK, NO_LEADER, ONE_FRAME, STANDING, OUTSIDE, FEW = (
    "ok", "population: no leader seen", "population: one frame only", "population: standing",
    "population: outside the training range", "population: too few training drivers",
)  # fmt: skip
STANDING_SPEED = 0.5  # m/s
OUTSIDE_MARGIN = 0.25  # of the training range, beyond its ends
FEWEST_DRIVERS = 10


@dataclass(frozen=True)
class Familiar:
    """What first seconds the training drivers had.

    Attributes
    ----------
    low, high : float64, shape (10,)
        Range of the columns of :func:`~idm_sumo.prediction.observation.first_second`.
    drivers : int
        Learned from.
    """

    low: Floats
    high: Floats
    drivers: int

    @classmethod
    def fit(cls, codes: Floats, drivers: int) -> Familiar:
        """Remember the range.

        Parameters
        ----------
        codes : float64, shape (windows, 10)
        drivers : int

        Returns
        -------
        Familiar
        """
        low, high = np.nanmin(codes, axis=0), np.nanmax(codes, axis=0)
        margin = OUTSIDE_MARGIN * (high - low) + 1e-9  # what never varied differs by rounding
        return cls(low - margin, high + margin, drivers)

    def status(self, codes: Floats) -> npt.NDArray[np.str_]:
        """Return "ok", or why the population stands in.

        Parameters
        ----------
        codes : float64, shape (drivers, 10)

        Returns
        -------
        str, shape (drivers,)
        """
        reasons = self._reasons(codes)
        return np.asarray(np.select(list(reasons.values()), list(reasons), default=OK), dtype=np.str_)

    def known(self, codes: Floats) -> Mask:
        """Return which drivers can be predicted.

        Parameters
        ----------
        codes : float64, shape (drivers, 10)

        Returns
        -------
        bool, shape (drivers,)
        """
        return np.asarray(~np.any(list(self._reasons(codes).values()), axis=0))

    def _reasons(self, codes: Floats) -> dict[str, Mask]:
        filled = np.nan_to_num(codes)
        outside = (filled < np.minimum(self.low, 0.0)) | (filled > self.high)
        return {
            FEW: np.full(len(codes), self.drivers < FEWEST_DRIVERS),
            NO_LEADER: ~np.isfinite(codes[:, 1]),
            ONE_FRAME: ~np.isfinite(codes[:, 3]),
            STANDING: codes[:, 0] < STANDING_SPEED,
            OUTSIDE: np.asarray(outside.any(axis=1)),
        }
