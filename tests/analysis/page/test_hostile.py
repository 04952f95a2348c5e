"""Names, ids and periods of files reach no page as markup: every page, made by its own command."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.page.page import render
from analysis.page.style import new_figure, save
from analysis.page.time_space import Mark, diagram
from analysis.replay.player import Played, write_player
from analysis.reproduce.replays import file_name
from idm_sumo.cli import main
from idm_sumo.evaluation.metrics import score
from idm_sumo.recordings.recording import Recording
from idm_sumo.scenes.windows import Window, build_scenes
from idm_sumo.simulation.rollout import drive_constant_velocity
from tests.helpers.browser import complaints, requests, visit
from tests.helpers.builders import Car, recording
from tests.helpers.hostile import HOSTILE, HOSTILE_NAME, MARK, foreign_elements


def through(number: int, lane: int, first: int) -> Car:
    """Return a car that drives through the whole section."""
    return Car(number, 0.5, lane, 12.0, first_frame=first, frames=500)


def stream(period: str) -> Recording:
    """Return traffic of two lanes."""
    cars = [through(20 * lane + n, lane, 40 * n + 5 * lane) for lane in (2, 3) for n in range(8)]
    return recording(*cars, period=period)


def write(one: Recording, folder: Path, name: str = HOSTILE_NAME) -> Path:
    """Write a recording in our own columns."""
    path = folder / f"{name}.parquet"
    one.table.to_parquet(path)
    return path


def compare(folder: Path) -> list[Path]:
    files = [str(write(stream(HOSTILE), folder)), str(write(stream(HOSTILE), folder, f"other {HOSTILE_NAME}"))]
    main(["compare", *files, "-o", str(folder / "out")])
    return [folder / "out" / "report.html"]


def interactive(folder: Path) -> list[Path]:
    file = write(stream(HOSTILE), folder)
    main(["interactive", str(file), "--types", "default-idm", "--replay-bias", "0", "--jobs", "1",
          "-o", str(folder / "out")])  # fmt: skip
    return [folder / "out" / "report.html"]


def replay(folder: Path) -> list[Path]:
    """The page of the command, whose models are called after their tables' files."""
    whole = stream(HOSTILE)
    scenes = build_scenes(whole, Window(), modelled=[43])
    driven = drive_constant_velocity(scenes)
    scores = score(scenes, driven).assign(method=HOSTILE_NAME)[["method", "ade_m"]]
    played = [Played(HOSTILE_NAME, driven), Played(HOSTILE, driven)]
    write_player(
        folder / "replay.html", whole, scenes, played, scores, title=HOSTILE, answer=HOSTILE, notes=[HOSTILE],
        footnote=HOSTILE, apart=True,
    )  # fmt: skip
    return [folder / "replay.html"]


def diagnose(folder: Path) -> list[Path]:
    main(["diagnose", str(write(stream(HOSTILE), folder)), "--jobs", "1", "-o", str(folder / "out")])
    return [folder / "out" / "report.html"]


def time_space(folder: Path) -> list[Path]:
    figure, _ = new_figure()
    save(figure, folder / "comparison.png")
    one = stream(HOSTILE)
    marked = diagram("1", HOSTILE, one, HOSTILE, fastest=15.0, marks=[Mark(HOSTILE, place=(20.0, 60.0))])
    table = pd.DataFrame({HOSTILE: [HOSTILE], "ade_m": [np.nan]})
    sections = [{"title": HOSTILE, "measures": table, "distances": table}]
    render(
        folder / "page.html", "comparison/report.html.j2", title=HOSTILE, findings=HOSTILE, not_measured=HOSTILE,
        figures=folder, diagrams=[marked], sections=sections, notes=[HOSTILE],
    )  # fmt: skip
    return [folder / "page.html"]


PAGES = (compare, interactive, replay, diagnose, time_space)


def check(browser: Any, pages: list[Path]) -> None:
    """Look for elements that no template has, and for complaints of the browser."""
    assert pages
    for page in pages:
        assert foreign_elements(page) == []
    assert MARK in pages[0].read_text(encoding="utf-8")  # the values are there, as text
    for page in pages[:2]:
        visit(browser, page)
        browser.execute_script("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert browser.execute_script("return document.querySelectorAll(`[id=${arguments[0]}]`).length", MARK) == 0
        assert complaints(browser) == []
        assert requests(browser) == []


@pytest.mark.parametrize("make", PAGES, ids=lambda make: make.__name__)
def test_no_value_of_a_file_becomes_an_element(
    make: Callable[[Path], list[Path]], tmp_path: Path, browser: Any
) -> None:
    check(browser, make(tmp_path))


def test_no_value_of_a_file_becomes_an_element_of_a_study(platoon_study: Path, browser: Any) -> None:
    check(browser, [platoon_study / "report.html", *sorted((platoon_study / "replays").glob("*.html"))])


def test_a_period_that_no_file_can_be_named_after_is_called_by_its_number() -> None:
    assert file_name("0750-0805", ["0750-0805"]) == "0750-0805"
    assert file_name("../a", ["0750-0805", "../a"]) == "2"
    assert file_name(HOSTILE, [HOSTILE]) == "1"
