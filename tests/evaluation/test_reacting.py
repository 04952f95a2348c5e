"""Followers that react: nothing changes without them, and a stopped car is not run over with them."""

import numpy as np
import pandas as pd
import pytest

from idm_sumo.evaluation.metrics import score
from idm_sumo.evaluation.reacting import parameters_of_followers, score_with_reacting, vehicles_behind
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.errors import InputError
from idm_sumo.scenes.windows import Window
from idm_sumo.simulation.rollout import drive_idm
from tests.helpers.builders import Car, scenes

CALM = np.array([1.0, 1.5, 1.2, 2.0, 1.0])
WAITS = np.array([0.1, 6.0, 5.0, 10.0, 0.0])  # wants gaps that nobody leaves
WINDOW = Window(observed=4, horizon=80)


def column(*behind: float, first_frame: int = 1) -> tuple[Car, ...]:
    """A leader, the driver 1 close behind it, and followers."""
    alike = {"speed": 12.0, "frames": 90, "first_frame": first_frame}
    cars = [Car(n + 3, 100.0 + x, **alike) for n, x in enumerate(behind)]
    return (Car(1, 100.0, **alike), Car(2, 118.0, **alike), *cars)


def test_without_reacting_followers_it_is_the_replay() -> None:
    some = scenes(*column(-12.0, -30.0), window=WINDOW, modelled=(1, 3))
    replayed = score(some, drive_idm(some, CALM))
    found = score_with_reacting(some, CALM, CALM, reacting=0)
    pd.testing.assert_frame_equal(found.drop(columns="followers"), replayed)


def test_a_replayed_follower_strikes_who_brakes_and_a_reacting_one_does_not() -> None:
    some = scenes(*column(-12.0), window=WINDOW)
    replayed = score_with_reacting(some, WAITS, CALM, reacting=0).iloc[0]
    reacting = score_with_reacting(some, WAITS, CALM, reacting=1).iloc[0]
    assert replayed["collision"]
    assert replayed["contact_edge"] == "rear"
    assert not replayed["at_fault"]
    assert not reacting["collision"]
    # The replayed car drove through ours, was then its leader, and made it brake even more.
    assert reacting["ade_m"] < replayed["ade_m"]


def test_a_follower_of_a_follower_reacts_too() -> None:
    some = scenes(*column(-12.0, -24.0, -36.0), window=WINDOW)
    found = score_with_reacting(some, WAITS, CALM, reacting=3).iloc[0]
    assert found["followers"] == 3
    assert not found["collision"]


def test_who_enters_behind_later_reacts_from_then_on() -> None:
    late = Car(3, 60.0, speed=15.0, first_frame=31, frames=60)
    some = scenes(*column(), late, window=WINDOW)
    behind = vehicles_behind(some, drive_idm(some, CALM).x[0], 2)
    assert behind.step.tolist() == [27]
    assert some.traffic.vehicle[behind.row].tolist() == [3]
    assert not score_with_reacting(some, WAITS, CALM, reacting=1)["collision"].iloc[0]


def test_a_window_late_in_a_recording_scores_as_an_early_one() -> None:
    early = scenes(*column(-12.0, -30.0), window=WINDOW, modelled=(1,))
    before = Car(9, 300.0, speed=12.0, frames=90)
    later = scenes(before, *column(-12.0, -30.0, first_frame=200), window=WINDOW, modelled=(1,))
    expected, found = (score_with_reacting(some, WAITS, CALM, reacting=2) for some in (early, later))
    pd.testing.assert_frame_equal(found.drop(columns="first_frame"), expected.drop(columns="first_frame"))


def test_followers_drive_by_their_own_parameters_or_by_those_of_number_0() -> None:
    names = ["a", "b", "T", "d0", "d1"]
    table = pd.DataFrame([[0, *CALM], [3, *WAITS]], columns=[c.VEHICLE, *names])
    assert np.array_equal(parameters_of_followers(table, np.array([4, 3])), [CALM, WAITS])
    some = scenes(*column(-12.0), window=WINDOW)
    found = score_with_reacting(some, WAITS, table[table[c.VEHICLE] == 0], reacting=1)
    pd.testing.assert_frame_equal(found, score_with_reacting(some, WAITS, CALM, reacting=1))


def test_a_thin_recording_cannot_react() -> None:
    some = scenes(Car(1, headway=np.full(90, 20.0), frames=90), window=WINDOW, has_leader_rows=False)
    with pytest.raises(InputError, match="cannot react"):
        score_with_reacting(some, CALM, CALM)
