import numpy as np

from idm_sumo.recordings.periods import split_periods

# Global_Time - 100 * Frame_ID of the three official US-101 files.
STARTS = np.array([1118846978900, 1118847842000, 1118848757000])


def official(rows: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    period = np.repeat([0, 1, 2], rows)
    frame = np.tile(np.arange(1, rows + 1), 3)
    vehicle = np.tile(np.arange(rows) // 30 + 1, 3)
    return period, vehicle, frame, STARTS[period] + 100 * frame


def test_official_starts_become_the_papers_periods() -> None:
    period, vehicle, frame, clock = official()
    labels, note = split_periods(vehicle, frame, clock)
    assert list(labels.categories) == ["0750-0805", "0805-0820", "0820-0835"]
    assert (labels.codes == period).all()
    assert note == ""


def test_periods_that_overlap_in_time_are_told_apart() -> None:
    frame = np.concatenate([np.arange(9000, 9500), np.arange(1, 500)])  # late in the first, early in the second
    period = np.repeat([0, 1], [500, 499])
    clock = STARTS[period] + 100 * frame
    assert clock[:500].max() > clock[500:].min()
    labels, _ = split_periods(np.ones(999, dtype=np.int64), frame, clock)
    assert (labels.codes == period).all()


def test_a_handful_of_irregular_clocks_stay_with_their_period() -> None:
    period, vehicle, frame, clock = official()
    clock[[10, 11, 350, 700]] += [700, 1700, -2300, 40_000]
    labels, note = split_periods(vehicle, frame, clock)
    assert (labels.codes == period).all()
    assert note == ""


def test_restarting_numbers_split_when_the_clock_does_not_follow() -> None:
    rng = np.random.default_rng(1)
    vehicle = np.concatenate([np.repeat(np.arange(1, 301), 5), np.repeat(np.arange(1, 301), 5)])
    clock = STARTS[0] + np.concatenate([np.arange(1500) * 400, 900_000 + np.arange(1500) * 400])
    labels, note = split_periods(vehicle, rng.integers(1, 9000, 3000), clock)
    assert (labels.codes == np.repeat([0, 1], 1500)).all()
    assert list(labels.categories) == ["0750-0805", "0805-0820"]
    assert "restarting vehicle numbers" in note


def test_two_days_at_the_same_hour_get_two_names() -> None:
    frame = np.tile(np.arange(100), 2)
    clock = np.repeat([STARTS[0], STARTS[0] + 86_400_000], 100) + 100 * frame
    labels, _ = split_periods(np.ones(200, dtype=np.int64), frame, clock)
    assert list(labels.categories) == ["0750-0805", "0750-0805-2"]


def test_a_clock_that_is_no_date_is_numbered() -> None:
    labels, _ = split_periods(np.ones(50, dtype=np.int64), np.arange(50), 100 * np.arange(50))
    assert list(labels.categories) == ["period-1"]
