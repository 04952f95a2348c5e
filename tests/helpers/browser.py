"""A real Chromium that opens pages from disk, cut off from every network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
SWITCHES = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip


@contextmanager
def open_browser() -> Iterator[Any]:
    """Yield a selenium driver; the test skips, and says so, where there is no Chromium."""
    program = next((path for name in PROGRAMS if (path := shutil.which(name))), None)
    chauffeur = shutil.which("chromedriver")
    if program is None or chauffeur is None:
        pytest.skip("no Chromium with its driver; install Debian's packages chromium and chromium-driver")
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for switch in SWITCHES:
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(chauffeur))
    try:
        yield driver
    finally:
        driver.quit()


def resize(driver: Any, width: int, height: int = 1000) -> None:
    """Give the page a screen of this size in px."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def prefer(driver: Any, scheme: str) -> None:
    """Ask for the ``light`` or ``dark`` colours."""
    feature = {"name": "prefers-color-scheme", "value": scheme}
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})


def visit(driver: Any, page: Path) -> None:
    """Open a page from disk; nothing that it asks for may lie outside it."""
    driver.get_log("browser")
    driver.get_log("performance")
    driver.get(page.as_uri())


def complaints(driver: Any) -> list[str]:
    """Return errors and warnings of the page's console."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


def requests(driver: Any) -> list[str]:
    """Return what the page has asked for beside itself and data that it holds."""
    import json

    asked = [json.loads(entry["message"])["message"] for entry in driver.get_log("performance")]
    urls = [one["params"]["request"]["url"] for one in asked if one["method"] == "Network.requestWillBeSent"]
    return [url for url in urls if not url.startswith(("data:", "blob:", "file:"))]


def overflows(driver: Any) -> bool:
    """Tell whether the page is wider than the screen."""
    return bool(driver.execute_script("return document.documentElement.scrollWidth > window.innerWidth"))


# Luminance and contrast as WCAG 2.1 defines them, over all text that is shown.
CONTRAST = """
const parse = (text) => (text.match(/[0-9.]+/g) || [0, 0, 0, 0]).map(Number);
const light = (rgb) => rgb.slice(0, 3).map((v) => v / 255)
  .map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
  .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
function background(element) {
  for (let one = element; one; one = one.parentElement) {
    const colour = parse(getComputedStyle(one).backgroundColor);
    if (colour.length < 4 || colour[3] > 0) return colour;
  }
  return [255, 255, 255];
}
let least = 21, where = "";
for (const element of document.querySelectorAll("body *")) {
  const text = [...element.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
  if (!text || !element.offsetParent || element.matches("script, style, option")) continue;
  const pair = [light(parse(getComputedStyle(element).color)), light(background(element))].sort((a, b) => b - a);
  const ratio = (pair[0] + 0.05) / (pair[1] + 0.05);
  if (ratio < least) { least = ratio; where = element.outerHTML.slice(0, 120); }
}
return [least, where];
"""


def least_contrast(driver: Any) -> tuple[float, str]:
    """Return the smallest contrast of a text with what lies behind it, and where."""
    ratio, where = driver.execute_script(CONTRAST)
    return float(ratio), str(where)
