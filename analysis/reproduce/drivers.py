"""Drivers of one side of the study, over several periods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation import metrics
from idm_sumo.prediction.driving_code import driving_code
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.rollout import Trajectories, drive_idm

Drive = Callable[[Scenes, npt.NDArray[np.float64]], Trajectories]


@dataclass(frozen=True)
class Drivers:
    """Windows of several periods as one long list.

    Attributes
    ----------
    scenes : tuple of Scenes
        One a period; they give the order of the windows.
    """

    scenes: tuple[Scenes, ...]
    desired_speed: float | None = None  # m/s, of everybody; the road's speed limit if it is not given

    def __len__(self) -> int:
        """Return the number of windows."""
        return sum(len(scenes) for scenes in self.scenes)

    def parts(self, rows: npt.NDArray[np.float64]) -> list[npt.NDArray[np.float64]]:
        """Split rows that belong to the windows, period by period.

        Parameters
        ----------
        rows : float64, shape (windows, ...)
            One row a window.

        Returns
        -------
        list of float64 arrays
            One a period.
        """
        return list(np.split(rows, np.cumsum([len(scenes) for scenes in self.scenes])[:-1]))

    def code(self, frames: int | None = None) -> pd.DataFrame:
        """Return the driving codes.

        Parameters
        ----------
        frames : int, optional
            Number of observed frames; all by default.

        Returns
        -------
        pandas.DataFrame
            One row a window.
        """
        return pd.concat([driving_code(s, frames) for s in self.scenes], ignore_index=True)

    def drive(self, parameters: npt.ArrayLike, drive: Drive | None = None) -> list[Trajectories]:
        """Drive all windows by one set of parameters each.

        Parameters
        ----------
        parameters : array_like, shape (windows, 5) or (5,)
            ``a, b, T, d0, d1``.
        drive : callable, optional
            Drives scenes by parameters; by default the kernel, at the drivers' desired speed.

        Returns
        -------
        list of Trajectories
            One a period.
        """
        theta = np.broadcast_to(np.asarray(parameters, dtype=np.float64), (len(self), 5))
        chosen = drive or partial(drive_idm, desired_speed=self.desired_speed)
        return [chosen(s, part) for s, part in zip(self.scenes, self.parts(theta), strict=True)]

    def drive_each(self, methods: dict[str, npt.NDArray[np.float64]], drive: Drive) -> dict[str, list[Trajectories]]:
        """Drive all windows by several methods at once.

        The traffic is then played once a period.

        Parameters
        ----------
        methods : dict of str to float64, shape (windows, 5)
            Parameters by method.
        drive : callable
            Drives scenes by parameters.

        Returns
        -------
        dict of str to list of Trajectories
            By method, one a period.
        """
        driven: dict[str, list[Trajectories]] = {name: [] for name in methods}
        by_period = zip(*(self.parts(theta) for theta in methods.values()), strict=True)
        for scenes, parts in zip(self.scenes, by_period, strict=True):
            together = drive(scenes.subset(np.tile(np.arange(len(scenes)), len(parts))), np.concatenate(parts))
            for number, name in enumerate(methods):
                driven[name].append(together.rows(slice(number * len(scenes), (number + 1) * len(scenes))))
        return driven

    def score(self, trajectories: list[Trajectories]) -> pd.DataFrame:
        """Score trajectories.

        Parameters
        ----------
        trajectories : list of Trajectories
            One a period.

        Returns
        -------
        pandas.DataFrame
            :func:`idm_sumo.evaluation.metrics.score`, one row a window.
        """
        rows = [metrics.score(s, t) for s, t in zip(self.scenes, trajectories, strict=True)]
        return pd.concat(rows, ignore_index=True)

    def keys(self) -> pd.DataFrame:
        """Return period, vehicle and first frame of every window."""
        return pd.concat([scenes.keys() for scenes in self.scenes], ignore_index=True)

    def sample(self, most: int | None, rng: np.random.Generator) -> Drivers:
        """Return some windows, drawn without replacement, in their order.

        Parameters
        ----------
        most : int or None
            Largest number of windows; None for all.
        rng : numpy.random.Generator
            Source of the draws.

        Returns
        -------
        Drivers
            At most so many windows.
        """
        if most is None or len(self) <= most:
            return self
        kept = np.zeros(len(self))
        kept[rng.choice(len(self), most, replace=False)] = 1
        parts = zip(self.scenes, self.parts(kept), strict=True)
        return replace(self, scenes=tuple(s.subset(k.astype(bool)) for s, k in parts))
