"""Settings of a closed loop, and one run of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from idm_sumo.calibration.whole import OTHER_LAWS
from idm_sumo.sumo.closed_loop.extended_loop import ModelDrivers
from idm_sumo.sumo.closed_loop.populations import DEFAULTS
from idm_sumo.sumo.closed_loop.run import RunFiles
from idm_sumo.sumo.surrogate import SURROGATE

from .populations import CALIBRATED

POPULATIONS = (*CALIBRATED, *DEFAULTS)
EXTENDED = "extended"  # the drivers with the causes of a model, driven by our own loop
# The same loop without the causes: it lacks what SUMO's lane changing does to speeds, so only this is comparable.
LOOPS = ("own-loop", EXTENDED)
FITTED = {law: f"fitted-{law}" for law in OTHER_LAWS}  # drivers fitted by another of SUMO's models
OF_LAWS = {population: law for law, population in FITTED.items()}
RESIDUAL = "residual"  # the pooled driver and a predicted residual, driven by our own loop


@dataclass(frozen=True)
class Settings:
    """What a closed loop is asked to be.

    Attributes
    ----------
    recording : str
        A file, or ``surrogate``.
    period : str or None
        The first by default.
    drivers : Path or None
        A driver table; calibrated in the run by default.
    types : tuple of str
        Populations to run, keys of ``OF_LAWS`` among them; ``residual`` needs a driver table of
        ``predict --method residual``.
    refit : bool
        Whether drivers calibrated in the run are fitted again without ``d1``; else it is linearised.
    lane_change_model : str
    lane_change : dict of str to str
        Parameters of it.
    fit_lane_change : bool
        Whether the others are fitted to the recorded lane changes.
    ego : int or None
        A vehicle we drive.
    gui : bool
    downstream_speed : bool
        Whether the recorded speeds at the end of the section are imposed behind it.
    place_speeds : bool
        Whether nobody wants to drive faster at a place than drivers did there whom no leader held up.
    seeds : int
        Runs of each population, with ``seed``, ``seed + 1``, ...
    bias_sample : int
        Vehicles of the replay bias; 0 leaves it out.
    minutes : float
        Of the built-in recording.
    location : str
    seed, jobs : int
    cluster : str or None
        Address of a dask scheduler whose workers run populations and seeds, in place of ``jobs`` processes.
    model : Path or None
        An extended model, for the populations ``own-loop`` (its causes left out) and ``extended``.
    """

    recording: str = SURROGATE
    period: str | None = None
    drivers: Path | None = None
    types: tuple[str, ...] = POPULATIONS
    refit: bool = False
    lane_change_model: str = "LC2013"
    lane_change: Mapping[str, str] | None = None
    fit_lane_change: bool = False
    ego: int | None = None
    gui: bool = False
    downstream_speed: bool = True
    place_speeds: bool = True
    seeds: int = 1
    bias_sample: int = 150
    minutes: float = 45.0
    location: str = "us-101"
    seed: int = 1
    jobs: int | None = None
    cluster: str | None = None
    model: Path | None = None

    @property
    def laws(self) -> tuple[str, ...]:
        """Laws by which drivers are fitted, beside the IDM."""
        return tuple(OF_LAWS[population] for population in self.types if population in OF_LAWS)


@dataclass(frozen=True)
class Case:
    """One run: a population with a seed."""

    population: str
    seed: int
    files: RunFiles
    pooled: int  # vehicles that drive by the pooled parameters
    ours: ModelDrivers | None = None  # who drives in place of SUMO's types

    @property
    def name(self) -> str:
        """How it is called in tables."""
        return self.population if self.seed == 0 else f"{self.population}, seed {self.seed}"
