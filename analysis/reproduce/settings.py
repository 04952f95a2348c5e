"""What one run of the study is: a frozen record, read from a TOML file of `runs/`."""

from __future__ import annotations

import tomllib
from dataclasses import asdict, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from idm_sumo.roads.road import SPEED_LIMIT
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window
from idm_sumo.sumo.surrogate.builtin import SURROGATE

DEFAULT_RUN = Path(__file__).parents[2] / "runs" / "paper.toml"  # beside us in a clone and in a wheel


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Settings:
    """A run of the study.

    Attributes
    ----------
    recordings : tuple of str
        Files, or ``"surrogate"`` for the built-in recording.
    train, test : tuple of str
        Labels of recording periods; empty for the first period and all later ones.
    observed : int
        Frames of a test driver that the driving code sees.
    horizon : int
        Simulated frames, 0.1 s each.
    rollout_start : str
        ``"observed"`` starts the simulation at the last observed frame, ``"entry"`` at the first.
    neighbours : int
        ``k`` of the nearest neighbours.
    code_speed : str
        The driving code's speed: ``"own"``, or ``"relative"`` to the leader.
    desired_speed : float
        m/s, the speed limit.
    feature_sets, frame_counts, neighbour_counts
        Rows of the tables.
    backend : str
        What drives the vehicles of the table of methods.
    agent_seeds : int
        Agents (IRL + PPO) and clones to train, with ``seed`` and the next ones; 0 for none.
    agent_steps : int
        Environment steps of each agent's training.
    agent_demonstrations : int
        Drivers at most that the agents' reward is learned from.
    agent : str
        Folder of ``idm-sumo irl train`` whose agents are driven; empty to train them.
    max_drivers : int or None
        At most so many drivers on each side, drawn with ``seed``.
    minutes : float
        Length of the built-in recording.
    seed : int
        Of the built-in recording and of every draw.
    """

    recordings: tuple[str, ...] = (SURROGATE,)
    train: tuple[str, ...] = ()
    test: tuple[str, ...] = ()
    observed: int = Field(default=10, ge=2)
    horizon: int = Field(default=100, ge=10)
    rollout_start: Literal["observed", "entry"] = "observed"
    neighbours: int = Field(default=8, ge=1)
    code_speed: Literal["own", "relative"] = "own"
    desired_speed: float = Field(default=SPEED_LIMIT, gt=0)
    frame_counts: tuple[int, ...] = (2, 4, 6, 10, 20)
    neighbour_counts: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30, 35, 40, 45, 50)
    backend: Literal["sumo", "kernel"] = "sumo"
    agent_seeds: int = Field(default=3, ge=0)
    agent_steps: int = Field(default=1_200_000, ge=1)
    agent_demonstrations: int = Field(default=200, ge=1)
    agent: str = ""
    max_drivers: int | None = Field(default=None, ge=2)
    minutes: float = Field(default=45.0, gt=0)
    seed: int = 1
    title: str = field(default="")

    @property
    def window(self) -> Window:
        """Observed and simulated frames."""
        return Window(observed=self.observed, horizon=self.horizon, from_entry=self.rollout_start == "entry")

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for the manifest."""
        return asdict(self)


def load_settings(path: Path | None, overrides: dict[str, Any]) -> Settings:
    """Read a run file and apply what the command line says on top.

    Raises
    ------
    InputError
        If the file is missing, is not TOML, has an unknown key or an impossible value; names it.
    """
    values = _read_toml(path) if path else {}
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


def _read_toml(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as stream:
            return tomllib.load(stream)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); name a run file such as runs/paper.toml"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is not TOML: {error}") from None
