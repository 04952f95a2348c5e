import numpy as np
import pandas as pd
import pytest

from idm_sumo.recordings import columns as c
from idm_sumo.recordings.cleaning import clean
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101
from idm_sumo.runtime.errors import InputError
from tests.helpers.builders import Car, recording

PLATOON = tuple(Car(number, x=100.0 - 20 * number, lane=2, frames=60) for number in (1, 2, 3, 4))


def labelled(*cars: Car) -> Recording:
    """A recording whose leaders are right: the nearest front ahead in the lane, looked up one by one."""
    table = recording(*cars).table

    def leader(me: pd.Series) -> int:
        ahead = table[(table[c.FRAME] == me[c.FRAME]) & (table[c.LANE] == me[c.LANE]) & (table[c.X] > me[c.X])]
        return int(table[c.VEHICLE][ahead[c.X].idxmin()]) if len(ahead) else 0

    return Recording.from_table(table.assign(**{c.LEADER: table.apply(leader, axis=1)}), road=US101, source="inline")


def edit(rec: Recording, mask: pd.Series, **values: object) -> Recording:
    table = rec.table.copy()
    for name, value in values.items():
        table.loc[mask, name] = value
    return rec.with_table(table)


def reasons(rec: Recording) -> dict[int, str]:
    vehicles = clean(rec).vehicles
    return dict(zip(vehicles[c.VEHICLE], vehicles["reason"], strict=True))


def test_right_labels_lose_nobody() -> None:
    result = clean(labelled(*PLATOON))
    assert result.accounting.dropped == {}
    assert len(result.eligible) == 4


@pytest.mark.parametrize(
    ("wrong", "why"),
    [(4, "behind"), (99, "absent"), (1, "another in between"), (0, "blind")],
)
def test_a_wrong_leader_is_not_modelled_but_stays_as_traffic(wrong: int, why: str) -> None:
    rec = labelled(*PLATOON)
    third = (rec.table[c.VEHICLE] == 3) & (rec.table[c.FRAME] > 45)
    result = clean(edit(rec, third, leader=wrong))
    assert result.accounting.vehicles_dropped == {"wrong leader": 1}, why
    assert result.accounting.used == len(rec.table)
    assert 3 not in set(result.eligible[c.VEHICLE])
    assert 3 in set(result.table[c.VEHICLE])


def test_a_few_wrong_frames_are_forgiven() -> None:
    rec = labelled(*PLATOON)
    few = (rec.table[c.VEHICLE] == 3) & (rec.table[c.FRAME] > 51)  # 9 frames
    assert reasons(edit(rec, few, leader=1))[3] == ""
    assert clean(edit(rec, few, leader=1), leader_frames=9).accounting.vehicles_dropped == {"wrong leader": 1}


def test_labels_late_by_a_second_at_a_lane_change_are_forgiven() -> None:
    y = np.where(np.arange(60) < 30, -5.5, -9.1)  # from lane 2 to lane 3
    changer = Car(5, x=50.0, y=y, frames=60)
    rec = labelled(*PLATOON, changer, Car(6, x=90.0, lane=3, frames=60))
    late = (rec.table[c.VEHICLE] == 5) & rec.table[c.FRAME].between(31, 42)
    late_follower = (rec.table[c.VEHICLE] == 3) & rec.table[c.FRAME].between(31, 42)
    assert set(reasons(edit(edit(rec, late, leader=2), late_follower, leader=5)).values()) == {""}


def test_a_leader_that_has_left_the_section_is_no_error() -> None:
    rec = labelled(Car(1, x=630.0, lane=2, frames=20), Car(2, x=600.0, lane=2, frames=60))
    gone = (rec.table[c.VEHICLE] == 2) & (rec.table[c.FRAME] > 20)
    assert reasons(edit(rec, gone, leader=1)) == {1: "", 2: ""}


def test_a_hole_in_the_frames_removes_the_vehicle() -> None:
    rec = labelled(*PLATOON)
    holed = rec.with_table(
        rec.table[~((rec.table[c.VEHICLE] == 4) & (rec.table[c.FRAME] == 30))].reset_index(drop=True)
    )
    result = clean(holed)
    assert result.accounting.dropped == {"frame irregularity": 59}
    assert result.accounting.vehicles_dropped == {"frame irregularity": 1}
    assert 4 not in set(result.table[c.VEHICLE])


def test_a_jump_of_the_clock_removes_the_vehicle() -> None:
    rec = labelled(*PLATOON)
    late = (rec.table[c.VEHICLE] == 4) & (rec.table[c.FRAME] > 30)
    jumped = edit(rec, late, time=rec.table.loc[late, c.TIME] + 0.7)
    assert reasons(jumped)[4] == "frame irregularity"


@pytest.mark.parametrize(("column", "factor", "told"), [(c.TIME, 0.4, "0.04 s apart"), (c.FRAME, 2, "2 frames")])
def test_rows_at_another_pace_are_named(column: str, factor: float, told: str) -> None:
    rec = labelled(*PLATOON)
    table = rec.table.assign(**{column: (rec.table[column] * factor).astype(rec.table[column].dtype)})
    with pytest.raises(InputError, match=told):
        clean(rec.with_table(table))


def test_the_hole_left_by_the_auxiliary_lane_is_no_irregularity() -> None:
    rec = labelled(Car(1, lane=5, frames=60), Car(2, lane=2, frames=60))
    beside = (rec.table[c.VEHICLE] == 1) & rec.table[c.FRAME].between(21, 30)
    result = clean(edit(rec, beside, lane=6))
    assert result.accounting.dropped == {"auxiliary lane or ramp": 10}
    vehicles = result.vehicles.set_index(c.VEHICLE)
    assert vehicles.loc[1, ["first_frame", "last_frame", "reason"]].tolist() == [31, 60, ""]


def test_a_vehicle_that_never_joins_is_named() -> None:
    rec = labelled(Car(1, lane=5), Car(2, lane=2))
    result = clean(edit(rec, rec.table[c.VEHICLE] == 1, lane=7))
    assert result.accounting.dropped == {"auxiliary lane or ramp": 40}
    assert result.accounting.vehicles_dropped == {"never on a main lane": 1}
    assert result.vehicles["first_frame"].tolist() == [-1, 1]


def test_vehicles_of_the_same_number_in_two_periods_are_two() -> None:
    first, second = recording(Car(1, frames=20)).table, recording(Car(1, frames=20), period="p2").table
    second = second.drop(index=10)
    rec = Recording.from_table(pd.concat([first, second.astype({c.PERIOD: "str"})]), road=US101, source="inline")
    vehicles = clean(rec).vehicles
    assert vehicles["reason"].tolist() == ["", "frame irregularity"]


def test_nothing_left_says_why() -> None:
    rec = recording(Car(1, lane=5))
    with pytest.raises(InputError, match=r"no rows left after cleaning.*auxiliary lane"):
        clean(edit(rec, rec.table[c.VEHICLE] == 1, lane=6))


def test_the_account_adds_up_with_everything_wrong_at_once() -> None:
    rec = labelled(*PLATOON, Car(7, x=300.0, lane=5, frames=60))
    table = rec.table[~((rec.table[c.VEHICLE] == 4) & (rec.table[c.FRAME] == 30))].reset_index(drop=True)
    rec = rec.with_table(table)
    rec = edit(rec, (table[c.VEHICLE] == 7) & (table[c.FRAME] < 20), lane=7)
    rec = edit(rec, table[c.VEHICLE] == 2, leader=99)
    account = clean(rec).accounting.check()
    assert account.total == len(table)
    assert account.vehicles + sum(account.vehicles_dropped.values()) == 5
    assert account.vehicles_dropped == {"frame irregularity": 1, "wrong leader": 1}
