"""The page that plays a replay, in a real browser."""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.replay.player import Played, player_data, write_player
from idm_sumo.recordings.recording import Recording
from idm_sumo.scenes.windows import Scenes, Window, build_scenes
from idm_sumo.simulation.rollout import drive_constant_velocity
from tests.helpers.browser import (
    complaints,
    least_contrast,
    overflows,
    prefer,
    requests,
    resize,
    visit,
)
from tests.helpers.builders import Car, recording

FRAMES, OBSERVED, HORIZON = 60, 10, 50
HOSTILE = "</script><script>document.title='taken'</script><b>&"


def traffic() -> Recording:
    cars = [Car(1, x=0.0, frames=FRAMES), Car(2, x=30.0, frames=FRAMES), Car(3, x=20.0, lane=2, first_frame=20)]
    return recording(*cars)


def one_driver(whole: Recording) -> Scenes:
    return build_scenes(whole, Window(OBSERVED, HORIZON), modelled=[1])


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    whole = traffic()
    scenes = one_driver(whole)
    driven = drive_constant_velocity(scenes)
    x = driven.x[0]
    fan = [(0.9, x - np.linspace(0.0, 5.0, len(x)), x + np.linspace(0.0, 5.0, len(x)))]
    played = [Played("idm_oracle", driven, fan=fan), Played("constant_velocity", driven, shown=False)]
    scores = pd.DataFrame({"method": ["idm_oracle", HOSTILE], "ade_m": [0.1, 0.2], "fde_m": [0.3, 0.4]})
    path = tmp_path_factory.mktemp("player") / "replay.html"
    write_player(path, whole, scenes, played, scores, title=HOSTILE, answer=HOSTILE, notes=[HOSTILE])
    return path


@pytest.fixture
def shown(browser: Any, page: Path) -> Any:
    resize(browser, 1280)
    prefer(browser, "light")
    visit(browser, page)
    return browser


def frame_of(driver: Any) -> float:
    driver.execute_script("return new Promise(requestAnimationFrame)")
    return float(driver.execute_script("return document.body.dataset.frame"))


def press(driver: Any, key: str) -> None:
    driver.execute_script("document.dispatchEvent(new KeyboardEvent('keydown', {key: arguments[0]}))", key)


def test_data_tell_where_everybody_is_and_whom_the_recorded_car_follows() -> None:
    whole = traffic()
    scenes = one_driver(whole)
    data = player_data(whole, scenes, [Played("idm_oracle", drive_constant_velocity(scenes))])
    assert len(data["recorded"]["x"]) == HORIZON + 1
    assert set(data["recorded"]["leader"]) == {2}
    assert data["recorded"]["gap"][0] == pytest.approx(30.0 - 4.0, abs=0.2)
    by_number = {vehicle["id"]: vehicle for vehicle in data["traffic"]}
    assert set(by_number) == {2, 3}
    start = int(scenes.first_frame[0]) + scenes.start
    assert by_number[3]["first"] == 20 - start  # it comes later
    assert data["models"][0]["x"][-1] == pytest.approx(data["recorded"]["x"][-1], abs=0.3)
    json.dumps(data, allow_nan=False)


def test_the_page_is_one_file_without_any_address(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"https?:|//[a-z]+\.", text)
    assert not re.search(r"<(?:script|link|img)[^>]+(?:src|href)=", text)


def test_texts_from_files_never_become_markup(shown: Any) -> None:
    assert shown.title == HOSTILE
    assert shown.execute_script("return document.querySelectorAll('b').length") == 0


def test_it_opens_without_complaints_or_requests(shown: Any) -> None:
    frame_of(shown)
    assert complaints(shown) == []
    assert requests(shown) == []


def test_play_advances_the_car_and_pause_holds_it(shown: Any) -> None:
    assert frame_of(shown) == 0.0
    shown.find_element("id", "play").click()
    for _ in range(100):
        if frame_of(shown) > 3.0:
            break
        time.sleep(0.05)
    assert frame_of(shown) > 3.0
    shown.find_element("id", "play").click()
    held = frame_of(shown)
    time.sleep(0.3)
    assert frame_of(shown) == held


def test_scrubbing_sets_the_frame_and_the_figures_of_the_moment(shown: Any) -> None:
    scrub = "const s = document.getElementById('scrub'); s.value = 25; s.dispatchEvent(new Event('input'))"
    shown.execute_script(scrub)
    assert frame_of(shown) == 25.0
    assert "2.5 s of 5.0 s" in shown.find_element("id", "clock").text
    rows = shown.find_elements("css selector", "#moment tr")
    assert [row.find_element("tag name", "td").text for row in rows] == ["recorded", "IDM, oracle"]


def test_keys_step_and_play(shown: Any) -> None:
    for key, expected in [("ArrowRight", 1.0), ("PageDown", 11.0), ("ArrowLeft", 10.0), ("End", 50.0), ("Home", 0.0)]:
        press(shown, key)
        assert frame_of(shown) == expected
    press(shown, " ")
    frame_of(shown)
    assert shown.execute_script("return document.body.dataset.playing") == "true"


def test_models_can_be_switched(shown: Any) -> None:
    boxes = shown.find_elements("css selector", "#models input")
    assert [box.is_selected() for box in boxes] == [True, False]
    boxes[1].click()
    frame_of(shown)
    assert len(shown.find_elements("css selector", "#moment tr")) == 3


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_screen(shown: Any, width: int) -> None:
    resize(shown, width)
    frame_of(shown)
    assert not overflows(shown)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_both_colour_schemes(shown: Any, scheme: str) -> None:
    prefer(shown, scheme)
    ratio, where = least_contrast(shown)
    assert ratio >= 4.5, where


@pytest.mark.parametrize("width", [390, 1280])
def test_models_apart_have_a_road_each_and_play_together(browser: Any, tmp_path: Path, width: int) -> None:
    whole = traffic()
    scenes = one_driver(whole)
    played = [Played(name, drive_constant_velocity(scenes)) for name in ("base", "extended")]
    scores = pd.DataFrame({"method": ["base", "extended"], "ade_m": [0.2, 0.1]})
    write_player(tmp_path / "apart.html", whole, scenes, played, scores, title="two", answer="", apart=True)
    resize(browser, width)
    visit(browser, tmp_path / "apart.html")
    frame_of(browser)
    names = [one.text for one in browser.find_elements("css selector", "#roads figcaption")]
    assert names == ["base model", "extended model"]
    pixels = "return [...document.querySelectorAll('canvas.road')].map((c) => c.toDataURL())"
    before = browser.execute_script(pixels)
    press(browser, "End")
    frame_of(browser)
    after = browser.execute_script(pixels)
    assert len(before) == 2
    assert all(one != other for one, other in zip(before, after, strict=True))
    assert not overflows(browser)
    assert complaints(browser) == []


def test_dark_mode_changes_the_drawing(shown: Any) -> None:
    pixel = "const c = document.getElementById('road'); return [...c.getContext('2d').getImageData(5, 30, 1, 1).data]"
    frame_of(shown)
    light = shown.execute_script(pixel)
    prefer(shown, "dark")
    frame_of(shown)
    assert sum(shown.execute_script(pixel)[:3]) < sum(light[:3])
