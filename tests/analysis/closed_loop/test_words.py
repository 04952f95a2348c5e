"""Which population is closest, and where each is wrong, as it is said."""

import numpy as np
import pandas as pd

from analysis.closed_loop import words

RECORDED = {
    "mean_speed_m_s": 10.0, "flow_veh_h": 7000.0, "density_veh_km": 180.0, "travel_time_s": 50.0, "gap_m": 15.0,
    "time_headway_s": 2.0, "lane_changes_per_km": 1.0, "wave_speed_m_s": -5.0,
}  # fmt: skip


def row(population: str, far: float, **figures: float) -> dict[str, object]:
    distances = {name: far for name in words.CLOSENESS if not name.startswith(words.DEVIATION)}
    return {words.POPULATION: population, **RECORDED, **distances, **figures}


def table(*rows: dict[str, object]) -> pd.DataFrame:
    return pd.DataFrame([{words.POPULATION: words.RECORDED, **RECORDED}, *rows])


def test_the_population_with_the_smallest_distances_is_closest() -> None:
    some = table(row("far", 3.0, gap_m=30.0), row("near", 1.0, lane_changes_per_km=0.9))
    ranks = words.ranking(some)
    assert ranks[words.POPULATION].tolist() == ["near", "far"]
    said = words.in_words(some)
    assert said.startswith("Closest to the recording is near")
    assert "near: lane changes 10% too few" in said
    assert "far: median gap 100% too wide" in said


def test_seeds_are_averaged() -> None:
    some = table(row("a", 1.0), row("a", 5.0), row("b", 2.0))
    assert words.ranking(some)[words.POPULATION].tolist() == ["b", "a"]


def test_a_population_without_waves_is_said_to_have_none_and_is_last_in_it() -> None:
    some = table(row("still", 1.0, wave_speed_m_s=np.nan, gap_m=16.5), row("wavy", 1.0, wave_speed_m_s=-9.0))
    assert "still: median gap 10% too wide" in words.in_words(some)
    assert "and no backward-moving waves" in words.in_words(some)
    assert words.ranking(some).iloc[0][words.POPULATION] == "wavy"


def test_one_population_alone_is_not_called_closest() -> None:
    assert "Closest" not in words.in_words(table(row("only", 1.0)))


def test_a_population_with_incidents_is_last_and_says_why() -> None:
    some = table(row("jammed", 1.0, never_inserted=3.0), row("sane", 2.0, never_inserted=0.0))
    ranks = words.ranking(some)
    assert ranks[words.POPULATION].tolist() == ["sane", "jammed"]
    assert ranks["rank"].tolist() == [1, 2]
    assert ranks["disqualified"].tolist() == ["", "3 never inserted"]
    said = words.in_words(some)
    assert said.startswith("Closest to the recording is sane")
    assert "Not to be trusted, whatever their other figures: jammed: 3 never inserted." in said


def test_where_all_have_incidents_none_is_called_closest() -> None:
    said = words.in_words(table(row("one", 1.0, collisions=1.0), row("other", 2.0, teleports=2.0)))
    assert "Closest" not in said
    assert "one: 1 collisions; other: 2 teleports" in said
