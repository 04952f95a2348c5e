"""Results: complete or absent, whatever happens, and nothing of the user's lost."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from idm_sumo.runtime import exchange
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import MANIFEST, new_file, new_files, new_folder
from idm_sumo.runtime.ownership import FILES, is_whole
from idm_sumo.runtime.siblings import PREFIX, lock_of, scratch, sibling
from tests.helpers.faults import Faults


def write_folder(out: Path, text: str) -> None:
    with new_folder(out) as part:
        (part / "table.csv").write_text(text)
        (part / "figures").mkdir()
        (part / "figures" / "a.png").write_text(text)
        (part / MANIFEST).write_text(json.dumps({"command": text}))


def content(path: Path) -> dict[str, str]:
    """Return every file of a folder, without the manifest."""
    return {
        str(p.relative_to(path)): p.read_text() for p in sorted(path.rglob("*")) if p.is_file() and p.name != MANIFEST
    }


def result(text: str) -> dict[str, str]:
    return {"figures/a.png": text, "table.csv": text}


def test_file_appears_whole(tmp_path: Path) -> None:
    with new_file(tmp_path / "a.rou.xml") as part:
        part.write_text("<routes/>")
        assert part.name.endswith(".rou.xml")
        assert not (tmp_path / "a.rou.xml").exists()
    assert (tmp_path / "a.rou.xml").read_text() == "<routes/>"
    assert [p.name for p in tmp_path.iterdir()] == ["a.rou.xml"]


def test_failure_keeps_the_earlier_file(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("old")
    with pytest.raises(RuntimeError), new_file(tmp_path / "a.csv") as part:
        part.write_text("half")
        raise RuntimeError
    assert (tmp_path / "a.csv").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]


def test_folders_above_are_made_and_go_again_on_failure(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), new_file(tmp_path / "new" / "deep" / "a.csv"):
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []
    write_folder(tmp_path / "new" / "deep" / "out", "x")
    assert content(tmp_path / "new" / "deep" / "out") == result("x")


def test_folder_replaces_only_an_earlier_result_as_it_was_written(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_folder(out, "one")
    write_folder(out, "two")
    assert content(out) == result("two")
    assert set(json.loads((out / MANIFEST).read_text())[FILES]) == set(result(""))
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def _add(out: Path) -> None:
    (out / "notes.txt").write_text("mine")


def _add_below(out: Path) -> None:
    (out / "figures" / "mine.png").write_text("mine")


def _change(out: Path) -> None:
    (out / "table.csv").write_text("corrected by hand")


def _link(out: Path) -> None:
    (out / "table.csv").unlink()
    (out / "table.csv").symlink_to("figures/a.png")


def _other_manifest(out: Path) -> None:
    (out / MANIFEST).write_text('{"name": "a browser extension"}')


def _no_manifest(out: Path) -> None:
    (out / MANIFEST).unlink()


def _deep_manifest(out: Path) -> None:
    (out / MANIFEST).write_text("[" * 100_000)


@pytest.mark.parametrize(
    "change",
    [_add, _add_below, _change, _link, _other_manifest, _no_manifest, _deep_manifest],
    ids=lambda c: c.__name__,
)
def test_what_a_run_did_not_write_is_refused_before_the_work(tmp_path: Path, change: Callable[[Path], None]) -> None:
    out = tmp_path / "out"
    write_folder(out, "one")
    change(out)
    before = content(out)
    with pytest.raises(InputError, match="no earlier result"), new_folder(out):
        pytest.fail("the work began")
    assert content(out) == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_file_that_comes_during_the_work_is_not_lost(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_folder(out, "one")
    with pytest.raises(InputError, match=r"notes\.txt"), new_folder(out):
        _add(out)
    assert (out / "notes.txt").read_text() == "mine"


def test_a_manifest_tells_a_whole_folder_from_a_damaged_one(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_folder(out, "one")
    assert is_whole(out)
    (out / "table.csv").unlink()
    assert not is_whole(out)
    assert not is_whole(tmp_path / "absent")


def test_links_stay_links(tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    for name in ("there", "not yet"):
        (tmp_path / name).symlink_to(tmp_path / "disk" / f"{name}.csv")
    (tmp_path / "disk" / "there.csv").write_text("old")
    for name in ("there", "not yet"):
        with new_file(tmp_path / name) as part:
            part.write_text("new")
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / "disk" / f"{name}.csv").read_text() == "new"
    (tmp_path / "out").symlink_to(tmp_path / "disk" / "out")
    write_folder(tmp_path / "out", "new")
    assert (tmp_path / "out").is_symlink()
    assert content(tmp_path / "disk" / "out") == result("new")


def test_permissions_follow_the_umask_or_the_file_that_was_there(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        with new_file(tmp_path / "a.csv") as part:
            part.write_text("x")
        write_folder(tmp_path / "out", "x")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o640
    assert stat.S_IMODE((tmp_path / "out").stat().st_mode) == 0o750
    (tmp_path / "a.csv").chmod(0o600)
    with new_file(tmp_path / "a.csv") as part:
        part.write_text("y")
    assert stat.S_IMODE((tmp_path / "a.csv").stat().st_mode) == 0o600


def test_leftovers_of_killed_runs_are_swept_and_those_of_living_ones_stay(tmp_path: Path) -> None:
    dead = f"{PREFIX}{'0' * 12}.{'a' * 8}"
    (tmp_path / f"{dead}.csv").write_text("half")
    (tmp_path / dead).mkdir()
    (tmp_path / dead / "half").write_text("half")
    (tmp_path / f"{PREFIX}toml").write_text("a user's own")
    with sibling(tmp_path / "other.csv") as alive:
        with new_file(tmp_path / "a.csv") as part:
            part.write_text("x")
        assert alive.exists()
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted(["a.csv", alive.name, f"{PREFIX}toml"])


def test_an_old_result_that_a_killed_run_had_moved_aside_comes_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    write_folder(out, "old")
    monkeypatch.setattr(exchange, "exchange", lambda one, other: False)
    # A kill between the two renames leaves the old result under its other name.
    with sibling(out, folder=True) as part:
        aside = exchange.old_name(part)
    out.rename(aside)
    with pytest.raises(RuntimeError), new_folder(out):
        raise RuntimeError
    assert content(out) == result("old")
    write_folder(out, "new")
    assert content(out) == result("new")
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_one_holds_a_lock_at_a_time(tmp_path: Path) -> None:
    first = lock_of(tmp_path)
    assert first is not None
    assert lock_of(tmp_path) is None
    os.close(first)
    second = lock_of(tmp_path)
    assert second is not None
    os.close(second)


def test_scratch_is_private_and_gone_afterwards(tmp_path: Path) -> None:
    with scratch(tmp_path) as folder:
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        (folder / "a").write_text("x")
    assert list(tmp_path.iterdir()) == []


def one_file(folder: Path, text: str) -> None:
    with new_file(folder / "a.csv") as part:
        part.write_text(text)


def three_files(folder: Path, text: str) -> None:
    with new_files([folder / name for name in ("a.xml", "b.xml", "c.xml")]) as parts:
        for part in parts:
            part.write_text(text)


def one_folder(folder: Path, text: str) -> None:
    write_folder(folder / "out", text)


WRITERS = [(one_file, True), (three_files, True), (one_folder, True), (one_folder, False)]


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
@pytest.mark.parametrize("late", [False, True], ids=["before the call", "after the call"])
@pytest.mark.parametrize("earlier", [True, False], ids=["over an old result", "anew"])
@pytest.mark.parametrize(("writer", "atomic"), WRITERS)
def test_a_fault_at_any_system_call_leaves_the_old_result_or_the_new_one(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    writer: Callable[[Path, str], None],
    earlier: bool,
    late: bool,
    error: type[BaseException],
    atomic: bool,
) -> None:
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # a disk's time, not its faults
    if not atomic:
        monkeypatch.setattr(exchange, "exchange", lambda one, other: False)
    call, finished = 0, False
    while not finished:
        call += 1
        place = tmp_path / str(call)
        place.mkdir()
        if earlier:
            writer(place, "old")
        old = content(place)
        with Faults(monkeypatch, at=call, error=error, late=late) as faults, suppress(error, InputError):
            writer(place, "new")
        finished = faults.count < call
        writer_left = {name: text for name, text in content(place).items() if PREFIX not in name}
        new = dict.fromkeys(writer_left, "new") if writer_left else {}
        assert writer_left in (old, new), (call, faults.name, writer_left)
        assert len(writer_left) in (len(old), {one_file: 1, three_files: 3, one_folder: 2}[writer])
        writer(place, "again")
        assert set(content(place).values()) == {"again"}
        assert not [p for p in place.iterdir() if p.name.startswith(PREFIX)], (call, faults.name)
    assert call > 10
