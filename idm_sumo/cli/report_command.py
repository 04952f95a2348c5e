"""``report``: the page of a result, shown."""

from __future__ import annotations

import argparse
import os
import sys
import webbrowser
from pathlib import Path
from typing import Any

from idm_sumo.cli import options as shared
from idm_sumo.cli.console import say
from idm_sumo.runtime.errors import InputError

PAGES = ("report.html", "replay.html", "_report.html")
DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
REPORT = """\
open the page of a result in the browser

reads   DIR, the folder that `reproduce`, `replay`, `diagnose`, `interactive`
        or `compare` has left
leaves  nothing; a machine without a browser is told the page's path
next    read the answer at the top; a click on a header sorts its table"""


def add(commands: Any) -> None:
    """Add the command.

    Parameters
    ----------
    commands : action of ``add_subparsers``
    """
    parser = shared.command(commands, "report", report, REPORT, "idm-sumo report out/study")
    parser.add_argument("folder", type=shared.path, metavar="DIR", help="folder of a result")


def report(options: argparse.Namespace) -> None:
    """Open a result's page, or say where it is.

    Parameters
    ----------
    options : argparse.Namespace
    """
    page = page_of(options.folder)
    say(f"opening {page}" if _opened(page) else f"no browser here; open {page}")


def page_of(folder: Path) -> Path:
    """Return the page of a result.

    Parameters
    ----------
    folder : Path
        Of a result; a page itself is taken as it is.

    Returns
    -------
    Path

    Raises
    ------
    InputError
        If there is none.
    """
    if folder.name in PAGES and folder.is_file():
        return folder
    for name in PAGES:
        if (folder / name).is_file():
            return folder / name
    below = sorted(path.parent for name in PAGES for path in folder.glob(f"*/{name}"))
    also = f"; there is one in {below[0]}" if below else "; `idm-sumo reproduce -o DIR` writes one"
    raise InputError(f"{folder}: no {', '.join(PAGES[:-1])} or {PAGES[-1]} there{also}")


def _opened(page: Path) -> bool:
    """Whether a browser with a screen took the page; one in the terminal would take the terminal."""
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in DISPLAYS):
        return False
    return webbrowser.open(page.absolute().as_uri())
