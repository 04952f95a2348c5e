"""What vehicles that are missing from the scene do to every method."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from analysis.reproduce.missing import COLUMNS, KNOWN, REFITTED, SEEDS, SHARES, by_share, missing_vehicles
from analysis.reproduce.settings import Settings
from analysis.reproduce.source import load_source
from analysis.reproduce.study import Study, predictions, prepare
from analysis.reproduce.words import missing_sentence
from tests.helpers.platoons import platoon_recording


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Study:
    path = tmp_path_factory.mktemp("missing") / "platoons.parquet"
    platoon_recording().to_parquet(path)
    settings = Settings(recordings=(str(path),), backend="kernel", neighbour_counts=(1,))
    return prepare(load_source(settings), settings, settings.window)


@pytest.fixture(scope="module")
def table(study: Study) -> pd.DataFrame:
    return missing_vehicles(study)


def test_every_share_seed_and_way_has_its_rows(table: pd.DataFrame) -> None:
    assert list(table) == COLUMNS
    counts = table[table["method"] == "idm_oracle"].groupby(["missing_share", "parameters"]).size()
    assert counts.to_dict() == {(0.0, KNOWN): 1} | {
        (share, way): SEEDS for share in SHARES[1:] for way in (KNOWN, REFITTED)
    }


def test_nobody_missing_is_the_study_itself(study: Study, table: pd.DataFrame) -> None:
    whole = table[table["missing_share"] == 0.0].set_index("method")
    theta = predictions(study)["idm_prediction"]
    scores = study.test.score(study.test.drive(theta))
    assert whole.loc["idm_prediction", "ade_m"] == pytest.approx(scores["ade_m"].mean())
    assert whole.loc["idm_prediction", "vehicles"] == len(study.test)


def test_the_missing_are_neither_modelled_nor_followed(study: Study, table: pd.DataFrame) -> None:
    most = table[(table["missing_share"] == SHARES[-1]) & (table["method"] == "idm_oracle")]
    assert (most["vehicles"] < len(study.test)).all()
    known, refitted = (most[most["parameters"] == way]["ade_m"].mean() for way in (KNOWN, REFITTED))
    assert known > refitted  # parameters of another leader


def test_a_thinned_scene_keeps_its_cells(study: Study) -> None:
    scenes = study.test.scenes[0]
    gone = np.setdiff1d(np.unique(scenes.traffic.vehicle), scenes.vehicle[:1])
    thin = scenes.traffic.without(gone)
    assert set(thin.vehicle) <= {int(scenes.vehicle[0])}
    assert len(thin.offsets) == len(scenes.traffic.offsets)


def test_the_sentence_holds_the_tables_numbers(table: pd.DataFrame) -> None:
    said = missing_sentence(table)
    worst = by_share(table).query("method == 'idm_oracle' and parameters == @KNOWN")["ade_m"].iloc[-1]
    assert f"{worst:.2f} m with 35% missing" in said
    assert "1521 of 2017" in said
    assert "nobody can be taken away" in missing_sentence(table[:0])
