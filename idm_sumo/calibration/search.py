"""How the minimum of a calibration is searched."""

from __future__ import annotations

from dataclasses import dataclass

from idm_sumo.runtime.errors import InputError

GAUSS_NEWTON, L_BFGS_B = SOLVERS = ("gauss-newton", "l-bfgs-b")


@dataclass(frozen=True)
class Search:
    """Solver of a calibration, and where it starts.

    Attributes
    ----------
    solver : {"gauss-newton", "l-bfgs-b"}
        Ours (:mod:`idm_sumo.calibration.solver`), or the paper's.
    starts : int, optional
        Starts that ours screens (by default 64), or that L-BFGS-B goes through (10).
    seed : int
        Of L-BFGS-B's random starts; ours draws nothing.

    Raises
    ------
    InputError
        For an unknown solver, or no start at all.
    """

    solver: str = GAUSS_NEWTON
    starts: int | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        """Check both."""
        if self.solver not in SOLVERS:
            raise InputError(f"solver: {self.solver!r} is unknown; use one of {', '.join(SOLVERS)}")
        if self.starts is not None and self.starts < 1:
            raise InputError(f"starts: {self.starts} is too few; give 1 or more")
