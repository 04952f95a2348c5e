"""Where caches stand, and that kernels of other sources are never used."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from idm_sumo.runtime.environment import NUMBA_CACHE, SOURCES, find_places_for_caches, fingerprint, forget_older_kernels


@pytest.fixture
def package(tmp_path: Path) -> Path:
    for room in ("models", "simulation", "analysis"):
        folder = tmp_path / "package" / room / "__pycache__"
        folder.mkdir(parents=True)
        folder.with_name("kernel.py").write_text("VALUE = 1\n")
        (folder / "kernel.step-1.py311.nbi").write_bytes(b"machine code")
    return tmp_path / "package"


def kernels(package: Path) -> int:
    return len(list(package.rglob("*.nbi")))


def test_kernels_stay_while_the_sources_are_the_same(package: Path) -> None:
    forget_older_kernels(package)
    assert kernels(package) == 0  # nobody knows what they were compiled from
    (package / "models" / "__pycache__" / "new.nbi").write_bytes(b"machine code")
    forget_older_kernels(package)
    assert kernels(package) == 1


def test_a_change_in_any_room_forgets_the_kernels_of_all(package: Path) -> None:
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / SOURCES).write_text(fingerprint(package))
    forget_older_kernels(package)
    assert kernels(package) == 3
    (package / "simulation" / "kernel.py").write_text("VALUE = 2\n")
    forget_older_kernels(package)
    assert kernels(package) == 0


def test_equal_sources_have_one_name_wherever_they_stand(package: Path, tmp_path: Path) -> None:
    moved = package.rename(tmp_path / "elsewhere")
    before = fingerprint(moved)
    (moved / "analysis" / "kernel.py").write_text("no room of ours\n")
    assert fingerprint(moved) == before
    (moved / "models" / "kernel.py").rename(moved / "models" / "other.py")
    assert fingerprint(moved) != before


def test_a_read_only_package_keeps_its_kernels_by_version_in_the_users_cache(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv(NUMBA_CACHE, raising=False)
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != package)
    find_places_for_caches(package)
    assert os.environ[NUMBA_CACHE] == str(tmp_path / "cache" / "idm-sumo" / f"kernels-{fingerprint(package)}")
    monkeypatch.delenv(NUMBA_CACHE)
