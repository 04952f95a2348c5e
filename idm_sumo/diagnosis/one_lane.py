"""What goes on in one lane only: a place there that was found freely, and effects that the other lanes' drivers have not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.evidence import ENDOGENOUS, Evidence
from idm_sumo.diagnosis.free_fields import IN_LANE
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.diagnosis.scans import corrected_p
from idm_sumo.models.effects import BY_NAME

# Of one lane alone: a place there is found freely; what a lane's drivers want is its own effect; of the follower there is no replicate.
NOT_BY_LANE = (*hy.SCANNED, "desired_speed", *ENDOGENOUS)
# Standard errors by which a lane must differ from the others (of 24 recordings of six laws with nothing hidden the surest were 4.7
# and 3.5), and of those of the effect in all lanes.
SURE_IN_LANE, SURER_EVERYWHERE = 5.5, 0.7
DELAY = "reaction_delay"
# What is free where one lane's drivers may be later than the others: its sign, and the standard errors from which on a delay there is it.
# A weaker response is one only of drivers who seem late as well.
LATE = {"delay over lane": (1.0, 0.0), "response over lane": (-1.0, 3.5)}
LEAST_IN_LANE, LEAST_KNOWN = 20, 0.05  # drivers in a lane, and outside; of the information


def place_in_one_lane(left: LeftOver) -> Candidate | None:
    """Return the location that acts in one lane only, if that is what a free acceleration is."""
    if left.kind != "position" + IN_LANE or left.position_m is None:
        return None
    regressor = Regressor("location", lane=left.lane, low=left.position_m[0], high=left.position_m[1])
    return Candidate(
        regressor.name, left.value, abs(left.value / left.z), left.z, left.p, regressor, left.score, left.bias
    )


def confined(evidence: Evidence) -> list[Candidate]:
    """Return the effects that the drivers of one lane have and the others have not, each in its surest form and lane.

    Each is as sure as both that it is there and that it is less, or contrary, elsewhere. Where the same effect in all lanes is far
    surer it is not asked which lane has more of it. But if one lane's drivers stand out freely as later than the others, or as late ones
    who answer less, a delay there is as sure as that.
    """
    rows = {name: hy.informative(evidence, name) for name in BY_NAME if name in hy.LEAST and name not in NOT_BY_LANE}
    lanes = np.unique(evidence.lane[evidence.lane > 0])
    surest: dict[str, Candidate] = {}
    for one in (one for lane in lanes for one in _alone(evidence, rows, int(lane), len(lanes))):
        if one.name not in surest or abs(one.z) > abs(surest[one.name].z):
            surest[one.name] = one

    def needed(name: str) -> float:
        everywhere = max(abs(one.z) for one in hy.each_form(evidence, name, rows[name]))
        return max(SURE_IN_LANE, SURER_EVERYWHERE * everywhere)

    surer = {name: one for name, one in surest.items() if abs(one.z) > needed(name)}
    return list((surer | _late(evidence, rows[DELAY])).values())


def _late(evidence: Evidence, rows: list[int]) -> dict[str, Candidate]:
    """Return the delay of the lane that stands out freely as later than the others, or as one that answers less, if one does."""
    for free in evidence.free if rows else ():
        sign, least = LATE.get(free.covariate, (0.0, 0.0))
        if not free.is_credible or sign * free.z <= SURE_IN_LANE:
            continue
        lane = int(free.range[0])
        inside = evidence.lane == lane
        if inside.sum() < LEAST_IN_LANE:
            continue
        surest = max(hy.each_form(evidence.of(inside), DELAY, rows), key=lambda one: one.z)
        if surest.z > least:
            return {DELAY: replace(surest, z=abs(free.z), p=free.p, regressor=replace(surest.regressor, lane=lane))}
    return {}


def _alone(evidence: Evidence, rows: dict[str, list[int]], lane: int, lanes: int) -> Iterator[Candidate]:
    """Yield every form of all effects in one of the lanes, as sure as it is there and differs from that in the others."""
    inside = evidence.lane == lane
    if min(inside.sum(), (~inside).sum()) < LEAST_IN_LANE:
        return
    here, there = evidence.of(inside), evidence.of(~inside)
    for name, every in rows.items():
        known = [n for n in every if LEAST_KNOWN < here.gram[n, n] / evidence.gram[n, n] < 1.0 - LEAST_KNOWN]
        for one, other in zip(hy.each_form(here, name, known), hy.each_form(there, name, known), strict=True):
            contrast = (one.value - other.value) / float(np.hypot(one.error, other.error))
            if contrast * one.z > 0.0:
                z = float(np.copysign(min(abs(one.z), abs(contrast)), one.z))
                p = corrected_p(z, hy.LOOKS * lanes)
                yield replace(one, z=z, p=p, regressor=replace(one.regressor, lane=lane))
