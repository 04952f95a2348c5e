"""One look for all pictures."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

METHOD_NAMES = {
    "constant_velocity": "constant velocity",
    "irl_rl": "IRL + PPO",
    "behaviour_cloning": "behaviour cloning",
    "idm_average": "IDM, average of oracles",
    "idm_prediction": "IDM, predicted (KNN)",
    "idm_rollout": "IDM, predicted (fit through the rollout)",
    "idm_first_gap": "IDM, first gap kept",
    "idm_pooled": "IDM, pooled",
    "idm_typical": "IDM, typical driver of the population",
    "idm_hierarchical": "IDM, oracle drawn to the population",
    "idm_oracle": "IDM, oracle",
    "idm_residual": "IDM, pooled, and a predicted residual",
    "idm_own_past": "IDM, fitted to its own past",
    "base": "base model",
    "extended": "extended model",
}
# Okabe and Ito's palette, told apart by colour-blind readers too.
METHOD_COLOURS = {
    "constant_velocity": "#999999",
    "irl_rl": "#CC79A7",
    "behaviour_cloning": "#44AA99",
    "idm_average": "#E69F00",
    "idm_prediction": "#D55E00",
    "idm_rollout": "#AA4499",
    "idm_first_gap": "#56B4E9",
    "idm_pooled": "#0072B2",
    "idm_typical": "#882255",
    "idm_hierarchical": "#117733",
    "idm_oracle": "#009E73",
    "idm_residual": "#661100",
    "idm_own_past": "#DDAA33",
    "base": "#D55E00",
    "extended": "#332288",
}
RECORDED = "#000000"
OTHERS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#332288")  # of models without one of their own
LIGHTER = 0.45  # share of white in a colour that is drawn on a dark page
# Lengths of strokes and blanks, in line widths.
METHOD_STROKES: dict[str, list[float]] = {
    "constant_velocity": [1, 1],
    "irl_rl": [4, 1, 1, 1],
    "behaviour_cloning": [2, 1],
    "idm_average": [5, 2],
    "idm_rollout": [3, 1],
    "idm_first_gap": [1, 2],
    "idm_typical": [6, 1, 1, 1, 1, 1],
    "idm_hierarchical": [4, 2],
    "idm_residual": [1, 1],
    "idm_own_past": [2, 2],
    "base": [7, 2],
}
LABEL_HEIGHT = 0.045  # of a picture: least distance of two names beside their lines
DASHES: tuple[list[int], ...] = ([], [8, 4], [2, 3], [10, 3, 2, 3])  # px: lines are told apart without colour
TRAFFIC = "#BBBBBB"


def method_colour(method: str) -> str:
    """Return the colour of a method as ``#rrggbb``; one that is not ours gets one of these by its name."""
    return METHOD_COLOURS.get(method) or OTHERS[crc32(method.encode()) % len(OTHERS)]


def method_name(method: str) -> str:
    """Return how readers know a method."""
    return METHOD_NAMES.get(method, method.replace("_", " "))


def dark_colour(method: str) -> str:
    """Return the colour of a method on a dark page: the same hue, lighter."""
    colour = method_colour(method)
    parts = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(part + LIGHTER * (255 - part)):02x}" for part in parts)


def line_dash(number: int) -> list[int]:
    """Return lengths of strokes and blanks (px) of the line number ``number`` of a picture."""
    return list(DASHES[number % len(DASHES)])


def method_line(method: str) -> Any:
    """Return the stroke of a method's line for matplotlib: methods of like colours have unlike strokes.

    Parameters
    ----------
    method : str
        As the tables name it.
    """
    strokes = METHOD_STROKES.get(method, [])
    return (0, strokes) if strokes else "-"


def label_ends(ax: Axes, ends: Mapping[str, float], colours: Mapping[str, str]) -> None:
    """Write names to the right of lines: in their order, apart from each other, and as near as that allows.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        With its limits set.
    ends : mapping of str to float
        Height of each line at its right end (data), by name.
    colours : mapping of str to str
        By name.
    """
    from sklearn.isotonic import isotonic_regression  # here: sklearn takes long to load

    low, high = ax.get_ylim()
    names = sorted(ends, key=lambda name: ends[name])
    steps = LABEL_HEIGHT * np.arange(len(names))
    heights = (np.array([ends[name] for name in names]) - low) / (high - low)
    for name, place in zip(names, isotonic_regression(heights - steps) + steps, strict=True):
        ax.text(1.01, place, name, transform=ax.transAxes, fontsize=7.5, color=colours[name], va="center")


def new_figure(
    width: float = 7.0, height: float = 4.2, *, columns: int = 1, rows: int = 1
) -> tuple[Figure, list[Axes]]:
    """Return a figure and its axes.

    It belongs to no plotting session, so nothing has to be closed.

    Parameters
    ----------
    width, height : float
        Inches.
    columns, rows : int, keyword-only
        Of axes.
    """
    figure = Figure(figsize=(width, height), layout="constrained", dpi=130)
    axes = [figure.add_subplot(rows, columns, number + 1) for number in range(rows * columns)]
    for ax in axes:
        tidy(ax)
    return figure, axes


def tidy(ax: Axes) -> Axes:
    """Give axes the look of all pictures.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    """
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(alpha=0.25, linewidth=0.6)
    return ax


def save(figure: Figure, path: Path) -> None:
    """Write a picture without the date.

    Equal runs give equal files.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
    """
    figure.savefig(path, metadata={"Software": None})
