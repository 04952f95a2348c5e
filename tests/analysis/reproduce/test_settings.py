from __future__ import annotations

from pathlib import Path

import pytest

from analysis.reproduce.settings import Settings, load_settings
from idm_sumo.runtime.errors import InputError

ROOT = Path(__file__).parents[3]


def test_every_named_run_loads() -> None:
    runs = sorted((ROOT / "runs").glob("*.toml"))
    assert runs
    for run in runs:
        assert isinstance(load_settings(run, {}), Settings)


def test_command_line_wins_over_file(tmp_path: Path) -> None:
    run = tmp_path / "run.toml"
    run.write_text("neighbours = 5\nseed = 7\n")
    settings = load_settings(run, {"neighbours": 12, "seed": None})
    assert (settings.neighbours, settings.seed) == (12, 7)


def test_window_follows_the_start() -> None:
    assert load_settings(None, {"observed": 10, "horizon": 100}).window.frames == 110
    assert load_settings(None, {"rollout_start": "entry"}).window.start == 0


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("neigbours = 8", "neigbours"),
        ("observed = 0", "observed"),
        ("backend = 'carla'", "backend"),
        ("seed = 1.5", "seed"),
    ],
)
def test_a_bad_key_or_value_is_named(tmp_path: Path, text: str, key: str) -> None:
    run = tmp_path / "run.toml"
    run.write_text(text)
    with pytest.raises(InputError, match=f"run.toml: key '{key}'") as caught:
        load_settings(run, {})
    assert "\n" not in str(caught.value)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_settings(tmp_path / "none.toml", {})
