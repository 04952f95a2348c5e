"""The learner in the study: learned once, kept, scored over seeds; and the command line around it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from analysis.reproduce.agents import figures as agent_figures
from analysis.reproduce.agents import learners as agent_learners
from analysis.reproduce.agents import rows as agents
from analysis.reproduce.agents import study as agent_study
from analysis.reproduce.agents import words as agent_words
from analysis.reproduce.agents.learners import Learners, fingerprint, learners_of, read_learners
from analysis.reproduce.agents.variants import variants
from analysis.reproduce.drivers import Drivers
from analysis.reproduce.settings import Settings
from idm_sumo.cli import main
from idm_sumo.evaluation.metrics import summary
from idm_sumo.irl import learning
from idm_sumo.irl.features import NAMES
from idm_sumo.irl.policy import Policy
from idm_sumo.irl.variants import VARIANTS
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.siblings import locked
from tests.helpers.platoons import platoon_recording

STEPS = 2 * 128 * 50


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    path = tmp_path_factory.mktemp("agents") / "platoons.parquet"
    platoon_recording().to_parquet(path)
    return Settings(recordings=(str(path),), backend="kernel", agent_steps=STEPS, agent_seeds=2, agent_demonstrations=6)


@pytest.fixture(scope="module")
def sides(settings: Settings) -> tuple[Drivers, Drivers]:
    return agent_study.sides(settings)


@pytest.fixture(scope="module")
def learners(settings: Settings, sides: tuple[Drivers, Drivers], tmp_path_factory: pytest.TempPathFactory) -> Learners:
    pytest.importorskip("stable_baselines3", reason="needs the extra rl: pip install 'idm-sumo[rl]'")
    return learners_of(sides[0], settings, tmp_path_factory.mktemp("learned"))


@pytest.fixture(scope="module")
def scored(sides: tuple[Drivers, Drivers], learners: Learners) -> agents.Agents:
    return agents.drive_agents(sides[1], learners, in_sumo=True)


def test_every_seed_has_an_agent_and_a_clone(learners: Learners) -> None:
    assert {name: len(found) for name, found in learners.policies.items()} == {"irl_rl": 2, "behaviour_cloning": 2}
    assert sorted(learners.curve["seed"].unique()) == [1, 2]
    assert learners.curve["steps"].max() == STEPS
    assert learners.missing == ""


def test_rows_are_means_over_seeds_with_their_spread(sides: tuple[Drivers, Drivers], scored: agents.Agents) -> None:
    rows = agents.rows(scored).set_index("method")
    by_seed = [summary(score) for score in scored.scores["irl_rl"]]
    ade = [figures["ade_m"] for figures in by_seed]
    assert rows.loc["irl_rl", "ade_m"] == pytest.approx(np.mean(ade))
    assert rows.loc["irl_rl", "ade_seed_sd_m"] == pytest.approx(np.std(ade, ddof=1))
    assert rows.loc["irl_rl", "collisions"] == pytest.approx(np.mean([figures["collisions"] for figures in by_seed]))
    assert rows.loc["irl_rl", "vehicles"] == len(sides[1])
    assert rows.loc["irl_rl", "seeds"] == 2
    table = agents.by_seed(sides[1], scored)
    assert table["seed"].tolist() == [1, 2, 1, 2]
    assert table["ade_m"].iloc[:2].tolist() == pytest.approx(ade)


def test_sumo_agrees_with_the_kernels_on_the_agents_actions(scored: agents.Agents) -> None:
    assert 0.0 < scored.sumo_difference_m < 1e-3


def test_what_is_learned_is_kept(
    settings: Settings, sides: tuple[Drivers, Drivers], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("stable_baselines3")
    monkeypatch.setenv("IDM_SUMO_CACHE", str(tmp_path))
    one = replace(settings, agent_seeds=1, agent_steps=128 * 50)
    first = learners_of(sides[0], one)
    monkeypatch.setattr(agent_learners, "lessons_of", lambda _: pytest.fail("learned again"))
    again = learners_of(sides[0], one)
    np.testing.assert_array_equal(first.policies["irl_rl"][0].layers[0][0], again.policies["irl_rl"][0].layers[0][0])
    assert fingerprint(sides[0], one) != fingerprint(sides[1], one)
    assert fingerprint(sides[0], one) != fingerprint(sides[0], settings)


def test_without_the_extra_there_are_clones_and_one_line_that_says_what_to_install(
    settings: Settings, sides: tuple[Drivers, Drivers], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(agent_learners, "rl_is_installed", lambda: False)
    found = learners_of(sides[0], replace(settings, agent_seeds=1), tmp_path / "learned")
    assert list(found.policies) == ["behaviour_cloning"]
    rows = agents.rows(agents.drive_agents(sides[1], found, in_sumo=False))
    assert rows["method"].tolist() == ["behaviour_cloning"]
    assert learning.INSTALL in agents.missing_row(rows)
    assert found.missing == agents.missing_row(rows)


def contents(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_training_that_fails_leaves_nothing_and_one_that_stops_only_what_is_whole(
    settings: Settings, sides: tuple[Drivers, Drivers], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("stable_baselines3")
    one = replace(settings, agent_seeds=1, agent_steps=128 * 50)
    with monkeypatch.context() as patch:
        patch.setattr(agent_learners, "learn_reward", lambda *_, **__: pytest.fail("no reward"))
        with pytest.raises(pytest.fail.Exception):
            agent_study.train(one, tmp_path / "none" / "agents")
    assert not (tmp_path / "none").exists()
    folder = tmp_path / "agents"
    with monkeypatch.context() as patch:
        patch.setattr(Policy, "write", lambda *_: pytest.fail("no policy"))
        with pytest.raises(pytest.fail.Exception):
            agent_study.train(one, folder)
    assert contents(folder) == ["drivers.json", "reward.json"]
    agent_study.train(one, folder)
    whole = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert sorted(whole) == ["behaviour_cloning-seed1.npz", "drivers.json", "irl_rl-seed1.csv", "irl_rl-seed1.npz",
                             "learning_curve.png", "reward.json"]  # fmt: skip
    with pytest.raises(InputError, match="agents of other drivers"):
        agent_study.train(replace(one, seed=2), folder)
    (folder / "drivers.json").write_text("[" * 9999)
    with pytest.raises(InputError, match=r"drivers\.json: is nested too deep"):
        agent_study.train(one, folder)
    (folder / "drivers.json").write_bytes(whole["drivers.json"])
    with locked(folder, "training"), pytest.raises(InputError, match="another training is at work"):
        agent_study.train(one, folder)
    agent_study.train(one, folder)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == whole


def test_a_folder_without_agents_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"reward\.json"):
        read_learners(tmp_path)


def test_pictures_and_words(sides: tuple[Drivers, Drivers], scored: agents.Agents, tmp_path: Path) -> None:
    test = sides[1]
    reward = scored.learners.reward
    weights = np.array(list(reward["wanted"]["weights"].values()))
    assert agents.weights_table(reward)["feature"].tolist() == list(NAMES)
    figures = (
        agent_figures.reward_maps(test.scenes[0], 0, weights),
        agent_figures.learning_curve(scored.learners.curve),
        agent_figures.approaches(test, scored, {}),
    )
    for number, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{number}.png")
    words = agent_words.describe(test, scored)
    ade = np.concatenate([score["ade_m"] for score in scored.scores["irl_rl"]])
    assert f"{ade.mean():.2f} m" in words["agent_findings"]
    assert "2 seeds" in words["agent_effort"]


def test_commands(settings: Settings, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("stable_baselines3")
    recording, folder = settings.recordings[0], tmp_path / "agents"
    main(["irl", "learn", recording, "--demonstrations", "6", "-o", str(tmp_path / "reward.json")])
    assert set(json.loads((tmp_path / "reward.json").read_text())["wanted"]["weights"]) == set(NAMES)
    train = ["irl", "train", recording, "--seeds", "1", "--agent-steps", "6400", "-o", str(folder)]
    main(train)
    assert (folder / "learning_curve.png").is_file()
    main(["irl", "evaluate", recording, "--agents", str(folder), "-o", str(tmp_path / "scores.csv")])
    assert pd.read_csv(tmp_path / "scores.csv")["method"].tolist() == ["irl_rl", "behaviour_cloning"]
    main(
        ["reproduce", recording, "--quick", "--backend", "kernel", "--agents", str(folder), "-o", str(tmp_path / "out")]
    )
    methods = pd.read_csv(tmp_path / "out" / "tables" / "methods.csv").set_index("method")
    assert list(methods.index[:3]) == ["constant_velocity", "irl_rl", "behaviour_cloning"]
    assert methods.loc["irl_rl", ["ade_m", "fde_m", "collisions", "vehicles", "jerk_rms_m_s3"]].notna().all()
    assert "short training" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    with pytest.raises(SystemExit) as stopped:
        main([*train, "--agent-steps", "12800"])
    assert stopped.value.code == 2
    assert "other drivers, settings" in capsys.readouterr().err


def test_variants_of_the_reward_are_trained_and_scored(settings: Settings, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason="needs the extra rl: pip install 'idm-sumo[rl]'")
    which = [replace(v, demonstrations=4) for v in (VARIANTS[0], VARIANTS[3], VARIANTS[4])]
    table = variants(replace(settings, agent_steps=128 * 50, agent_seeds=1), tmp_path / "variants.csv", which=which)
    assert table["variant"].tolist() == [v.name for v in which]
    efforts = table[[f"weight_{name}" for name in NAMES[-2:]]].to_numpy()
    assert efforts[0].all()
    assert not efforts[1].any()
    np.testing.assert_array_equal(efforts[2], efforts[0])  # it differs in the penalty only
    assert ((table["collisions"] <= table["contacts"]) & (table["contacts"] <= table["vehicles"])).all()
    again = pd.read_csv(tmp_path / "variants.csv")
    np.testing.assert_allclose(again["ade_m"], table["ade_m"], rtol=1e-5)
