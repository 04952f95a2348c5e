"""The report: one self-contained page that opens from disk."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, FileSystemLoader, select_autoescape
from markupsafe import Markup

from idm_sumo.recordings.recording import Recording
from idm_sumo.runtime.text import number

from .style import METHOD_NAMES
from .titles import TITLES

ROOT = Path(__file__).parents[1]  # of `analysis`, beside us in a clone and in a wheel
CONTENTS = "<!-- contents -->"
HEADING = re.compile(r"<h2>(.*?)</h2>")


def render(path: Path, template: str, **content: Any) -> None:
    """Fill a template of `analysis` and write the page.

    Parameters
    ----------
    path : Path
        The page.
    template : str
        Below `analysis`.
    **content
        What the template names.
    """
    path.write_text(filled(template, **content), encoding="utf-8")


def filled(template: str, **content: Any) -> str:
    """Fill a template of `analysis`.

    Parameters
    ----------
    template : str
        Below `analysis`.
    **content
        What the template names.
    """
    environment = Environment(
        loader=FileSystemLoader(ROOT),
        autoescape=select_autoescape(["j2"]),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["table"] = html_table
    environment.filters["picture"] = picture
    environment.filters["script"] = script
    return with_contents(environment.get_template(template).render(**content))


def with_contents(page: str) -> str:
    """Put a list of a page's sections where it asks for one.

    Parameters
    ----------
    page : str
        HTML; ``<!-- contents -->`` marks the place. Each ``<h2>`` becomes a target.

    Returns
    -------
    str
        The page, with a list of links if it has more than one section.
    """
    headings = HEADING.findall(page)
    for number_, heading in enumerate(headings, 1):
        page = page.replace(f"<h2>{heading}</h2>", f'<h2 id="section-{number_}">{heading}</h2>', 1)
    items = "".join(f'<li><a href="#section-{k}">{heading}</a></li>' for k, heading in enumerate(headings, 1))
    return page.replace(CONTENTS, f'<nav aria-label="contents"><ol>{items}</ol></nav>' if len(headings) > 1 else "")


def script(name: str) -> Markup:
    """Return a script of `analysis` as part of the page itself.

    Parameters
    ----------
    name : str
        Path below `analysis`.
    """
    return Markup((ROOT / name).read_text(encoding="utf-8"))


def not_measured(recordings: Mapping[str, Recording]) -> str:
    """Return a page's warning, empty if all was measured.

    Parameters
    ----------
    recordings : mapping of str to Recording
        What the page shows, by name.
    """
    return warning_of([name for name, recording in recordings.items() if not recording.is_measured])


def warning_of(simulated: Sequence[str]) -> str:
    """Return a page's warning of simulated recordings, or nothing.

    Parameters
    ----------
    simulated : sequence of str
        Their names.
    """
    if not simulated:
        return ""
    are = "is a surrogate recording" if len(simulated) == 1 else "are surrogate recordings"
    return (
        f"Not measured: {' and '.join(simulated)} {are}, traffic simulated with SUMO and written in NGSIM's layout. "
        "It is not real traffic."
    )


def html_table(table: pd.DataFrame) -> Markup:
    """Return a table as HTML.

    Means and standard errors stand in one cell, as in the paper.

    Parameters
    ----------
    table : pandas.DataFrame
    """
    shown = pd.DataFrame(index=table.index)
    for name in table.columns:
        if name.endswith("_se_m"):
            continue
        se = name.replace("_m", "_se_m")
        shown[TITLES.get(name, name)] = (
            [_with_error(mean, error) for mean, error in zip(table[name], table[se], strict=True)]
            if se in table.columns and se != name
            else [_cell(name, value) for value in table[name]]
        )
    text = shown.to_html(index=False, border=0, classes="numbers", escape=True)
    return Markup(f'<div class="scroll">{text}</div>')


def _with_error(mean: float, error: float) -> str:
    """Return a mean with its standard error, a dash where nothing is known."""
    return "–" if pd.isna(mean) else f"{mean:.2f}" + ("" if pd.isna(error) else f"\u00a0±\u00a0{error:.2f}")


def _cell(name: str, value: Any) -> str:
    """Return one cell: text, metres with centimetres, or a number."""
    if isinstance(value, str):
        return METHOD_NAMES.get(value, value)
    if name.endswith("de_m") and not pd.isna(value):
        return f"{value:.2f}"
    return number(value)


def picture(path: Path, alt: str = "") -> Markup:
    """Return a picture as part of the page itself.

    Parameters
    ----------
    path : Path
        PNG or GIF.
    alt : str
        What is seen on it; without it the file's name.
    """
    kind = "gif" if path.suffix == ".gif" else "png"
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    seen = alt or path.stem.replace("_", " ")
    return Markup('<img alt="{}" src="data:image/{};base64,{}">').format(seen, kind, data)
