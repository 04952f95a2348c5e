"""Replay with an extended model: without causes the plain one, with them the same in SUMO and in the kernel."""

import numpy as np
import pandas as pd
import pytest

from idm_sumo.models.effects import CATALOGUE, Cause, ExtendedModel
from idm_sumo.models.idm import TEXTBOOK
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.extended_rollout import drive_extended
from idm_sumo.simulation.rollout import drive_idm
from idm_sumo.sumo.replay.one_vehicle import replay
from tests.helpers.replays import DRIVER, assert_same, crowd, vehicle

DRIVEN = [effect for effect in CATALOGUE if effect.parameters]


def model_of(*causes: Cause) -> ExtendedModel:
    return ExtendedModel(TEXTBOOK, US101.speed_limit, causes=causes)


def everywhere(effect) -> Cause:
    """Return a cause of typical size that acts at every place and time."""
    wide = {"x_1": -1e6, "x_2": 1e6, "t_1": -1e6, "t_2": 1e6}
    return Cause(effect.name, {p.symbol: wide.get(p.symbol, p.typical) for p in effect.parameters})


@pytest.fixture(scope="module")
def awkward():
    """Traffic that changes lanes and overlaps, with trucks and a past before the windows begin."""
    table = crowd(4, vehicles=40, frames=140)
    table.loc[table["vehicle"] % 3 == 0, "vehicle_class"] = 3
    table["acceleration"] = table.groupby("vehicle")["speed"].transform(lambda v: np.gradient(v, FRAME_STEP))
    recording = Recording.from_table(table, road=US101)
    scenes = build_scenes(recording, Window(observed=10, horizon=60, every=20), modelled=range(1, 26))
    return recording, scenes


def test_without_causes_it_is_the_plain_model(awkward) -> None:
    recording, scenes = awkward
    assert_same(drive_extended(scenes, recording, model_of(), DRIVER), drive_idm(scenes, DRIVER))


@pytest.mark.parametrize("effect", DRIVEN, ids=lambda effect: effect.name)
def test_sumo_and_kernel_agree_on_every_effect(awkward, effect) -> None:
    recording, scenes = awkward
    model, which = model_of(everywhere(effect)), np.arange(0, len(scenes), 6)
    kernel = drive_extended(scenes, recording, model, DRIVER)
    in_sumo = replay(scenes, DRIVER, which=which, extension=(recording, model))
    np.testing.assert_allclose(in_sumo.x, kernel.x[which], rtol=0, atol=1e-3)  # the bar; and by far:
    assert_same(in_sumo, kernel.rows(which))
    assert np.abs(kernel.x - drive_idm(scenes, DRIVER).x).max() > 0.02  # it does something


@pytest.mark.parametrize("name", ["adjacent_lane_friction", "hysteresis"])
def test_another_form_is_seen_alike_and_is_another(awkward, name) -> None:
    recording, scenes = awkward
    which = np.arange(0, len(scenes), 6)
    usual, other = (model_of(Cause(name, {"phi": phi})) for phi in (0.0, 1.0))
    kernel = drive_extended(scenes, recording, other, DRIVER)
    assert_same(replay(scenes, DRIVER, which=which, extension=(recording, other)), kernel.rows(which))
    assert np.abs(kernel.x - drive_extended(scenes, recording, usual, DRIVER).x).max() > 0.02


@pytest.mark.parametrize(("known", "new_known", "of_headway"), [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 1.0)])
def test_both_agree_behind_leaders_known_by_headway(known, new_known, of_headway) -> None:
    time = np.arange(150) * FRAME_STEP
    headway = np.where(time < 8.0, 32.0, 21.0) + np.sin(time)  # somebody cuts in
    recording = Recording.from_table(
        vehicle(1, 40.0, -2.0, 9.0, frames=150, headway=headway), road=US101, has_leader_rows=False
    )
    scenes = build_scenes(recording, Window(observed=10, horizon=120))
    model = model_of(
        Cause("reaction_delay", {"tau": 0.45, "eta": known, "zeta": new_known, "xi": 0.5 * known}),
        Cause("lane_change_relaxation", {"kappa": 0.8, "tau_r": 9.0, "phi": of_headway}),
    )
    kernel = drive_extended(scenes, recording, model, DRIVER)
    assert_same(replay(scenes, DRIVER, extension=(recording, model)), kernel)
    without = drive_extended(scenes, recording, model_of(model.causes[0]), DRIVER)
    cut_in = int(8.0 / FRAME_STEP) - scenes.start
    np.testing.assert_array_equal(kernel.x[0, : cut_in + 2], without.x[0, : cut_in + 2])
    assert kernel.x[0, -1] - without.x[0, -1] > 0.5  # the short gap is accepted


def test_a_delay_of_whole_frames_repeats_the_past() -> None:
    """With everything known recorded, the first acceleration is the plain model's of a second before."""
    recording = Recording.from_table(
        pd.concat([vehicle(1, 40.0, -2.0, 9.0, frames=80), vehicle(2, 70.0, -2.0, 7.0, frames=80)]), road=US101
    )
    window = Window(observed=21, horizon=30)
    scenes = build_scenes(recording, window, modelled=[1])
    late = drive_extended(scenes, recording, model_of(Cause("reaction_delay", {"tau": 1.0})), DRIVER)
    earlier = build_scenes(recording, Window(observed=11, horizon=30), modelled=[1])
    np.testing.assert_allclose(late.acceleration[0, 0], drive_idm(earlier, DRIVER).acceleration[0, 0], rtol=1e-12)


def test_who_knows_where_a_new_leader_was_brakes_at_once() -> None:
    time = np.arange(150) * FRAME_STEP
    recording = Recording.from_table(
        vehicle(1, 40.0, -2.0, 9.0, frames=150, headway=np.where(time < 8.0, 32.0, 15.0)),
        road=US101,
        has_leader_rows=False,
    )
    scenes = build_scenes(recording, Window(observed=10, horizon=120))
    causes = (Cause("reaction_delay", {"tau": 0.6, "zeta": known}) for known in (0.0, 1.0))
    late, known = (drive_extended(scenes, recording, model_of(cause), DRIVER).acceleration[0] for cause in causes)
    cut_in = int(8.0 / FRAME_STEP) - scenes.start
    np.testing.assert_array_equal(late[:cut_in], known[:cut_in])
    assert (known[cut_in : cut_in + 5] < late[cut_in : cut_in + 5] - 0.3).all()


def test_a_cause_of_one_lane_leaves_the_others_alone(awkward) -> None:
    recording, scenes = awkward
    model = model_of(Cause("location", {"alpha": -0.5, "x_1": -1e6, "x_2": 1e6}, lanes=(2,)))
    apart = np.abs(drive_extended(scenes, recording, model, DRIVER).x - drive_idm(scenes, DRIVER).x).max(axis=1)
    assert (apart[scenes.lane == 2] > 0.1).all()
    assert (apart[scenes.lane != 2] == 0).all()
