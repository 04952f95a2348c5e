"""Where a place or a time begins and ends: moved to where the recording wants it, within a bin of the scan that found it.

An edge that is four seconds off makes an effect look a third smaller: it acts on whom it does not concern.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import numbered
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import SCANNED
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.pulses import pulses_of
from idm_sumo.models.effects import BY_NAME, slots

Floats = npt.NDArray[np.float64]

ENDLESS = (slots.PERIOD_DRIFT,)  # from the recording's first moment to its last
SLICES = 8  # of a bin
REACH = 12  # slices by which an edge may move at once, to either side


def sharpened(subject: Subject, fit: Fit, names: list[str]) -> Fit:
    """Return the fit with the edges of places and times moved, the drivers not yet refitted.

    An effect that begins a little earlier is one that acts in some thin slices more, one that begins later acts in some less: what
    that gains in likelihood follows from the slices' scores and their Gram matrix.
    """
    moving = [name for name in names if name in SCANNED and BY_NAME[name].acting(fit.by_lane[0])[0].slot not in ENDLESS]
    if not moving:
        return fit
    answer = rg.answer_of(subject.windows, fit, subject.grid.pivot)
    pulses = pulses_of(subject.windows, fit, answer)
    by_lane = fit.by_lane.copy()
    for name in moving:
        acting = BY_NAME[name].acting(by_lane[0])
        magnitude, begins, ends = (parameter.slot for parameter in acting)
        is_share = acting[0].is_share
        where, width = _along(subject, answer.state, name)
        value = answer.state[:, :, ro.BY_T] if is_share else np.ones(where.shape)
        acts = rg.acts(by_lane, magnitude)[subject.windows.seen[:, w.LANE, w.LEAD : -1].astype(np.int64)]
        begin, end = by_lane[0, begins], by_lane[0, ends]
        size = np.log1p(by_lane[0, magnitude]) if is_share else by_lane[0, magnitude]
        slices = _slices(begin, end, width / SLICES)
        u, gram = pulses.along(np.where(acts, numbered(where, slices), -1), value, len(slices) - 1)
        first, last = best_edges(size * u.sum(axis=0)[:-1], size**2 * gram[:-1, :-1], slices, begin, end)
        by_lane[:, begins], by_lane[:, ends] = first, last
    return replace(fit, by_lane=by_lane)


def _along(subject: Subject, state: Floats, name: str) -> tuple[Floats, float]:
    """Return the coordinate of each frame, and the width of the scan's bins."""
    if name == "location":
        return state[:, :, ro.BASE_X], _width(subject.grid.place)
    return subject.windows.seen[:, w.TIME, w.LEAD : -1], _width(subject.grid.time)


def _width(edges: Floats) -> float:
    return float(edges[1] - edges[0])


def _slices(begin: float, end: float, width: float) -> Floats:
    """Return edges of thin slices around both edges, what lies between them one bin; they end where the halves meet."""
    steps = np.arange(-REACH, REACH + 1) * width
    middle = 0.5 * (begin + end)
    return np.concatenate([(begin + steps)[begin + steps < middle], (end + steps)[end + steps >= middle]])


def best_edges(score: Floats, gram: Floats, slices: Floats, begin: float, end: float) -> tuple[float, float]:
    """Return the edges with the largest likelihood, of several the nearest.

    Parameters
    ----------
    score : float64, shape (slices,)
        Of the whole effect in each slice, at a fit in which it acts between ``begin`` and ``end``.
    gram : float64, shape (slices, slices)
    slices : float64, shape (slices + 1,)
        Edges; ``begin`` and ``end`` are among them.
    """
    acts = (slices[:-1] >= begin) & (slices[:-1] < end)
    first, last = np.triu_indices(len(slices), 1)
    nearest = np.argsort(np.abs(slices[first] - begin) + np.abs(slices[last] - end), kind="stable")
    first, last = first[nearest], last[nearest]
    number = np.arange(len(score))
    would = (number >= first[:, None]) & (number < last[:, None])
    change = would.astype(np.float64) - acts
    keeps = would[:, acts].any(axis=1)
    gain = np.where(
        keeps, change @ score - 0.5 * np.einsum("na,ab,nb->n", change, gram, change, optimize=True), -np.inf
    )
    best = int(np.argmax(gain))
    return float(slices[first[best]]), float(slices[last[best]])
