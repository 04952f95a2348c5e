"""What all reports share, in a real browser: contents, tables that sort, diagrams that zoom."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.page.page import html_table, with_contents
from analysis.page.style import LABEL_HEIGHT, METHOD_COLOURS, dark_colour, label_ends, method_line, new_figure
from analysis.page.time_space import DARK_PAGE, LIGHT_PAGE, Mark, diagram, diagrams_of
from tests.helpers.browser import complaints, least_contrast, overflows, prefer, requests, resize, visit
from tests.helpers.builders import Car, recording

VEHICLES = 20


def traffic() -> Any:
    cars = [Car(n, x=-15.0 * n, lane=1 + n % 2, speed=10.0 + n % 3, frames=200) for n in range(1, VEHICLES + 1)]
    return recording(*cars)


def fill(path: Path, tables: list[pd.DataFrame], diagrams: list[dict[str, Any]]) -> Path:
    """Write a page of the reports' frame, through the template of comparisons."""
    from analysis.page.page import render
    from analysis.page.style import new_figure, save

    figures = path.parent
    figure, _ = new_figure()
    save(figure, figures / "comparison.png")
    sections = [{"title": f"Section {k}", "measures": table, "distances": table[:2]} for k, table in enumerate(tables)]
    render(
        path, "comparison/report.html.j2", title="A page", findings="An answer.", not_measured="", figures=figures,
        diagrams=diagrams, sections=sections, notes=[],
    )  # fmt: skip
    return path


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    numbers = [3.0, 20.0, 100.0, *range(101, 115)]
    table = pd.DataFrame({"vehicle": [f"car {n:g}" for n in numbers], "ade_m": numbers})
    whole = traffic()
    marked = diagram("9", "marked", whole, whole.periods[0], fastest=15.0, marks=[Mark("a place", place=(20.0, 60.0))])
    path = tmp_path_factory.mktemp("page") / "report.html"
    return fill(path, [table], [*diagrams_of({"recorded": whole}), marked])


@pytest.fixture
def shown(browser: Any, page: Path) -> Any:
    resize(browser, 1280)
    prefer(browser, "light")
    visit(browser, page)
    browser.execute_script("return new Promise(requestAnimationFrame)")
    return browser


def settle(driver: Any) -> None:
    driver.execute_script("return new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def test_it_opens_without_complaints_or_requests(shown: Any) -> None:
    settle(shown)
    assert complaints(shown) == []
    assert requests(shown) == []


def test_contents_lead_to_every_section(shown: Any) -> None:
    links = shown.find_elements("css selector", "nav a")
    assert [link.text for link in links] == [heading.text for heading in shown.find_elements("css selector", "h2")]
    for link in links:
        assert shown.find_elements("css selector", link.get_attribute("hash"))


def test_one_section_needs_no_contents() -> None:
    assert "<nav" not in with_contents("<!-- contents --><h2>only</h2>")


def test_a_header_sorts_by_number_and_back(shown: Any) -> None:
    def column() -> list[str]:
        return [
            cell.text for cell in shown.find_elements("css selector", "table.numbers:first-of-type td:nth-child(2)")
        ][:17]

    header = shown.find_elements("css selector", "table.numbers button.sort")[1]
    header.click()
    assert column()[:3] == ["3.00", "20.00", "100.00"]
    header.click()
    assert column()[0] == "114.00"
    assert shown.find_element("css selector", "th[aria-sort]").get_attribute("aria-sort") == "descending"


def test_a_filter_keeps_the_rows_with_the_word(shown: Any) -> None:
    shown.find_element("css selector", "input.filter").send_keys("car 20")
    rows = shown.find_elements("css selector", "table.numbers:first-of-type tbody tr")
    assert [row.text.split()[1] for row in rows if row.is_displayed()][:1] == ["20"]


def test_zooming_shows_less_and_all_diagrams_together(shown: Any) -> None:
    def points() -> list[int]:
        return [int(one.get_attribute("data-points")) for one in shown.find_elements("css selector", ".time-space")]

    before = points()
    assert before[0] > VEHICLES
    shown.find_element("css selector", "[data-do=nearer]").click()
    settle(shown)
    near = points()
    assert near[0] < before[0]
    assert near[0] == near[1]
    shown.find_element("css selector", "[data-do=whole]").click()
    settle(shown)
    assert points() == before


def test_a_lane_can_be_chosen(shown: Any) -> None:
    first = shown.find_element("css selector", ".time-space")
    whole = int(first.get_attribute("data-points"))
    choose = "const s = arguments[0].querySelector('select'); s.value = '1'; s.dispatchEvent(new Event('change'))"
    shown.execute_script(choose, first)
    settle(shown)
    assert 0 < int(first.get_attribute("data-points")) < whole


def test_pointing_tells_of_a_vehicle_and_a_click_keeps_it(shown: Any) -> None:
    from selenium.webdriver import ActionChains

    first = shown.find_element("css selector", ".time-space")
    canvas = first.find_element("tag name", "canvas")
    width, height = canvas.size["width"], canvas.size["height"]
    for share in (0.3, 0.5, 0.7):
        ActionChains(shown).move_to_element_with_offset(canvas, int((share - 0.5) * width), int(0.1 * height)).perform()
        if "vehicle" in first.find_element("class name", "tell").text.replace("for its vehicle", ""):
            break
    assert "m/s at" in first.find_element("class name", "tell").text
    ActionChains(shown).click().perform()
    settle(shown)
    assert first.get_attribute("data-chosen") != ""


@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_screen(shown: Any, width: int) -> None:
    resize(shown, width)
    settle(shown)
    assert not overflows(shown)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_can_be_read_in_both_colour_schemes(shown: Any, scheme: str) -> None:
    prefer(shown, scheme)
    ratio, where = least_contrast(shown)
    assert ratio >= 4.5, where


def test_cells_of_a_table_are_escaped() -> None:
    assert "<b>" not in html_table(pd.DataFrame({"method": ["<b>bold</b>"]}))


def test_an_hour_of_dense_traffic_stays_small() -> None:
    """Two thousand vehicles of a minute each in a quarter of an hour, four times over, fit into a page."""
    whole = traffic()
    one = diagram("1", "recorded", whole, whole.periods[0], fastest=15.0)
    seconds = sum(1 for _ in range(VEHICLES)) * 20
    assert len(str(one["data"])) / seconds < 12  # bytes a vehicle-second: 480,000 of an hour are below 6 MB


def test_colours_of_the_methods_on_a_dark_page_are_lighter() -> None:
    for name, colour in METHOD_COLOURS.items():
        light = sum(int(colour[k : k + 2], 16) for k in (1, 3, 5))
        dark = sum(int(dark_colour(name)[k : k + 2], 16) for k in (1, 3, 5))
        assert dark > light


# Sight without one kind of cone: Machado, Oliveira and Fernandes (2009), severity 1, linear RGB.
SIGHT = {
    "normal": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    "protanopia": (0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998),
    "deuteranopia": (0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.011820, 0.042940, 0.968881),
    "tritanopia": (1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.303900),
}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
TOLD_APART = 10.0  # CIE 1976 distance; 2.3 is just noticeable side by side


def lab(colour: str, sight: str) -> Any:
    """Return CIE L*a*b* of ``#rrggbb`` as somebody sees it (D65)."""
    rgb = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.reshape(SIGHT[sight], (3, 3)) @ np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(linear, 0, 1)
    t = xyz / np.array([0.9505, 1.0, 1.089])
    f = np.where(t > 0.008856, np.cbrt(t), 7.787 * t + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT)
def test_methods_are_told_apart_by_colour_or_else_by_stroke(sight: str) -> None:
    for one, other in combinations(METHOD_COLOURS, 2):
        apart = np.linalg.norm(lab(METHOD_COLOURS[one], sight) - lab(METHOD_COLOURS[other], sight))
        assert apart > TOLD_APART or method_line(one) != method_line(other), (one, other, apart)


def luminance(colour: str) -> float:
    """Return the relative luminance of ``#rrggbb`` (WCAG 2.1)."""
    rgb = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.where(rgb <= 0.03928, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize(("colours", "behind"), [(LIGHT_PAGE, "#ffffff"), (DARK_PAGE, "#161616")])
def test_paths_of_every_speed_are_seen_and_faster_is_lighter(colours: list[str], behind: str) -> None:
    lights = [luminance(colour) for colour in colours]
    assert (np.diff(lights) > 0).all()
    for light in lights:
        bright, dim = sorted((light, luminance(behind)), reverse=True)
        assert (bright + 0.05) / (dim + 0.05) > 1.8


def test_names_beside_lines_do_not_lie_on_each_other() -> None:
    _, (ax,) = new_figure()
    ax.set(xlim=(0, 10), ylim=(0, 20))
    names = ("a", "b", "c", "d")
    label_ends(ax, dict(zip(names, (3.0, 3.1, 3.2, 19.0), strict=True)), dict.fromkeys(names, "#000000"))
    heights = [text.get_position()[1] for text in ax.texts]
    assert np.diff(heights).min() >= LABEL_HEIGHT - 1e-9
    assert [text.get_text() for text in ax.texts] == list(names)
