"""All numbers by which a diagnosis decides."""

from __future__ import annotations

from dataclasses import dataclass
from math import log


@dataclass(frozen=True)
class Settings:
    """Numbers by which a diagnosis decides.

    Attributes
    ----------
    false_alarms : float
        Share of recordings with nothing hidden in which something is claimed by chance; split over families.
    nothing : float
        Prior probability that a further component explains nothing.
    free : float
        Share of the prior of what no effect of the catalogue is.
    spread : float
        Standard deviation of an effect's size among drivers, as a share of its typical size.
    doubt : float
        Standard deviation of the systematic error of a size, as a share of the typical size, and of what another
        effect of imperfect form leaves behind.
    components : int
        Most effects that are looked for at once.
    replicates : int
        Null replicates of each kind.
    folds : int
        Of the drivers, for gains on drivers that did not take part in the estimate.
    gain_level : float
        One-sided confidence with which a cause must have a gain.
    least_drivers : float
        Effective number of drivers below which nothing is claimed.
    """

    false_alarms: float = 0.02
    nothing: float = 0.5
    free: float = 0.1
    spread: float = 0.5
    doubt: float = 0.1
    components: int = 3
    replicates: int = 4
    folds: int = 4
    gain_level: float = 0.9
    least_drivers: float = 5.0

    @property
    def chance(self) -> float:
        """How much likelier chance makes a recording, at the rate of false alarms (a log-likelihood ratio)."""
        return -log(self.false_alarms)


SETTINGS = Settings()
