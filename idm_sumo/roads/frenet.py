"""A line that positions are told along and beside: the Frenet frame of a road."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Floats = npt.NDArray[np.float64]

SPACING = 5.0  # m between the points by which the nearest piece of a line is found
STEPS = 8  # of Newton's method at most, which halves the digits that are missing each time
SMALLEST_STEP = 1e-9  # m
BEYOND = 1e4  # m by which both ends go on straight


class Along(NamedTuple):
    """Positions in a line's frame, arrays of one shape.

    Attributes
    ----------
    s : ndarray of float64
        m along the line from its start; negative before it.
    offset : ndarray of float64
        m to the left of the line.
    """

    s: Floats
    offset: Floats


@dataclass(frozen=True, eq=False)
class Line:
    """Points joined by straight pieces, whose direction turns evenly from the middle of one piece to the next.

    Between its points the normal is interpolated, so that every position near the line has exactly one ``s`` and one
    offset, and :meth:`at` gives the position back.

    Attributes
    ----------
    points : ndarray of float64, shape (points, 2)
        m; two at least, all different from their neighbours.
    """

    points: Floats

    @cached_property
    def s(self) -> Floats:
        """Distance (m) of each point along the line."""
        return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))])

    @property
    def length(self) -> float:
        """Length of the whole line (m)."""
        return float(self.s[-1])

    @cached_property
    def _normals(self) -> Floats:
        """Left normals at the points, shape ``(points, 2)``."""
        pieces = np.diff(self.points, axis=0)
        pieces = pieces / np.hypot(*pieces.T)[:, None]
        tangents = np.concatenate([pieces[:1], pieces[1:] + pieces[:-1], pieces[-1:]])
        tangents = tangents / np.hypot(*tangents.T)[:, None]
        return np.column_stack([-tangents[:, 1], tangents[:, 0]])

    def at(self, s: npt.ArrayLike, offset: npt.ArrayLike = 0.0) -> Floats:
        """Return positions (m), shape ``(..., 2)``, of places along and beside the line."""
        s, offset = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(offset, dtype=np.float64))
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        share = (s - self.s[k]) / (self.s[k + 1] - self.s[k])
        base = self.points[k] + share[..., None] * (self.points[k + 1] - self.points[k])
        return np.asarray(base + offset[..., None] * self._normal(k, share))

    def _normal(self, k: npt.NDArray[np.int64], share: Floats) -> Floats:
        inside = np.clip(share, 0.0, 1.0)[..., None]
        normal = (1.0 - inside) * self._normals[k] + inside * self._normals[k + 1]
        return np.asarray(normal / np.hypot(normal[..., 0], normal[..., 1])[..., None])

    def heading(self, s: npt.ArrayLike) -> Floats:
        """Return the direction (rad, counterclockwise from the first axis) at places along the line."""
        s = np.asarray(s, dtype=np.float64)
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        normal = self._normal(k, (s - self.s[k]) / (self.s[k + 1] - self.s[k]))
        return np.arctan2(-normal[..., 0], normal[..., 1])

    @cached_property
    def _tree(self) -> tuple[cKDTree, Floats]:
        from scipy.spatial import cKDTree  # here: slow to load, and roads of their own are seldom

        s = np.unique(np.concatenate([self.s, np.arange(0.0, self.length, SPACING)]))
        return cKDTree(self.at(s)), s

    def project(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Along:
        """Return positions in the line's frame; inverts :meth:`at`.

        Parameters
        ----------
        x, y : array_like, shape (rows,)
            m.
        """
        position = np.column_stack([np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)])
        tree, at = self._tree
        s = at[tree.query(position)[1]]
        for _ in range(STEPS):
            k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
            normal = self._normal(k, (s - self.s[k]) / (self.s[k + 1] - self.s[k]))
            away = position - self.at(s)
            step = away[:, 0] * normal[:, 1] - away[:, 1] * normal[:, 0]
            s = s + step
            if np.abs(step).max(initial=0.0) < SMALLEST_STEP:
                break
        away = position - self.at(s)
        k = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        normal = self._normal(k, (s - self.s[k]) / (self.s[k + 1] - self.s[k]))
        return Along(np.clip(s, -BEYOND, self.length + BEYOND), (away * normal).sum(axis=1))


def line_through(points: npt.ArrayLike, *, apart: float = 0.0) -> Line:
    """Return the line through points, without those nearer to the last one than ``apart`` (m)."""
    given = np.asarray(points, dtype=np.float64)
    kept = [given[0]]
    for point in given[1:]:
        if np.hypot(*(point - kept[-1])) > max(apart, 1e-9):
            kept.append(point)
    return Line(np.array(kept))
