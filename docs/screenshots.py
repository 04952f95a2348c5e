"""Take pictures of results' pages: ``python -m docs.screenshots DIR... -o DIR``.

Every page is shown on a desktop's screen in both colour schemes and on a phone's. It needs Chromium, chromedriver
and the extra ``dev``.
"""

from __future__ import annotations

import argparse
import time
from io import BytesIO
from pathlib import Path

from PIL import Image

from idm_sumo.cli.report_command import page_of
from tests.helpers.browser import open_browser, prefer, resize, visit

SCREENS = {"desktop": (1280, 900, "light"), "dark": (1280, 900, "dark"), "phone": (390, 844, "light")}
COLOURS = 128
SETTLE = 1.0  # s, until the drawings are there


def take(folders: list[Path], target: Path) -> list[Path]:
    """Write ``RESULT-SCREEN.png`` for every result and screen.

    Parameters
    ----------
    folders : list of Path
        Results with a page.
    target : Path
        Folder for the pictures.

    Returns
    -------
    list of Path
    """
    target.mkdir(parents=True, exist_ok=True)
    written = []
    with open_browser() as driver:
        for folder in folders:
            for screen, (width, height, scheme) in SCREENS.items():
                resize(driver, width, height)
                prefer(driver, scheme)
                visit(driver, page_of(folder).resolve())
                time.sleep(SETTLE)
                written.append(target / f"{folder.name}-{screen}.png")
                _save(driver.get_screenshot_as_png(), written[-1])
    return written


def _save(png: bytes, path: Path) -> None:
    """Write a picture in few colours, a third of the size."""
    Image.open(BytesIO(png)).convert("RGB").quantize(COLOURS).save(path, optimize=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("folders", nargs="+", type=Path, metavar="DIR", help="results with a page")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR", help="where the pictures go")
    options = parser.parse_args()
    print(*take(options.folders, options.output), sep="\n")
