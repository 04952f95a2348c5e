"""One lane: a place there, effects of its drivers alone, and neither chance nor what all do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import one_lane
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.left_over import LeftOver
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.models.effects import slots


def test_an_acceleration_at_a_place_in_one_lane_is_a_location_there():
    left = LeftOver(
        "position in lane 3", (96.0, 224.0), (96.0, 224.0), None, -0.2, -10.0, 1e-9, True, 3, score=-80.0, bias=4.0
    )
    found = one_lane.place_in_one_lane(left)
    assert (found.name, found.value, found.error, found.bias) == ("location", -0.2, pytest.approx(0.02), 4.0)
    assert found.information == pytest.approx(400.0)
    assert hy.lanes_of(found) == [0, 3]
    assert dict(hy.slots_of(found))[slots.PLACE_END] == 224.0


@pytest.mark.parametrize(
    "covariate", ["time in lane 3", "response over position in lane 3", "delay over time in lane 3"]
)
def test_nothing_else_in_one_lane_is_a_location(covariate):
    assert (
        one_lane.place_in_one_lane(LeftOver(covariate, (0.0, 9.0), (0.0, 9.0), None, -0.2, -10.0, 1e-9, True, 3))
        is None
    )


def in_lanes(*sizes: float, name: str = "hysteresis", drivers: int = 40) -> Evidence:
    """Return what is seen of an effect of another size in each lane, from lane 1 on."""
    rng = np.random.default_rng(5)
    lane = np.repeat(1 + np.arange(len(sizes)), drivers)
    information = (
        100.0 / drivers
    )  # of each driver: a standard error of 0.1 in each lane, and a little more by its inflation
    u = information * np.array(sizes)[lane - 1] + np.sqrt(information) * rng.standard_normal(len(lane))
    regressors = [Regressor(name, 0.2, ((slots.HYSTERESIS, 0.2),))]
    part = np.full((len(lane), 1), information)
    return Evidence(
        regressors, u[:, None], np.zeros((3, 1)), part.sum(axis=0)[:, None], part, np.arange(len(lane)), lane=lane
    )


def test_what_the_drivers_of_one_lane_do_is_confined_to_it_at_its_size_there():
    (found,) = one_lane.confined(in_lanes(0.0, 2.0, 0.0, 0.0))
    assert (found.name, found.only_lanes) == ("hysteresis", (2,))
    assert found.value == pytest.approx(2.0, abs=0.4)
    assert found.p < 1e-6
    assert hy.lanes_of(found) == [0, 2]


@pytest.mark.parametrize("sizes", [(1.0, 1.0, 1.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.0), (2.0,)])
def test_what_all_do_or_chance_does_is_confined_to_no_lane(sizes):
    assert one_lane.confined(in_lanes(*sizes)) == []


@pytest.mark.parametrize(("lane", "value", "z"), [(2.0, 0.5, 20.0), (2.0, -0.5, -20.0), (2.0, 0.5, 5.0)])
def test_a_lane_that_is_freely_later_than_others_has_a_delay_of_its_own_however_sure_all_are_late(lane, value, z):
    sizes = (0.9, 1.2, 0.9)
    free = LeftOver("delay over lane", (lane, lane), None, None, value, z, 1e-9, True)
    assert one_lane.confined(in_lanes(*sizes, name="reaction_delay")) == []
    found = one_lane.confined(replace(in_lanes(*sizes, name="reaction_delay"), free=(free,)))
    if z < one_lane.SURE_IN_LANE:
        assert found == []
        return
    assert [(one.name, one.only_lanes, one.z, one.p) for one in found] == [("reaction_delay", (2,), 20.0, 1e-9)]
    assert found[0].value == pytest.approx(1.2, abs=0.3)


@pytest.mark.parametrize(("there", "value", "z", "has_one"), [
    (0.6, -0.5, -9.0, True), (0.6, 0.5, 9.0, False), (0.6, -0.5, -5.0, False), (0.1, -0.5, -9.0, False),
])  # fmt: skip
def test_a_lane_that_freely_answers_less_has_a_delay_if_its_drivers_seem_late(there, value, z, has_one):
    free = LeftOver("response over lane", (2.0, 2.0), None, None, value, z, 1e-9, True)
    found = one_lane.confined(replace(in_lanes(0.2, there, 0.2, name="reaction_delay"), free=(free,)))
    assert [(one.name, one.only_lanes, one.z) for one in found] == ([("reaction_delay", (2,), 9.0)] if has_one else [])


@pytest.mark.parametrize(("name", "lane"), [("reaction_delay", 9.0), ("hysteresis", 2.0)])
def test_a_later_lane_in_which_nobody_stays_or_of_which_no_delay_is_known_has_none(name, lane):
    free = LeftOver("delay over lane", (lane, lane), None, None, 0.5, 20.0, 1e-9, True)
    assert one_lane.confined(replace(in_lanes(0.3, 0.3, 0.3, name=name), free=(free,))) == []


def test_a_lane_of_few_drivers_says_nothing_alone():
    assert one_lane.confined(in_lanes(0.0, 9.0, 0.0, drivers=one_lane.LEAST_IN_LANE - 1)) == []


@pytest.mark.parametrize("name", one_lane.NOT_BY_LANE)
def test_some_effects_are_not_asked_for_by_lane(name):
    assert one_lane.confined(in_lanes(0.0, 2.0, 0.0, name=name)) == []


def test_without_lanes_nothing_is_confined():
    seen = replace(in_lanes(0.0, 2.0, 0.0), lane=np.empty(0, dtype=np.int64))
    assert one_lane.confined(seen) == []


def test_forms_in_one_lane_are_judged_by_its_drivers():
    seen = in_lanes(0.0, 2.0, 0.0, name="reaction_delay")
    other = Regressor("reaction_delay", 0.5, ((slots.DELAY, 0.5), (slots.OWN_SPEED_KNOWN, 1.0)))
    both = replace(
        seen, regressors=[*seen.regressors, other], u=np.repeat(seen.u, 2, axis=1), part=np.repeat(seen.part, 2, axis=1),
        replicates=np.zeros((3, 2)), gram=np.full((2, 2), float(seen.gram[0, 0])),
    )  # fmt: skip
    (found,) = one_lane.confined(both)
    every = hy.forms(both, found)
    assert len(every) == 2
    assert {one.only_lanes for one in every} == {(2,)}
    assert [one.value for one in every] == pytest.approx([found.value] * 2)
    assert {one.z for one in every} == {found.z}


def test_what_drivers_say_adds_up_to_what_all_say():
    seen = in_lanes(0.5, 1.0, 0.0)
    parts = [seen.of(seen.lane == lane) for lane in (1, 2, 3)]
    np.testing.assert_allclose(sum(part.total() for part in parts), seen.total())
    np.testing.assert_allclose(sum(part.gram for part in parts), seen.gram)
    np.testing.assert_allclose(sum(part.replicates for part in parts), seen.replicates)
