"""Scenes in pieces, for campaigns larger than memory.

A piece carries only the traffic that its windows need.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from idm_sumo.scenes.windows import Scenes

CHUNK = 4096  # windows: about 30 MB of 10 s windows


def chunks(scenes: Scenes, size: int = CHUNK) -> Iterator[tuple[slice, Scenes]]:
    """Yield the scenes in pieces, each with its own traffic.

    Parameters
    ----------
    scenes : Scenes
    size : int
        Windows of a piece. Scenes of no more windows are not copied.

    Yields
    ------
    piece : slice
        Of the windows.
    scenes : Scenes
        These windows and the traffic that they need.
    """
    if len(scenes) <= size:
        yield slice(0, len(scenes)), scenes
        return
    for first in range(0, len(scenes), size):
        piece = slice(first, min(first + size, len(scenes)))
        yield piece, with_needed_traffic(scenes.subset(np.arange(piece.start, piece.stop)))


def with_needed_traffic(scenes: Scenes) -> Scenes:
    """Return the scenes with only the traffic they need.

    Parameters
    ----------
    scenes : Scenes

    Returns
    -------
    Scenes
        The cells of the traffic are numbered anew; those of one window still follow each other.
    """
    t = scenes.traffic
    cells = len(t.offsets) - 1
    last = scenes.start + scenes.window.horizon
    marks = np.zeros(cells + 1, dtype=np.int64)
    np.add.at(marks, scenes.cell, 1)
    np.add.at(marks, np.minimum(scenes.cell + last + 1, cells), -1)
    needed = np.cumsum(marks)[:cells] > 0
    rows = np.repeat(needed, np.diff(t.offsets))
    offsets = np.concatenate([[0], np.cumsum(np.diff(t.offsets)[needed])]).astype(np.int64)
    number = np.cumsum(needed) - 1
    per_row = {name: getattr(t, name)[rows] for name in ("x", "y", "heading", "speed", "length", "width", "vehicle")}
    part = replace(t, offsets=offsets, first_frame=0, frames=int(needed.sum()), **per_row)
    return replace(scenes, traffic=part, cell=number[scenes.cell])
