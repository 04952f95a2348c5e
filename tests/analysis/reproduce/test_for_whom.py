"""Gains by group: nobody is counted twice, and the better method gains for those it was made better for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.reproduce.drivers import Drivers
from analysis.reproduce.prediction import figures, for_whom, words
from analysis.reproduce.prediction.learned import window_ade
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction import RolloutPredictor
from idm_sumo.simulation.rollout import Trajectories, drive_idm
from tests.helpers.known_drivers import known_drivers

POOLED = IDMParameters(1.2, 1.6, 1.2, 2.0, 0.0)


def first_seconds(drivers: Drivers) -> pd.DataFrame:
    return pd.concat([RolloutPredictor(past_only=False).observe(s) for s in drivers.scenes], ignore_index=True)


@pytest.fixture(scope="module")
def test() -> Drivers:
    scenes, _ = known_drivers(60, seed=9)
    return Drivers((replace(scenes, vehicle=np.repeat(np.arange(1, 31), 2)),))


@pytest.fixture(scope="module")
def driven(test: Drivers) -> dict[str, list[Trajectories]]:
    """Return runs of which the predicted ones are halfway to the recording where the driver is fast."""
    scenes = test.scenes[0]
    pooled = drive_idm(scenes, POOLED)
    own = slice(scenes.start, scenes.start + scenes.window.horizon + 1)
    recorded = replace_paths(pooled, scenes.x[:, own], scenes.y[:, own])
    speed = scenes.speed[:, scenes.start]
    fast = (speed >= np.quantile(speed, 2 / 3))[:, None]
    half = replace_paths(pooled, np.where(fast, (pooled.x + recorded.x) / 2, pooled.x), pooled.y)
    return {"idm_pooled": [pooled], "idm_rollout": [half], "idm_residual": [pooled], "idm_oracle": [recorded]}


def replace_paths(driven: Trajectories, x: np.ndarray, y: np.ndarray) -> Trajectories:
    return replace(driven, x=x, y=y)


@pytest.fixture(scope="module")
def gains(test: Drivers, driven: dict[str, list[Trajectories]]) -> pd.DataFrame:
    errors = {name: window_ade(test.scenes[0], runs[0]) for name, runs in driven.items()}
    return for_whom.table(test, first_seconds(test), errors)


def test_groups_of_a_quantity_share_the_windows_out(test: Drivers) -> None:
    found = for_whom.groups(test, first_seconds(test))
    for by in {by for by, _ in found}:
        members = np.stack([which for (quantity, _), which in found.items() if quantity == by])
        assert (members.sum(axis=0) == 1).all()


def test_only_those_gain_for_whom_it_was_made_better(gains: pd.DataFrame) -> None:
    rows = gains[(gains["by"] == "speed") & (gains["method"] == "idm_rollout")].set_index("group")
    fast = rows.index.str.endswith("more")
    assert rows.loc[fast, "share"].to_numpy() == pytest.approx(0.5, abs=0.05)
    assert rows.loc[~fast, "gain_m"].to_numpy() == pytest.approx(0.0, abs=1e-9)
    assert (gains.loc[gains["method"] == "idm_residual", "gain_m"] == 0.0).all()


def test_distances_are_those_at_the_time(test: Drivers, driven: dict[str, list[Trajectories]]) -> None:
    found = for_whom.distances(test, driven).set_index("seconds")
    assert found.index.tolist() == [3.0, 5.0, 10.0]
    assert (found["idm_oracle"] < 1e-6).all()
    assert found["idm_pooled"].is_monotonic_increasing


def test_the_figure_and_its_words_hold_the_numbers(
    test: Drivers, driven: dict[str, list[Trajectories]], gains: pd.DataFrame, tmp_path: Path
) -> None:
    distances = for_whom.distances(test, driven)
    figures.for_whom(distances, gains).savefig(tmp_path / "whom.png")
    said = words.on_groups(distances, gains)
    assert f"{distances['idm_pooled'].iloc[-1]:.1f} m off" in said
    assert "most for speed" in said
    assert words.on_groups(distances[:0], gains[:0]) == ""
