"""The study's spine on small recordings: who trains, who tests, what is predicted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.reproduce import paper, tables
from analysis.reproduce.settings import Settings
from analysis.reproduce.source import Source, load_source
from analysis.reproduce.study import Study, predictions, prepare
from analysis.reproduce.words import paired_difference
from idm_sumo.runtime.errors import InputError
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.platoons import platoon_recording


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    path = tmp_path_factory.mktemp("study") / "platoons.parquet"
    platoon_recording().to_parquet(path)
    return Settings(recordings=(str(path),), backend="kernel", neighbour_counts=(1, 4, 8))


@pytest.fixture(scope="module")
def source(settings: Settings) -> Source:
    return load_source(settings)


@pytest.fixture(scope="module")
def study(source: Source, settings: Settings) -> Study:
    return prepare(source, settings, settings.window)


def test_first_period_trains_later_ones_test(source: Source) -> None:
    assert list(source.train) == ["0750-0805"]
    assert list(source.test) == ["0805-0820"]


def test_named_periods(settings: Settings) -> None:
    turned = load_source(replace(settings, train=("0805-0820",)))
    assert list(turned.train) == ["0805-0820"]
    assert list(turned.test) == ["0750-0805"]
    with pytest.raises(InputError, match="0900"):
        load_source(replace(settings, test=("0900",)))


def test_one_period_is_split_by_entry(tmp_path: Path, settings: Settings) -> None:
    path = tmp_path / "one.parquet"
    platoon_recording(periods=1, platoons=7).to_parquet(path)
    one = load_source(replace(settings, recordings=(str(path),)))
    train, test = one.train["0750-0805"], one.test["0750-0805"]
    assert not train & test
    assert len(train) == len(test) == 21
    assert any("entered first" in note for note in one.notes)
    assert max(train) <= 36  # the later platoons, vehicles 31 to 42, enter 26 s later
    assert {37, 38, 39, 40, 41, 42} <= test


def test_the_same_period_in_two_files(settings: Settings) -> None:
    with pytest.raises(InputError, match="earlier file"):
        load_source(replace(settings, recordings=settings.recordings * 2))


def test_no_driver_is_on_both_sides_or_lost(study: Study, source: Source) -> None:
    sides = [
        {key for s in side.scenes for key in zip(s.period, s.vehicle, strict=True)}
        for side in (study.train, study.test)
    ]
    assert not sides[0] & sides[1]
    assert len(sides[0]) + len(sides[1]) + len(study.excluded) + len(source.not_modelled) == 48
    assert len(study.train_fits) == len(study.train)


def test_oracle_beats_pooled_beats_nothing(study: Study) -> None:
    ade = {
        name: study.test.score(study.test.drive(theta))["ade_m"].mean() for name, theta in predictions(study).items()
    }
    assert ade["idm_oracle"] < ade["idm_pooled"]
    assert set(ade) == {"idm_average", "idm_prediction", "idm_rollout", "idm_first_gap", "idm_pooled", "idm_typical",
        "idm_hierarchical",
                        "idm_oracle"}  # fmt: skip
    trained = study.train.score(study.train.drive(study.pooled))["ade_m"].mean()
    average = predictions(study)["idm_average"][0]
    assert trained <= study.train.score(study.train.drive(average))["ade_m"].mean()


def test_driving_methods_together_is_driving_them_apart(study: Study) -> None:
    theta = predictions(study)
    together = study.test.drive_each(theta, drive_idm)
    for name, parameters in theta.items():
        for one, other in zip(together[name], study.test.drive(parameters), strict=True):
            np.testing.assert_array_equal(one.x, other.x)


def test_tables_have_the_papers_rows(study: Study, source: Source) -> None:
    rows = list(tables.features(study)["features"])
    assert rows[:7] == list(paper.FEATURES)
    assert rows[7:] == ["nu_relative", "nu_relative+omega+tau"]
    test, _ = source.drivers(source.test, "test", tables.frame_window(study))
    frames = tables.frames(study, test)
    assert list(frames["frames"]) == list(paper.FRAMES)
    assert frames["vehicles"].nunique() == 1
    assert list(tables.neighbours(study)["k"]) == [1, 4, 8]


def test_paired_difference_is_by_vehicle(study: Study) -> None:
    scores = study.test.score(study.test.drive(study.pooled))
    shifted = scores.assign(ade_m=scores["ade_m"] + 0.5)
    mean, error = paired_difference(shifted, scores)
    assert mean == pytest.approx(0.5)
    assert error == pytest.approx(0.0, abs=1e-12)


def test_sampling_repeats_with_its_seed(study: Study) -> None:
    draws = [study.test.sample(5, np.random.default_rng(4)).keys() for _ in range(2)]
    assert len(draws[0]) == 5
    assert draws[0].equals(draws[1])
