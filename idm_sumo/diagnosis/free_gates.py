"""What belongs to no cause: which of everything free stands out, and whether the catalogue holds it."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import free_fields as ff
from idm_sumo.diagnosis import gates
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.gates import FREE_CLEAR
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import SWELL, SWING, UNSTEADY, LeftOver, rank

# Standard errors, for more than stands out: a response that changes, of which there are most looks, what is suspect, and what another
# car-following model looks like, too; and what follows hard braking, of which a driver's own noise tells. (Of 80 recordings with nothing
# hidden, of eight laws, the surest were 4.1 of what a driver sees, 5.2 of what follows hard braking.)
AFTER_BRAKING = "since_braking"
FREE_SURER, FREE_AFTER_BRAKING = 6.5, 9.0
# Of a response that is later at one place, in all lanes. (Of 38 recordings with nothing hidden, of eight laws, the surest was 3.4; drivers late
# beside an accident, three in five of them by 0.9 s and more, had 5.1 to 7.8 in four of six and 3.9 and 4.0 in two.)
LATE_SOMEWHERE, FREE_LATE = "delay over position", 4.5
# Rectangles of place and time are thousands. (With nothing hidden the surest large enough had 5.9.)
FREE_REGION = 6.0
# For less: who is around a driver, a swing of its own, and where or when drivers are less steady. (Of 118 recordings with nothing hidden,
# of nine laws, the surest were 2.8 and 3.0; of 64 others, the last was 3.1.) A swell, where each has another period, has fewer looks.
FREE_AROUND, FREE_SWING, FREE_SWELL, FREE_UNSTEADY = 4.2, 4.0, 3.4, 4.2
FREE_IMPOSSIBLE = 0.5  # of the z of what cannot be, for what is free along what a driver sees
FREE_ELSEWHERE = 1.2  # of the same, for a response that changes along the road: another law answers dense traffic otherwise than light
# Of the same, for how drivers start after standing: another law has a way of its own, which said up to 6.5 beside 8.0 of what cannot be.
STARTING, FREE_STARTING = "since_standing", 1.0
# What changes with the time since the entry a location at the beginning comes near to, and the reverse: of them that is believed which
# says more than the other, and than what is free along the road. Where both begin at the beginning, the entry may say less: it is not
# known of those who were there when the recording began. (Places at the beginning left the entry 0.15 to 0.34 of their squared z; what
# changes with the time since the entry had 0.64 to 2.4 of that of the road's beginning.)
ENTRY, ENTRY_SHARE = "since_entry", 0.55
# Times the best cause's squared z, and more, from which on the catalogue does not hold it. A response that changes from place to
# place, or with time, is what goes beyond the same change everywhere, and has to be only half as sure as that.
# No cause makes drivers less steady at its place or time: that has to be as sure.
FREE_EXCESS, FREE_CHANGE, FREE_ALIKE, FREE_MORE = 1.5, 0.5, 1.0, 25.0
# Of what a driver did of late the excess is enough, without the rest. (Where drivers are weary of unrest it said 1.7 and 1.8 times what a place
# did, as traffic is unsteady at some; in 66 recordings with an effect of the catalogue at most 0.8, or 1.1 beside the wrong law.)
OF_LATE = ("unrest", AFTER_BRAKING)
# Of its squared z, that must be left with the best cause of the catalogue in the model. Less of a place and time: what a place does at
# all times a location takes away, and what a location leaves there is not its form.
LEFT, REGION_LEFT = 0.4, 0.3
# Standard errors, and share of its squared z, of a rectangle beyond what its place does always and its time everywhere: no place and no
# time is it then, nor both.
BEYOND_MARGINS, BEYOND_SHARE = 5.0, 0.2
# Who leaves the pedal alone while little is wanted seems not to notice small approach rates, nor does another law answer much as it
# answers little. So that is asked only where a dead band says most, of whose squared z and more it must then say this share: of drivers
# with a dead band it said 0.07 to 0.58 in fourteen recordings of five laws, of drivers with an idle pedal, an IDM underneath, 0.83 to 5.
UNNOTICED, PEDAL_SHARE, PEDAL_CLEAR = "perception_threshold", 0.7, 5.0
# Who is drawn along beside a faster lane looks a little like one who is slowed beside a slower one, and the reverse: of both that is
# believed which says more. (Drivers drawn along left a friction 0.55 of its squared z, drivers with one left a faster lane 0.07 to 0.12.)
DRAWN, SLOWED = "faster_difference", "adjacent_lane_friction"
# Standard errors from which on a place is not so at all times, or a time not at all places: as of any rectangle. (Places that were so, and
# times: 1.6 to 3.3 with all causes in the model; glare, which is at a place for a while: 12.)
FREE_WITHIN = FREE_REGION
# What neither an effect of the catalogue nor another law makes up.
UNLIKE_ANY = (STARTING, ENTRY, *OF_LATE, *ff.AROUND)
# Times the squared z of the effect that it shows, from which on something free is more than that. Long cars that are no trucks: trucks left
# the leader's length 0.7 to 1.0 of who is ahead, cars behind vans 2.7 and 7.5. And who drives beside: who makes room for others does so behind
# them, and less than elsewhere right beside them; that had 1.2 and 1.9 of the room made before a cut-in. (Who shuns driving abreast, or lets
# nobody in, does the reverse there.)
AT_MOST = {"leader_length": 2.0, "nearest_beside": 2.5}
# What is free and yet only shows what a likely effect of the catalogue does, by its sign times that of the covariate.
SHOWS = {
    ("since_change", 1.0): "lane_change_relaxation", ("headway over since_change", -1.0): "lane_change_relaxation",
    ("leader_acceleration", -1.0): "hysteresis", ("headway over leader_acceleration", 1.0): "hysteresis",
    ("leader_length", -1.0): "leader_class", ("headway over leader_length", 1.0): "leader_class",
    ("nearest_beside", 1.0): "courtesy_yielding", ("headway over nearest_beside", -1.0): "courtesy_yielding",
    **{(f"{what}until_{event}", sign): name for what in ("", "headway over ") for sign in (-1.0, 1.0)
       for event, name in (("cut_in", "courtesy_yielding"), ("own_change", "pre_insertion"))},
}  # fmt: skip
# Who brakes with the one ahead whatever the gap, and accelerates with it, does the reverse of hysteresis, which no cause of the catalogue is
# a form of: that must say more than the best cause, but not half more.
WITH_THE_LEADER = {(covariate, -sign) for (covariate, sign), name in SHOWS.items() if name == "hysteresis"}


def standing_out(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is free and may be told, the most significant first.

    Where something looks strong that cannot be (drivers who act before their leader does), the car-following is another law than the
    model's. What that law makes of what a driver sees is then no effect, unless it is half as sure as that (or as sure, of how drivers
    start after standing), nor is what it makes of places (where traffic is denser or faster), unless it is surer. A response that
    changes must be surer than the surest of which that cannot be, there and then: some vehicles did something that all fields around
    it share. A follower who comes near, as one does to who starts slowly, is no sign of another law.
    """
    impossible = hy.most_impossible(evidence, ev.ENDOGENOUS)
    free = _with_the_way(evidence)
    changes = [one for one in free if one.covariate.startswith(ff.CHANGES) and one.covariate != ff.PEDAL]
    incredible = [one for one in changes if not one.is_credible]

    def least(one: LeftOver) -> float:
        if one.covariate == ff.PEDAL:
            return _least_of_pedal(evidence)
        usual = _usual(one)
        if one.covariate.startswith(ff.CHANGES):
            beside = max((abs(other.z) for other in incredible if one.meets(other)), default=0.0)
            return max(usual, beside, FREE_ELSEWHERE * impossible if "position" in one.covariate else 0.0)
        share = FREE_STARTING if one.subject == STARTING else FREE_IMPOSSIBLE
        return max(usual, share * impossible) if one.is_seen else usual

    return tuple(one for one in free if one.is_credible and abs(one.z) > least(one))


def _with_the_way(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is free, what changes with the time since the entry as sure as what grows along the whole road, if something does.

    Who came in where the road begins has been there the longer the farther he is: in light traffic nothing else tells of it.
    """
    if not evidence.free:
        return ()
    grown, entry = hy.along_the_road(evidence), [one for one in evidence.free if one.subject == ENTRY]
    if grown is None or any(abs(one.z) >= abs(grown.z) for one in entry):
        return evidence.free
    edges, road = ff.EDGES[ENTRY], (grown.regressor.low, grown.regressor.high)
    covariate = f"{ff.HEADWAY} over {ENTRY}" if grown.regressor.fixed else ENTRY
    way = LeftOver(covariate, (edges[0], edges[-1]), road, None, grown.value, grown.z, grown.p, True)
    return tuple(sorted([way, *(one for one in evidence.free if one not in entry)], key=rank))


def _usual(one: LeftOver) -> float:
    """Return the standard errors from which on something free stands out where drivers follow the model's law."""
    if one.covariate.startswith(ff.CHANGES):
        return FREE_LATE if one.covariate == LATE_SOMEWHERE and one.z > 0.0 else FREE_SURER
    if one.covariate.startswith(SWING):
        return FREE_SWELL if one.covariate.startswith(SWELL) else FREE_SWING
    if is_unsteady(one):
        return FREE_UNSTEADY
    if one.subject in ff.AROUND:
        return FREE_AROUND
    if one.subject == AFTER_BRAKING:
        return FREE_AFTER_BRAKING
    if one.subject == ff.REGION:
        return FREE_REGION
    surer = one.kind in ff.SUSPECT or one.subject in ff.DOUBTFUL or one.covariate.startswith(ff.MOVING)
    return FREE_SURER if surer else FREE_CLEAR


def _best(evidence: ev.Evidence) -> Candidate | None:
    """Return the most significant effect of the catalogue, if any is significant."""
    return next(filter(gates.is_significant, gates.believed(evidence)), None)


def _least_of_pedal(evidence: ev.Evidence) -> float:
    """Return the standard errors from which on a pedal that is left alone stands out."""
    best = _best(evidence)
    if best is None or best.name != UNNOTICED:
        return np.inf
    return max(PEDAL_CLEAR, float(np.sqrt(PEDAL_SHARE)) * abs(best.z))


def outside(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what is free and says more than any significant effect of the catalogue."""
    every = gates.believed(evidence)
    significant = [c for c in every if gates.is_significant(c)]
    best = max((c.z**2 for c in significant), default=0.0)
    seen = _seen(every)

    def needed(one: LeftOver) -> float:
        if one.covariate == ff.PEDAL:
            return 0.0
        if one.subject == ENTRY:
            return _least_of_entry(one, evidence, significant)
        if one.subject == DRAWN and significant and significant[0].name == SLOWED:
            return best
        if one.subject in OF_LATE:
            return max(FREE_MORE, FREE_EXCESS * best)
        return FREE_MORE + best * _excess(one)

    def is_new(one: LeftOver) -> bool:
        return not _only_shows(one, seen) and (best == 0.0 or one.covariate not in ff.HELD)

    return tuple(one for one in standing_out(evidence) if is_new(one) and one.z**2 > needed(one))


def _seen(every: Iterable[Candidate]) -> list[Candidate]:
    """Return the effects of the catalogue of which something free may be what they look like."""
    return [c for c in every if gates.is_likely(c) or gates.is_too_small(c)]


def _excess(one: LeftOver) -> float:
    """Return the share of the best cause's squared z that something free must exceed."""
    if is_unsteady(one) or _form_of(one) in WITH_THE_LEADER:
        return FREE_ALIKE
    return FREE_CHANGE if one.covariate.startswith(ff.CHANGES) else FREE_EXCESS


def _least_of_entry(entry: LeftOver, evidence: ev.Evidence, significant: list[Candidate]) -> float:
    """Return the squared z from which on what changes with the time since the entry is more than a place, or another cause."""
    at_once = entry.range is not None and entry.range[0] <= ff.EDGES[ENTRY][0]
    share = ENTRY_SHARE if at_once else 1.0
    places = [
        one.z**2 * (share if one.range is not None and gates.is_at_the_beginning(one.range[0], evidence) else 1.0)
        for one in evidence.free if one.covariate == ff.HELD[0]
    ]  # fmt: skip
    causes = [share * c.z**2 if gates.begins_with_the_road(c, evidence) else c.z**2 + FREE_MORE for c in significant]
    return max([FREE_MORE, *places, *causes])


def untold(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return what stands out where no cause is named, but for what shows an effect of the catalogue that is too small for a name."""
    small = [c for c in gates.believed(evidence) if gates.is_too_small(c)]
    return tuple(one for one in standing_out(evidence) if not _only_shows(one, small))


def _only_shows(one: LeftOver, seen: Iterable[Candidate]) -> bool:
    """Return whether something free shows no more than one of the catalogue's effects does."""
    name = SHOWS.get(_form_of(one))
    at_most = AT_MOST.get(one.subject, np.inf)
    return any(c.name == name and one.z**2 <= at_most * c.z**2 for c in seen)


def _form_of(one: LeftOver) -> tuple[str, float]:
    """Return the covariate of what is free, and its sign times that of the covariate where it is."""
    return one.covariate, float(np.sign(one.value) * (1.0 if one.range is None else np.sign(sum(one.range))))


def is_unsteady(one: LeftOver) -> bool:
    """Return whether it is where or when drivers are less steady."""
    return one.covariate.startswith(UNSTEADY)


def only_there_and_then(evidence: ev.Evidence) -> tuple[LeftOver, ...]:
    """Return for each place of the model that is not so at all times when it is, and for each time where."""
    within = ff.WITHIN.values()
    return tuple(one for one in evidence.free if one.subject in within and one.is_credible and abs(one.z) > FREE_WITHIN)


def is_stood_in_for(strange: LeftOver, evidence: ev.Evidence) -> bool:
    """Return whether the best cause at its size would only stand in for what is free.

    A dead band does so for a pedal that is left alone, a location for what changes with the time since the entry. A drift does not: on
    each driver's way the two are one, but with a drift who comes later comes with more.
    """
    if strange.subject == ENTRY:
        best = _best(evidence)
        return best is None or not hy.is_drift(best.regressor)
    return strange.covariate == ff.PEDAL


def is_neither(strange: LeftOver) -> bool:
    """Return whether what is free is there and then only: no place that is so at all times, and no time that is so everywhere."""
    return abs(strange.beyond) > BEYOND_MARGINS and strange.beyond**2 > BEYOND_SHARE * strange.z**2


def is_left(strange: LeftOver, evidence: ev.Evidence) -> bool:
    """Return whether, with the best cause in the model, what the catalogue does not hold is still about as strange."""
    enough = REGION_LEFT if strange.covariate.startswith(ff.REGION) else LEFT
    return any(one.z**2 > enough * strange.z**2 for one in outside(evidence))


def is_still_strange(told: tuple[LeftOver, ...], evidence: ev.Evidence) -> bool:
    """Return whether something of what was told, that neither a cause nor another law makes up, stands out beyond another law, too.

    However that one has drivers start after standing, say: those who start slowly do not start by it, whatever else is named there.
    """
    strange, seen = {one.subject for one in told if one.subject in UNLIKE_ANY}, _seen(gates.believed(evidence))
    return any(one.subject in strange and not _only_shows(one, seen) for one in standing_out(evidence))
