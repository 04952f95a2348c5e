"""Help that teaches: examples that run, mistyped words that are understood, completion for shells."""

from __future__ import annotations

import argparse
import shlex
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import shtab

from idm_sumo.cli import main, options
from idm_sumo.cli.parser import SHELLS, build_parser
from idm_sumo.recordings.fetch import fetch
from tests.helpers.platoons import platoon_recording
from tests.helpers.portal_server import Portal

WIDTH = 80  # columns of a terminal


def commands(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield the parser of every command, in the order of the help."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                inner = list(commands(command))
                yield from inner or [command]


COMMANDS = {command.prog.removeprefix("idm-sumo "): command for command in commands(build_parser())}


def examples(name: str) -> list[list[str]]:
    """Return the example lines of a command's help, as words."""
    epilog = COMMANDS[name].epilog or ""
    return [shlex.split(line) for line in epilog.splitlines() if line.startswith("  idm-sumo ")]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two small recordings, in which the examples run one after the other."""
    folder = tmp_path_factory.mktemp("examples")
    for name in ("RECORDING", "surrogate"):
        platoon_recording().to_parquet(folder / f"{name}.parquet")
    return folder


@pytest.mark.parametrize("name", [name for name in COMMANDS if not name.startswith("irl")])
def test_examples_run_as_they_stand(name: str, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert examples(name)
    monkeypatch.chdir(place)
    with Portal() as portal:
        monkeypatch.setitem(fetch.__kwdefaults__ or {}, "base_url", portal.url)
        for _, command, *words in examples(name):
            files = [f"{word}.parquet" if word in ("RECORDING", "surrogate") else word for word in words]
            main([command, *files])


@pytest.mark.parametrize("name", COMMANDS)
def test_help_says_what_is_read_what_is_left_and_what_comes_next(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(WIDTH))
    with pytest.raises(SystemExit) as stop:
        main([*name.split(), "--help"])
    assert stop.value.code == 0
    shown = capsys.readouterr().out
    for word in (
        "\nreads   ",
        "\nleaves  ",
        "\nnext    ",
        "\nexample:\n  idm-sumo ",
        "--seed N",
        "--jobs N",
        "--verbose",
    ):
        assert word in shown, word
    assert max(map(len, shown.splitlines())) <= WIDTH


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("inspct x", "inspect"),
        ("irl lern x", "learn"),
        ("calibrate x --outptu y", "--output"),
        ("replay x --vehicel 3", "--vehicle"),
        ("calibrate x -o y --objective speeed", "speed"),
    ],
)
def test_a_mistyped_word_is_one_line_that_names_what_was_meant(
    typed: str, meant: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(typed.split())
    assert stop.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert f"did you mean {meant}?" in lines[0]


def test_options_may_be_cut_short_and_files_may_begin_with_a_dash(capsys: pytest.CaptureFixture[str]) -> None:
    parsed = build_parser().parse_args(["calibrate", "--seed=3", "--out", "d.csv", "--", "--odd.txt"])
    assert (parsed.seed, parsed.output, parsed.recording) == (3, Path("d.csv"), ["--odd.txt"])


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_shells_take_the_completion(shell: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--print-completion", shell])
    assert stop.value.code == 0
    script = capsys.readouterr().out
    assert "calibrate" in script
    assert "--rollout-start" in script
    if shell == "bash":
        (tmp_path / "completion").write_text(script)
        subprocess.run(["bash", "-n", tmp_path / "completion"], check=True)


def test_shells_are_those_that_shtab_knows() -> None:
    assert tuple(shtab.SUPPORTED_SHELLS) == SHELLS


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out.startswith("idm-sumo ")


def test_no_path_may_be_empty() -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="not set"):
        options.path("")
    with pytest.raises(argparse.ArgumentTypeError, match="not set"):
        options.recording_name("")
    plain = [(name, action.dest) for name, one in COMMANDS.items() for action in one._actions if action.type is Path]
    assert plain == []
