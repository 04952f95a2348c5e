"""Pages of several diagnoses, in a real browser: what they list, where links lead, that nothing is markup."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from analysis.many.dataset import PAGE, RECORDING
from analysis.many.pages import page_of_all, page_of_one
from analysis.many.summary import summary_of
from tests.helpers.browser import complaints, requests, visit
from tests.helpers.hostile import HOSTILE, HOSTILE_NAME, foreign_elements

LATE = ("first-1", "second-2")


def diagnosis(tau: float | None) -> dict[str, Any]:
    """Return a diagnosis that names a delay, or finds nothing."""
    size = {} if tau is None else {"tau": {"value": tau, "unit": "s", "ci95": [tau - 0.1, tau + 0.1]}}
    where = {"position_m": [200.0, 300.0], "time_s": [0.0, 60.0], "lanes": [1, 2, 4]}
    cause = {
        "name": "reaction_delay", "parameters": size, "where": where, "p_value": 1e-6, "evidence": HOSTILE,
        "one_of": ["hysteresis"], "effective_drivers": 31.0,
    }  # fmt: skip
    gain = {"metric": "ade_m", "base": 1.0, "extended": 0.9, "difference": 0.1, "ci95": [0.05, 0.15], "vehicles": 20}
    return {
        "verdict": "none" if tau is None else "named", "law": "idm", "causes": [] if tau is None else [cause],
        "without_gain": [], "gain": gain if tau else {**gain, "vehicles": 0}, "untestable": {"leader_class": HOSTILE},
        "unexplained": [{"covariate": "gap", "range": [3.0, 9.0], "p_value": 0.001}],
        "ruled_out": [{"name": "hysteresis", "p_value": 0.4, "why": HOSTILE}],
    }  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings with a delay, one without, one that failed: pages where the data set has them."""
    place = tmp_path_factory.mktemp("diagnoses")
    contents = {LATE[0]: diagnosis(0.3), LATE[1]: diagnosis(0.5), "silent-3": diagnosis(None)}
    for name, content in contents.items():
        (own := place / f"{RECORDING}{name}").mkdir()
        (own / PAGE).write_text(page_of_one(HOSTILE_NAME, content, is_measured=name in LATE), encoding="utf-8")
    rows = pd.DataFrame([
        {"recording": name, "file": HOSTILE, "status": "done", "reason": "", "drivers": 40, "measured": name in LATE,
         "vehicle_seconds": 100.0}
        for name in contents
    ] + [{"recording": "", "file": HOSTILE_NAME, "status": "failed", "reason": HOSTILE}])  # fmt: skip
    page = page_of_all(rows, summary_of(rows, contents.values()), contents)
    (place / PAGE).write_text(page, encoding="utf-8")
    return place


def cells(browser: Any, table: int) -> list[list[str]]:
    """Return the texts of a table's rows."""
    (body,) = browser.find_elements("css selector", "table.numbers")[table].find_elements("css selector", "tbody")
    rows = body.find_elements("css selector", "tr")
    return [[cell.text for cell in row.find_elements("css selector", "td")] for row in rows]


def test_it_lists_every_recording_and_what_they_say_together(browser: Any, folder: Path) -> None:
    visit(browser, folder / PAGE)
    (cause,) = cells(browser, 0)
    assert cause[:5] == ["reaction_delay", "2 of 3", "0", "tau", "0.4"]
    recordings = cells(browser, 1)
    assert [row[0] for row in recordings] == [*LATE, "silent-3"]
    assert [row[1] for row in recordings] == ["named", "named", "none"]
    assert recordings[0][2] == "reaction_delay: tau = 0.3 s (0.2 to 0.4)"
    assert [row[6] for row in recordings] == [*["0.1 m (0.05 to 0.15), of 1 m"] * 2, "not measured"]
    assert cells(browser, 2) == [[HOSTILE_NAME, HOSTILE]]
    assert "silent-3 is a surrogate recording" in browser.find_element("css selector", ".warn").text


def test_links_lead_to_each_recordings_page_and_back(browser: Any, folder: Path) -> None:
    visit(browser, folder / PAGE)
    browser.find_element("link text", LATE[1]).click()
    assert "Verdict: causes are named" in browser.find_element("css selector", ".answer").text
    assert cells(browser, 0)[0][:3] == [
        "reaction_delay",
        "tau = 0.5 s (0.4 to 0.6)",
        "200 to 300 m, 0 to 60 s, lanes 1-2, 4",
    ]
    browser.find_element("link text", "All recordings").click()
    assert browser.title == "3 recordings diagnosed"


def test_no_value_becomes_an_element_and_nothing_is_asked_for(browser: Any, folder: Path) -> None:
    for page in (folder / PAGE, *folder.glob(f"*/{PAGE}")):
        assert foreign_elements(page) == []
        visit(browser, page)
        assert complaints(browser) == []
        assert requests(browser) == []
