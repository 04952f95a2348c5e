"""Outputs that would cost the user something are refused before the work."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from idm_sumo.cli import main
from idm_sumo.cli.parser import build_parser
from tests.helpers.platoons import platoon_recording

Trap = Callable[[Path], str]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    path = tmp_path / "in" / "r.parquet"
    path.parent.mkdir()
    platoon_recording(periods=1, platoons=1, cars=2).to_parquet(path)
    return path


def itself(recording: Path) -> str:
    return str(recording)


def by_another_path(recording: Path) -> str:
    return str(recording.parent / ".." / "in" / recording.name)


def by_symbolic_link(recording: Path) -> str:
    (link := recording.with_name("link.parquet")).symlink_to(recording)
    return str(link)


def by_hard_link(recording: Path) -> str:
    os.link(recording, link := recording.with_name("hard.parquet"))
    return str(link)


def a_folder(recording: Path) -> str:
    (folder := recording.with_name("d.parquet")).mkdir()
    return str(folder)


def a_pipe(recording: Path) -> str:
    os.mkfifo(pipe := recording.with_name("d.csv"))
    return str(pipe)


def a_device(recording: Path) -> str:
    (link := recording.with_name("d.csv")).symlink_to("/dev/null")
    return str(link)


def a_read_only_file(recording: Path) -> str:
    (file := recording.with_name("d.csv")).write_text("keep")
    file.chmod(0o444)
    return str(file)


def below_a_file(recording: Path) -> str:
    return str(recording / "d.csv")


def a_circle_of_links(recording: Path) -> str:
    (link := recording.with_name("d.csv")).symlink_to(link)
    return str(link)


def a_name_too_long(recording: Path) -> str:
    return str(recording.with_name("d" * 300 + ".csv"))


def another_ending(recording: Path) -> str:
    return str(recording.with_name("d.xlsx"))


FILES = (
    itself, by_another_path, by_symbolic_link, by_hard_link, a_folder, a_pipe, a_device, a_read_only_file, below_a_file,
    a_circle_of_links, a_name_too_long, another_ending,
)  # fmt: skip


def state(folder: Path) -> dict[str, object]:
    """Return what lies in a folder: kinds, targets and contents."""
    return {
        str(path): os.readlink(path)
        if path.is_symlink()
        else path.read_bytes()
        if path.is_file()
        else path.lstat().st_mode
        for path in folder.rglob("*")
    }


def refuse(arguments: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = state(folder)
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    said = capsys.readouterr().err.splitlines()
    assert stop.value.code == 2
    assert len(said) == 1, said  # no line of progress: the work has not begun
    assert state(folder) == before


@pytest.mark.parametrize("trap", FILES, ids=lambda trap: trap.__name__)
@pytest.mark.parametrize("command", ["calibrate", "predict"])
def test_files(command: str, trap: Trap, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    refuse([command, str(recording), "-o", trap(recording)], tmp_path, capsys)


def the_input(recording: Path) -> str:
    return str(recording)


def around_the_input(recording: Path) -> str:
    return str(recording.parent)


def a_link_around_the_input(recording: Path) -> str:
    (link := recording.parent.with_name("link")).symlink_to(recording.parent)
    return str(link)


def the_users_folder(recording: Path) -> str:
    (folder := recording.parent.with_name("mine")).mkdir()
    (folder / "manifest.json").write_text("{}")
    (folder / "scores.csv").write_text("years of work")
    return str(folder)


def a_pipe_for_a_folder(recording: Path) -> str:
    os.mkfifo(pipe := recording.with_name("pipe"))
    return str(pipe)


FOLDERS = (the_input, around_the_input, a_link_around_the_input, the_users_folder, a_pipe_for_a_folder, below_a_file)


@pytest.mark.parametrize("trap", FOLDERS, ids=lambda trap: trap.__name__)
@pytest.mark.parametrize("command", [["replay", "--vehicle", "1"], ["diagnose"], ["interactive"], ["reproduce"]])
def test_folders(
    command: list[str], trap: Trap, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refuse([command[0], str(recording), *command[1:], "-o", trap(recording)], tmp_path, capsys)


def test_a_recording_named_by_a_run_file_counts_as_an_input(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run.toml"
    run.write_text(f"recordings = [{str(recording)!r}]\n")
    refuse(["reproduce", "-c", str(run), "-o", str(recording.parent)], tmp_path, capsys)


def test_the_current_folder_is_not_replaced(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    refuse(["diagnose", str(recording), "-o", "."], tmp_path, capsys)


def test_every_command_that_writes_declares_it() -> None:
    parser = build_parser()
    commands = [parser]
    for one in commands:
        for action in one._actions:
            if isinstance(getattr(action, "choices", None), dict):
                commands += action.choices.values()
    writing = [one for one in commands if any(a.dest in ("output", "dest") for a in one._actions)]
    assert len(writing) >= 12
    assert [one.prog for one in writing if one.get_default("places") is None] == []


def test_an_output_within_the_folder_that_is_read_is_refused(
    recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = recording.parent
    for output in (folder / "d.parquet", folder / "below" / "d.parquet"):
        with pytest.raises(SystemExit, match="2"):
            main(["calibrate", str(folder), "-o", str(output)])
        assert "would be read with it" in capsys.readouterr().err
    assert list(folder.iterdir()) == [recording]
