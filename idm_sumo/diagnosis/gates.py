"""What a cause must show before it is believed."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import replace

import numpy as np

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.free_fields import HELD
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver
from idm_sumo.diagnosis.one_lane import confined
from idm_sumo.diagnosis.sizes import DELAY, Tried

SIGNIFICANT = 1e-3  # corrected p of a cause
# Standard errors. What smoothing hides of a leader is in part its answer to the second one, and the replicates' leaders do not follow; what
# drivers of another law do after a cut-in looks a little like relaxation, how they come near to their desired speed like another one
# in the fast lane. (Of 132 recordings with nothing hidden, of four laws, the surest were 4.2, 4.5 and 5.9.) Without a clear gain none is
# believed, however sure.
SURER = {"multi_leader_anticipation": 5.0, "lane_change_relaxation": 5.0, "desired_speed": 7.0}
SUREST = hy.SUREST  # standard errors, from which on they are believed as others are
# Where the climb ends at the bound, what the data want is another approach to the desired speed than the model's, not another speed
# (nor a headway that falls with it); nor does anybody follow at a fifth of the headway at a place or for a time.
ENDLESS = ("desired_speed", "location", "time_of_day")
# The score near zero underrates these, the more the farther the car-following is from the model's: at their size the likelihood
# says more (twice its logarithm's gain). Who keeps to a lane has fitted a speed of his own to it.
UNDERRATED = ("reaction_delay", "perception_threshold", "lane_change_relaxation", "desired_speed")
LIKELY, LEAST_SUPPORT = 3.5, 150.0
TO_COME = hy.BEFORE_A_CHANGE  # a change of lane that nobody has made yet
# Nor does any motion make up who is ahead, where and when: of what is not quite significant (p) a clear gain may decide.
NO_MOTION, DOUBTFUL = ("leader_class", "location", "time_of_day", *TO_COME), 0.02
FEWEST_DRIVERS = 5.0  # effective number of drivers on which what is there must rest
CLEAR = 5.0  # standard errors that a further cause needs
FREE_CLEAR = 5.5  # standard errors from which on something free stands out
STILL = 0.5  # of a squared z, that is left with the best cause in the model: that cause does not hold it
CORE_INSIDE, CORE_SHARE = 0.8, 0.5  # of what is left, inside the interval in the model; of that interval
# What a delay looks like, too: what drivers do while their leader accelerates, and (of the wrong sign) acting before it does.
LIKE_A_DELAY, OPPOSITE_OF_DELAY = "hysteresis", "multi_leader_anticipation"
LANE, WANTED = "lane", "desired_speed"  # what is free in a lane whose drivers want another speed
FREELY = dict(zip(hy.SCANNED, HELD, strict=True))  # what is free where a place or a time of the catalogue acts


def believed(evidence: ev.Evidence) -> list[Candidate]:
    """Return every effect in its best form, and what is in one lane only, the most significant first.

    A place or a time that stands out freely, whatever is different there, is that of the catalogue: its form is then as sure as that.
    """
    free = {one.covariate: one for one in evidence.free if one.is_credible and abs(one.z) > FREE_CLEAR}
    every = hy.candidates(evidence)
    for number, candidate in enumerate(every):
        seen = free.get(FREELY.get(candidate.name, ""))
        if seen is not None and abs(candidate.z) > LIKELY:
            every[number] = replace(candidate, p=min(candidate.p, seen.p))
    every = _with_free_lane(evidence, [*every, *confined(evidence)], free.get(LANE))
    every = sorted(every, key=lambda c: -abs(c.z))
    wrong = {c.name for c in hy.impossible(every)}
    return [replace(c, p=1.0) if c.is_falling and c.name in wrong else c for c in every]


def _with_free_lane(evidence: ev.Evidence, every: list[Candidate], lane: LeftOver | None) -> list[Candidate]:
    """Return the candidates, the desired speed that of a lane in which drivers are freely slower or faster, if it may be that.

    Who stays in a lane has fitted a speed of his own to it: near zero the lanes beside it say more of it than that lane itself.
    """
    if lane is None or lane.range is None or abs(lane.z) <= SURER[WANTED]:
        return every
    for one in hy.each_form(evidence, WANTED, hy.informative(evidence, WANTED)):
        if one.regressor.lane == lane.range[0] and one.value * lane.value > 0.0 and abs(one.z) > LIKELY:
            return [c for c in every if c.name != WANTED] + [replace(one, z=lane.z, p=lane.p)]
    return every


def is_likely(candidate: Candidate) -> bool:
    """Return whether a candidate is significant, or would be at its size."""
    return is_significant(candidate) or is_underrated(candidate)


def is_significant(candidate: Candidate) -> bool:
    """Return whether a candidate is significant, and may turn out large enough."""
    return candidate.near_enough and candidate.p < SIGNIFICANT and abs(candidate.z) > SURER.get(candidate.name, 0.0)


def is_doubtful(candidate: Candidate) -> bool:
    """Return whether a candidate is not quite significant, and a clear gain may decide."""
    doubtful = SIGNIFICANT <= candidate.p < DOUBTFUL
    return doubtful and candidate.name in NO_MOTION and candidate.near_enough


def is_worth_trying(candidate: Candidate, *, is_first: bool) -> bool:
    """Return whether a candidate is brought to its size; a further cause must be sure enough, or one that motion does not make up."""
    is_sure = is_likely(candidate) and (is_first or _is_clear_beside(candidate))
    return is_sure or needs_gain(candidate, is_first=is_first)


def is_too_small(candidate: Candidate) -> bool:
    """Return whether a candidate is there beyond doubt of chance, but smaller than what is named."""
    return candidate.p < SIGNIFICANT and candidate.is_possible and not candidate.near_enough


def is_underrated(candidate: Candidate) -> bool:
    """Return whether a candidate must be brought to its size before it can be judged."""
    return candidate.name in UNDERRATED and candidate.is_possible and abs(candidate.z) > LIKELY


def is_there(tried: Tried) -> bool:
    """Return whether a candidate at its size is significant and large enough, and has one."""
    candidate = tried.candidate
    sure = is_significant(candidate) or is_doubtful(candidate) or tried.support > LEAST_SUPPORT
    may_be_endless = candidate.name in ENDLESS or candidate.is_falling
    endless = may_be_endless and hy.is_at_bound(candidate)
    return sure and candidate.large_enough and not endless


def _is_clear_beside(candidate: Candidate) -> bool:
    """Return whether a candidate is sure enough for a further cause."""
    return abs(candidate.z) > CLEAR


def needs_gain(candidate: Candidate, *, is_first: bool) -> bool:
    """Return whether a candidate, one that motion does not make up, is not sure enough for a cause unless it gains."""
    unsure = is_significant(candidate) and not _is_clear_beside(candidate) and candidate.name in NO_MOTION
    return is_doubtful(candidate) or (unsure and not is_first)


def surest_beside(candidate: Candidate, there: Iterable[Candidate]) -> float:
    """Return the standard errors of the surest of all else that is there, a candidate's own shadow left out.

    Who is late seems to follow the second leader less than not at all.
    """
    shadow = OPPOSITE_OF_DELAY if candidate.name == DELAY else None
    others = (c for c in there if c.name != candidate.name)
    return max((abs(c.z) for c in others if c.name != shadow or c.is_possible), default=0.0)


def with_what_it_may_hide(close: list[Candidate], every: Iterable[Candidate]) -> list[Candidate]:
    """Return candidates, and with a hysteresis the delay that it may be: near zero a long one is hardly to be seen."""
    if all(c.name != LIKE_A_DELAY for c in close):
        return close
    return close + [c for c in every if c.name == DELAY and c not in close]


def is_rest_of_delay(candidate: Candidate, evidence: ev.Evidence) -> bool:
    """Return whether a further cause may be what a delay in the model leaves that is shorter, or of another form, than the data want."""
    longer = hy.local(evidence, DELAY)
    if candidate.name != LIKE_A_DELAY or longer is None:
        return False
    return any(late.z > CLEAR for late in (longer, *hy.candidates(evidence)) if late.name.endswith(DELAY))


def is_another(first: Candidate, evidence: ev.Evidence) -> bool:
    """Return whether, with a place or a time in the model, another one is still about as sure: one interval does not hold it."""
    if first.name not in FREELY:
        return False
    left = next((c for c in hy.candidates(evidence) if c.name == first.name), None)
    if left is None or left.p >= SIGNIFICANT or left.z**2 <= STILL * first.z**2:
        return False
    return not _is_its_core(left, first)


def _is_its_core(left: Candidate, first: Candidate) -> bool:
    """Return whether what is left is more of the same in the better part of an interval: its form is no step."""
    begin, end = max(left.regressor.low, first.regressor.low), min(left.regressor.high, first.regressor.high)
    both = max(end - begin, 0.0)
    inside = both > CORE_INSIDE * (left.regressor.high - left.regressor.low)
    return (
        inside and both > CORE_SHARE * (first.regressor.high - first.regressor.low) and left.value * first.value > 0.0
    )


def is_past_unseen(candidate: Candidate, evidence: ev.Evidence, accepted: Container[str]) -> bool:
    """Return whether a further location is what relaxation leaves that began before vehicles came into sight.

    Who changed lanes before accepts a short gap still, and nobody has seen why: behind the entry all seem to push, or farther on
    all seem to hold back.
    """
    if candidate.name != "location" or "lane_change_relaxation" not in accepted:
        return False
    pushes = candidate.value > 0.0 if not hy.acting_of(candidate)[0].is_share else candidate.value < 0.0
    if pushes:
        return begins_with_the_road(candidate, evidence)
    end = max(one.high for one in evidence.regressors if one.name == candidate.name)
    return candidate.regressor.high >= end - hy.NARROWEST[candidate.name]


def begins_with_the_road(candidate: Candidate, evidence: ev.Evidence) -> bool:
    """Return whether a candidate is a location that begins where the recorded road does."""
    return candidate.name == "location" and is_at_the_beginning(candidate.regressor.low, evidence)


def is_at_the_beginning(place: float, evidence: ev.Evidence) -> bool:
    """Return whether a place (m) is where the recorded road begins."""
    begin = min((one.low for one in evidence.regressors if one.name == "location"), default=-np.inf)
    return bool(place <= begin + hy.NARROWEST["location"])
