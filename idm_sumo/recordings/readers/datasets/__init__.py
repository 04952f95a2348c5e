"""Layouts of public data sets, one file each; a file that declares ``LAYOUT`` here is found by itself."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from idm_sumo.recordings.readers.layout import Layout, Opened


@cache
def every() -> tuple[Layout, ...]:
    """Return all layouts, in the order of their files' names."""
    modules = [import_module(f"{__name__}.{found.name}") for found in iter_modules(__path__)]
    return tuple(module.LAYOUT for module in modules if hasattr(module, "LAYOUT"))


def layout_of(opened: Opened) -> Layout | None:
    """Return the layout of a file, or None if it is in none of these."""
    return next((layout for layout in every() if layout.tells(opened)), None)
