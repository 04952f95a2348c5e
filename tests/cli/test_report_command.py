"""The command that shows a result's page."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from idm_sumo.cli.report_command import page_of
from idm_sumo.runtime.errors import InputError


@pytest.fixture
def result(tmp_path: Path) -> Path:
    folder = tmp_path / "a result"
    folder.mkdir()
    (folder / "replay.html").write_text("<p>page</p>")
    return folder


def shown(folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the command in an environment with or without a browser."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    kept = {name: value for name, value in os.environ.items() if name not in screens}
    command = [sys.executable, "-m", "idm_sumo", "report", str(folder)]
    return subprocess.run(command, env=kept | environment, capture_output=True, text=True, check=False)


def test_a_browser_gets_the_address_of_the_page(result: Path, tmp_path: Path) -> None:
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > "{tmp_path}/opened"\n')
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    done = shown(result, BROWSER=f"{browser} %s")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "opened").read_text().strip() == (result / "replay.html").as_uri()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a screen")
def test_a_machine_without_a_screen_is_told_the_path(result: Path) -> None:
    done = shown(result)
    assert done.returncode == 0
    assert str(result / "replay.html") in done.stdout


def test_a_folder_without_a_page_is_refused_and_the_nearest_page_named(result: Path) -> None:
    assert page_of(result / "replay.html") == result / "replay.html"
    with pytest.raises(InputError, match=r"there is one in .*a result"):
        page_of(result.parent)
    with pytest.raises(InputError, match="reproduce -o DIR"):
        page_of(result / "nothing")
