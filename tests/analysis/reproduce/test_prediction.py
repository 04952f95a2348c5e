"""What the report says of prediction: equal windows, flat directions, averaging, words from numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.reproduce.drivers import Drivers
from analysis.reproduce.prediction import figures as prediction_figures
from analysis.reproduce.prediction import seconds as prediction_seconds
from analysis.reproduce.prediction import words as prediction_words
from analysis.reproduce.prediction.reasons import averaging, directions, hindsight, prediction_tables
from analysis.reproduce.settings import Settings
from analysis.reproduce.source import Source, load_source
from analysis.reproduce.study import Study, prepare
from idm_sumo.calibration import calibrate
from idm_sumo.models.idm import IDMParameters
from tests.helpers.known_drivers import known_drivers
from tests.helpers.platoons import platoon_recording


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Source:
    path = tmp_path_factory.mktemp("report") / "platoons.parquet"
    platoon_recording().to_parquet(path)
    return load_source(Settings(recordings=(str(path),), backend="kernel"))


@pytest.fixture(scope="module")
def study(source: Source) -> Study:
    settings = Settings(recordings=(source.name,), backend="kernel", neighbours=4)
    return prepare(source, settings, settings.window)


@pytest.fixture(scope="module")
def tables(source: Source, study: Study) -> dict[str, pd.DataFrame]:
    return prediction_tables(source, study)


def test_all_times_observed_drive_the_same_windows(tables: dict[str, pd.DataFrame]) -> None:
    table = tables["prediction_seconds"].set_index("method")
    assert table["number"].nunique() == table["drivers"].nunique() == 1
    assert table.loc["idm_pooled", "share"] == 0.0
    assert table.loc["idm_oracle", "share"] == pytest.approx(1.0)
    seconds = table.loc["idm_residual", "observed_s"].to_numpy()
    assert {0.2, 0.5, 1.0, 2.0} <= set(seconds)
    assert table.loc["idm_oracle", "ade_m"] < table.loc["idm_residual", "ade_m"].min()
    share = (table.loc["idm_pooled", "ade_m"] - table["ade_m"]) / (
        table.loc["idm_pooled", "ade_m"] - table.loc["idm_oracle", "ade_m"]
    )
    np.testing.assert_allclose(table["share"], share, atol=1e-9)


def test_nobody_recorded_for_long_enough_is_an_empty_table(source: Source, study: Study) -> None:
    endless = Settings(recordings=(source.name,), backend="kernel", horizon=36_000)
    found = prediction_seconds.table(source, endless, study.learned)
    assert found.empty
    assert "long enough" in prediction_words.caption(found)


def test_longer_windows_determine_more_directions() -> None:
    found = []
    for seconds in (6.0, 30.0):
        scenes, _ = known_drivers(40, seconds=seconds, noise=0.05, seed=3)
        found.append(directions(Drivers((scenes,)), calibrate(scenes)))
    assert found[1]["directions determined"] > found[0]["directions determined"] + 0.5
    for one in found:
        open_share = one["share of directions not determined"]
        assert open_share == pytest.approx(1.0 - one["directions determined"] / 5)


def test_own_parameters_beat_a_joint_fit_beats_the_average(study: Study) -> None:
    n = averaging(study)
    own, joint = (
        n[f"{name}: ADE (m)"]
        for name in ("neighbours' own parameters, on themselves", "one set fitted to the neighbours, on themselves")
    )
    average, pooled = (
        n[f"{name}: ADE (m)"] for name in ("neighbours' average, on themselves", "pooled, on the neighbours")
    )
    assert own < joint < min(average, pooled) + 1e-9


def test_a_driver_that_stays_the_same_is_all_known_in_hindsight() -> None:
    theta = np.repeat(
        np.array([[1.0, 1.5, 0.8, 2.0, 0.5], [1.5, 2.5, 1.8, 3.0, 1.0], [0.8, 1.0, 1.3, 1.5, 0.0]]), 4, axis=0
    )
    scenes, _ = known_drivers(12, seed=5, drivers=theta)
    same = replace(scenes, vehicle=np.repeat(np.arange(1, 4), 4))
    found = hindsight(Drivers((same,)), IDMParameters(1.1, 1.6, 1.2, 2.0, 0.5), seed=1)
    assert found["drivers in hindsight"] == 3
    assert found["one set a driver in hindsight: share"] > 0.95


def test_the_reports_sentences_hold_the_tables_numbers(tables: dict[str, pd.DataFrame]) -> None:
    words = prediction_words.describe(tables)
    numbers = tables["prediction_reasons"].set_index("what")["value"]
    why = " ".join(words["prediction_why"])  # type: ignore[arg-type]
    assert f"{numbers['directions determined']:.1f} of the five" in why
    assert f"{numbers['averaged neighbours, free fits: ADE (m)']:.2f} m" in why
    seen = tables["prediction_seconds"].query("method == 'idm_residual'")
    assert f"{seen['number'].iloc[0]:.0f} windows" in str(words["prediction_seconds_caption"])
    assert f"{tables['prediction_coverage']['coverage_90%'].iloc[0]:.1%} at 1 s" in str(
        words["prediction_coverage_text"]
    )
    assert f"{numbers['one set a driver in hindsight: share']:.0%}" in str(words["prediction_limits"])


def test_figure_of_seconds_is_drawn(tables: dict[str, pd.DataFrame], tmp_path: Path) -> None:
    prediction_figures.seconds(tables["prediction_seconds"]).savefig(tmp_path / "seconds.png")
    assert (tmp_path / "seconds.png").stat().st_size > 10_000
