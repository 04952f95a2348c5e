"""Settings of a run of the study, from TOML files."""

from __future__ import annotations

from dataclasses import asdict, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from idm_sumo.runtime import limits
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import read_toml
from idm_sumo.scenes.windows import Window
from idm_sumo.sumo.surrogate import SURROGATE

DEFAULT_RUN = Path(__file__).parents[2] / "runs" / "paper.toml"  # at the same relative place in a clone and in a wheel

NEIGHBOUR_COUNTS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 35, 40, 45, 50)

# Texts and truth values are no numbers, though they could be taken for such.
Whole = Annotated[int, Field(strict=True)]
Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Neighbours = Annotated[Whole, Field(ge=limits.NEIGHBOURS[0], le=limits.NEIGHBOURS[1])]
Frames = Annotated[Whole, Field(ge=limits.OBSERVED[0], le=limits.OBSERVED[1])]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Settings:
    """A run of the study.

    Attributes
    ----------
    recordings : tuple of str
        Files, or ``"surrogate"`` for the built-in recording.
    train, test : tuple of str
        Labels of recording periods; if empty, the first period trains and all later ones test.
    observed : int
        Observed frames of a test driver.
    horizon : int
        Simulated frames, 0.1 s each.
    rollout_start : str
        ``"observed"`` starts the simulation at the last observed frame, ``"entry"`` at the first.
    neighbours : int
        ``k`` of the nearest neighbours.
    code_speed : str
        The driving code's speed: ``"own"``, or ``"relative"`` to the leader.
    desired_speed : float, optional
        Desired speed (m/s); by default the road's speed limit.
    frame_counts : tuple of int
        Observed frames in the rows of the table of frames.
    neighbour_counts : tuple of int
        Neighbours in the rows of the table of neighbours.
    backend : str
        ``"sumo"`` or ``"kernel"``, which drives the vehicles of the table of methods.
    agent_seeds : int
        Number of agents (IRL + PPO) and clones to train, from ``seed`` on; 0 for none.
    agent_steps : int
        Environment steps of each agent's training.
    agent_demonstrations : int
        Largest number of drivers from which the agents' reward is learned.
    agent : str
        Folder of ``idm-sumo irl train`` whose agents are driven; empty to train them.
    max_drivers : int or None
        Largest number of drivers on each side, drawn at random.
    minutes : float
        Length of the built-in recording (min).
    seed : int
        For the built-in recording and all random draws.
    title : str
        Title of the report; empty for the default.
    """

    recordings: tuple[str, ...] = Field(default=(SURROGATE,), min_length=1)
    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    observed: Whole = Field(default=10, ge=limits.OBSERVED[0], le=limits.OBSERVED[1])
    horizon: Whole = Field(default=100, ge=10, le=limits.FRAMES[1])
    rollout_start: Literal["observed", "entry"] = "observed"
    neighbours: Neighbours = 8
    code_speed: Literal["own", "relative"] = "own"
    desired_speed: Real | None = Field(default=None, ge=limits.DESIRED_SPEED[0], le=limits.DESIRED_SPEED[1])
    frame_counts: Annotated[tuple[Frames, ...], Field(min_length=1)] = (2, 4, 6, 10, 20)
    neighbour_counts: Annotated[tuple[Neighbours, ...], Field(min_length=1)] = NEIGHBOUR_COUNTS
    backend: Literal["sumo", "kernel"] = "sumo"
    agent_seeds: Whole = Field(default=3, ge=0, le=limits.COUNT[1])
    agent_steps: Whole = Field(default=1_200_000, ge=1, le=limits.COUNT[1])
    agent_demonstrations: Whole = Field(default=200, ge=1, le=limits.COUNT[1])
    agent: str = ""
    max_drivers: Whole | None = Field(default=None, ge=2, le=limits.COUNT[1])
    minutes: Real = Field(default=45.0, ge=limits.MINUTES[0], le=limits.MINUTES[1])
    seed: Whole = Field(default=1, ge=limits.SEED[0], le=limits.SEED[1])
    title: str = field(default="")

    @property
    def window(self) -> Window:
        """Observed and simulated frames of a driver."""
        return Window(observed=self.observed, horizon=self.horizon, from_entry=self.rollout_start == "entry")

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for the manifest.

        Returns
        -------
        dict
            Values by attribute.
        """
        return asdict(self)


def load_settings(path: Path | None, overrides: dict[str, Any]) -> Settings:
    """Read a run file and apply the command line's options.

    Parameters
    ----------
    path : Path or None
        TOML file; None for the defaults.
    overrides : dict
        Values by attribute that replace those of the file; None for no change.

    Returns
    -------
    Settings
        Checked settings.

    Raises
    ------
    InputError
        If the file is missing or not TOML, or has an unknown key or a value out of range; names it.
    """
    values = read_toml(path, "name a run file such as runs/paper.toml") if path else {}
    values.update({key: value for key, value in overrides.items() if value is not None})
    try:
        return TypeAdapter(Settings).validate_python(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        hint = (
            f"; known keys: {', '.join(Settings.__dataclass_fields__)}"
            if first["type"] == "unexpected_keyword_argument"
            else ""
        )
        raise InputError(f"{path or 'command line'}: key {key!r}: {first['msg'].lower()}{hint}") from None
