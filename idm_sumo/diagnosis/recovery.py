"""How long a relaxation lasts: moved to where the recording wants it, between the times from which the search began.

Share and time stand in for each other: with a recovery that is too long the share comes out too small.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.look import Subject, look
from idm_sumo.models.effects import lane_change_relaxation

Floats = npt.NDArray[np.float64]

SHARE, TIME = lane_change_relaxation.EFFECT.parameters[:2]
TIMES = (0.7, 0.84, 1.19, 1.42)  # as long as now
# s: what is over sooner is what drivers of another law do after a cut-in. (4.4 and 5.1 s came of those, of relaxation 7.6 and more.)
SOONEST = 6.0


def recovered(subject: Subject, fit: Fit) -> Fit:
    """Return the fit with another time of recovery, and the share that goes with it, the drivers not yet refitted.

    What each time gains in likelihood follows from its score, that of the share, and their Gram matrix.
    """
    by_lane = fit.by_lane.copy()
    share, now = by_lane[0, SHARE.slot], by_lane[0, TIME.slot]
    if share == 0.0:
        return fit
    times = np.clip(now * np.array(TIMES), TIME.lower, TIME.upper)
    others = [rg.Regressor(f"{rg.OTHERWISE}{t:.3g} s", fixed=((SHARE.slot, 0.0), (TIME.slot, float(t)))) for t in times]

    def build(windows: w.Windows, fit: Fit, answer: rg.Answer, grid: rg.Grid) -> tuple[list[rg.Regressor], Floats]:
        return rg.build_local(windows, fit, answer, grid, others)

    looked = look(subject, fit, build)
    shared = [regressor.name for regressor in looked.regressors].index(rg.LOCAL + lane_change_relaxation.EFFECT.name)
    rows = [looked.regressors.index(regressor) for regressor in others]
    gain, more = best_times(looked.u.sum(axis=0), looked.gram, shared, rows)
    best = int(np.argmax(gain))
    if gain[best] > 0.0:
        acts = rg.acts(by_lane, SHARE.slot)
        by_lane[:, TIME.slot] = times[best]
        by_lane[acts, SHARE.slot] = np.clip(share + more[best], 0.5 * share, min(2.0 * share, SHARE.upper))
    return replace(fit, by_lane=by_lane)


def is_over_at_once(name: str, fit: Fit) -> bool:
    """Return whether an effect in a model is a relaxation, but over sooner than any driver's who accepts a short gap."""
    return name == lane_change_relaxation.EFFECT.name and float(fit.by_lane[0, TIME.slot]) < SOONEST


def best_times(score: Floats, gram: Floats, shared: int, rows: list[int]) -> tuple[Floats, Floats]:
    """Return what each other time gains over the best share at the time as it is, and by how much the share then changes.

    Parameters
    ----------
    score : float64, shape (regressors,)
    gram : float64, shape (regressors, regressors)
    shared : int
        Row of a little more of the share.
    rows : list of int
        Of the other times.
    """
    own, cross = gram[shared, shared], gram[rows, shared]
    more = (score[shared] - cross) / own
    alone = 0.5 * score[shared] ** 2 / own
    gain = score[rows] - 0.5 * gram[rows, rows] + 0.5 * own * more**2 - alone
    return np.asarray(gain), np.asarray(more)
