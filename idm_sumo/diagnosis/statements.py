"""A search's outcome in the words of the contract."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import gain_gates, gates
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.artefact import Seam
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.law import law_of, reaction_of
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.probability import probability
from idm_sumo.diagnosis.result import (
    Z95,
    CauseFound,
    Estimate,
    Gain,
    OtherLaw,
    Power,
    Region,
    RuledOut,
    Scan,
    Unexplained,
)
from idm_sumo.diagnosis.rollout import ROWS
from idm_sumo.diagnosis.search import Found
from idm_sumo.diagnosis.windows import HORIZON, SECOND, UNTIL_CUT_IN, Windows, several_periods
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME, Cause, ExtendedModel, Parameter, format_quantity, slots
from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording

NAMES = tuple(BY_NAME)
SHARE = "share"  # of the drivers, who have a cause: given with its parameters where not all do
SHARE_SEEN = 0.8  # probability of the power statement
Z80 = 0.84
# Of a size, standard deviation: how far sizes were from the truth in blind trials beyond their statistical error. An effect has
# one of several forms, and drivers who have absorbed a part of it keep it back.
FORM_DOUBT = 0.2
# The same where, with the causes in the model, something that cannot be is still as sure as so many standard errors: the car-following
# is another law than the model's then, in which the same size does something else.
DOUBTED_LAW, LAW_DOUBT = 3.0, 0.3
SEAM_WIDTH = 4.0  # m
SEAM_DOUBT = 0.08  # of its shift: smoothing blurs it


def of_some(fit: Fit, name: str) -> bool:
    """Return whether an effect that acts in a fit is one that only some drivers have."""
    others = fit.by_lane[ROWS:, BY_NAME[name].acting(fit.by_lane[0])[0].slot]
    return bool(len(others) and not others.any())


def model_of(fit: Fit, accepted: tuple[Accepted, ...], source: str, share: Estimate | None = None) -> ExtendedModel:
    """Return the median driver's model with the accepted causes; ``share`` of the drivers have what only some have."""
    a, b, headway, gap, limit = (float(v) for v in np.exp(fit.mean))
    names = [c.candidate.name for c in accepted]
    causes = tuple(
        Cause(
            name,
            _values(fit, name),
            c.candidate.only_lanes,
            share.value if share is not None and of_some(fit, name) else 1.0,
        )
        for name, c in zip(names, accepted, strict=True)
    )
    law = laws.NAMES[law_of(fit)]
    return ExtendedModel(IDMParameters(a, b, headway, gap, 0.0), limit, causes, source, law, reaction_of(fit))


def _values(fit: Fit, name: str) -> dict[str, float]:
    return {p.symbol: float(fit.by_lane[0, p.slot]) for p in BY_NAME[name].acting(fit.by_lane[0])}


def causes(
    found: Found, shares: Mapping[str, float], gains: Mapping[str, Gain] | None = None
) -> tuple[CauseFound, ...]:
    """Return the named causes, the one with the largest evidence first, each with its own gain."""
    doubt, gains = form_doubt(found.last), {} if gains is None else gains
    named = [_cause(found, a, shares[a.candidate.name], doubt, gains.get(a.candidate.name)) for a in found.accepted]
    return tuple(named)


def form_doubt(last: ev.Evidence) -> float:
    """Return the standard deviation of a size, as a share of it, that its form and the car-following's leave open."""
    return LAW_DOUBT if hy.most_impossible(last, ev.ENDOGENOUS) > DOUBTED_LAW else FORM_DOUBT


def other_law(last: ev.Evidence) -> OtherLaw | None:
    """Return what drivers seem to do, with the causes in the model, that no driver can, if it is significant."""
    surest = hy.surest_impossible(last, ev.ENDOGENOUS)
    if surest is None or surest.p > gates.SIGNIFICANT:
        return None
    first = hy.acting_of(surest)[0]
    return OtherLaw(surest.name, first.symbol, first.unit, surest.value, float(abs(surest.z)))


def seam_cause(seam: Seam) -> CauseFound:
    """Return a seam of the measurement as a cause; it is repaired before behaviour is looked at, so it has no share of the gain."""
    half = Z95 * seam.error + SEAM_DOUBT * abs(seam.shift)
    return CauseFound(
        "measurement_artefact", {"shift": Estimate(seam.shift, "m", (seam.shift - half, seam.shift + half))},
        Region(position_m=(seam.position - SEAM_WIDTH, seam.position + SEAM_WIDTH)), seam.p_value, 0.0,
        f"recorded positions of all vehicles jump by {seam.shift:.2f} m at {seam.position:.0f} m, which no driver does; "
        "positions beyond were moved back before anything else was tested",
    )  # fmt: skip


def within_bounds(first: Parameter, value: float, half: float) -> Estimate:
    """Return a magnitude with its interval, which ends where the magnitude may not go."""
    low, high = max(value - half, first.lower), min(value + half, first.upper)
    return Estimate(value, first.unit, (min(low, value), max(high, value)))


def _cause(found: Found, accepted: Accepted, share: float, doubt: float, gain: Gain | None) -> CauseFound:
    fit, candidate = found.fit, accepted.candidate
    first, *others = BY_NAME[candidate.name].acting(fit.by_lane[0])
    half = Z95 * float(np.hypot(accepted.error, doubt * accepted.value))
    parameters = {first.symbol: within_bounds(first, accepted.value, half)}
    at_bound = not first.lower < accepted.value < first.upper
    for parameter in others:
        value = float(fit.by_lane[0, parameter.slot])
        slack = _slack(parameter.symbol, value, _bin(found.first, candidate.name))
        within = max(value - slack, parameter.lower), min(value + slack, parameter.upper)
        parameters[parameter.symbol] = Estimate(value, parameter.unit, within)
    region = _region(candidate, _edges(fit, candidate))
    sentence = _sentence(accepted)
    if at_bound:
        sentence += "; its size is at the bound of what is searched, and may be larger"
    if found.share is not None and of_some(fit, candidate.name):
        parameters[SHARE] = found.share
        sentence += f"; {found.share.value:.0%} of the drivers have it, the others are likelier without"
    named = {one.candidate.name for one in found.accepted}
    beside = [one for one in hy.candidates(found.first) if one.name not in named]
    return CauseFound(
        candidate.name, parameters, region, candidate.p, share, sentence, accepted.rivals, gain,
        hy.effective_drivers(found.first, candidate), at_bound, probability(accepted, beside),
    )  # fmt: skip


EDGES = ("x_1", "x_2", "t_1", "t_2")
EITHER_OR = ("chi", "eta", "phi", "xi", "zeta")  # companions that say which of two forms it is


def _bin(evidence: ev.Evidence, name: str) -> float:
    """Return the width of the bins in which an effect was looked for (m, s), zero for none."""
    return next(
        (
            regressor.high - regressor.low
            for regressor in evidence.regressors
            if regressor.name == name and np.isfinite(regressor.low)
        ),
        0.0,
    )


def _slack(symbol: str, value: float, width: float) -> float:
    """Return half of the width within which a companion parameter was not told apart: half a bin of a scan, or the grid."""
    if symbol in EDGES:
        return 0.5 * width
    return {"tau_r": 0.5 * value}.get(symbol, 0.5 if symbol in EITHER_OR else 0.0)


def _edges(fit: Fit, candidate: Candidate) -> tuple[float, float]:
    """Return where a cause of the model begins and ends."""
    if candidate.name not in hy.SCANNED:
        return candidate.regressor.low, candidate.regressor.high
    _, begin, end = BY_NAME[candidate.name].acting(fit.by_lane[0])
    return float(fit.by_lane[0, begin.slot]), float(fit.by_lane[0, end.slot])


def _region(candidate: Candidate, edges: tuple[float, float]) -> Region | None:
    if candidate.name == "location":
        return Region(position_m=edges, lanes=candidate.only_lanes or None)
    if candidate.name == "time_of_day":
        return Region(time_s=edges)
    return Region(lanes=(candidate.regressor.lane,)) if candidate.regressor.lane else None


def _sentence(accepted: Accepted) -> str:
    """Return the evidence in one sentence."""
    c = accepted.candidate
    first = hy.acting_of(c)[0]
    late = (
        "; it rests on what happens later, so a replay can have it and a forecast cannot"
        if BY_NAME[c.name].hindsight
        else ""
    )
    rivals = f"; these data cannot tell it from {', '.join(accepted.rivals)}" if accepted.rivals else ""
    return (
        f"drivers behave as if each {BY_NAME[c.name].summary}{_lanes_in_words(c)}: {first.symbol} = {format_quantity(accepted.value, first.unit)}, "
        f"{abs(c.z):.1f} standard errors beyond what null replicates of the same drivers, noise and smoothing show{late}{rivals}"
    )


def _lanes_in_words(candidate: Candidate) -> str:
    """Return in which lane a cause is, or that it comes in from lane to lane; nothing of one that is in all alike."""
    if candidate.regressor.lane:
        return f" in lane {candidate.regressor.lane}"
    lanes = dict(candidate.regressor.fixed).get(slots.DESIRED_SPEED_ACROSS, 0.0)
    return f", from nothing in lane 1 to all of it in lane {lanes:.0f}" if lanes else ""


def present(found: Found) -> list[Candidate]:
    """Return what is there beyond doubt although no rollout is better for it.

    Not what beyond another law than the IDM that law's form may leave over, nor what has no null replicate: in 40 recordings of four laws
    with nothing hidden there were ten of these, and none of the others.
    """
    is_idm = law_of(found.base) == laws.IDM
    return [
        c for c in found.without_gain
        if c.name not in ev.ENDOGENOUS and (is_idm or gain_gates.is_unlike_laws(c))
        and hy.effective_drivers(found.first, c) >= gates.FEWEST_DRIVERS
    ]  # fmt: skip


def without_gain(found: Found) -> tuple[CauseFound, ...]:
    """Return what is there but makes no rollout better."""
    out = []
    for c in present(found):
        first = hy.acting_of(c)[0]
        estimate = within_bounds(first, c.value, Z95 * c.error)
        sentence = f"present ({abs(c.z):.1f} standard errors) without making rollouts better"
        region, drivers = _region(c, (c.regressor.low, c.regressor.high)), hy.effective_drivers(found.first, c)
        at_bound = hy.is_at_bound(c)
        out.append(
            CauseFound(
                c.name,
                {first.symbol: estimate},
                region,
                c.p,
                0.0,
                sentence,
                effective_drivers=drivers,
                at_bound=at_bound,
            )
        )
    return tuple(out)


def unexplained(found: Found) -> tuple[Unexplained, ...]:
    """Return what the catalogue does not explain: covariate, range, place and time."""
    return tuple(Unexplained(one.covariate, one.range, one.position_m, one.time_s, one.p) for one in found.unexplained)


def ruled_out(found: Found) -> tuple[RuledOut, ...]:
    """Return every tested effect that is not named, with the p-value at the final model, and why not."""
    named = {a.candidate.name for a in found.accepted} | {c.name for c in present(found)}
    every, out = hy.candidates(found.last), []
    for c in every:
        if c.name in named:
            continue
        effect = BY_NAME[c.name]
        estimate = within_bounds(hy.acting_of(c)[0], c.value, Z95 * c.error)
        out.append(RuledOut(c.name, c.p, effect.confusable_with, estimate, why_not(c, found, every)))
    return tuple(out)


def why_not(candidate: Candidate, found: Found, every: list[Candidate]) -> str:
    """Return in words why one of every effect, neither named nor present without gain, is not claimed."""
    asked = gates.SURER.get(candidate.name, 0.0)
    if candidate in found.without_gain and hy.effective_drivers(found.first, candidate) < gates.FEWEST_DRIVERS:
        return f"rests on fewer than {gates.FEWEST_DRIVERS:g} drivers"
    if candidate.p >= gates.SIGNIFICANT:
        return "chance makes as much"
    if not candidate.is_possible:
        return "of a sign that it cannot have"
    if candidate in hy.impossible(every):
        return "other car-following laws have as much"
    if not candidate.near_enough:
        return f"smaller than what is named ({format_quantity(candidate.least, hy.acting_of(candidate)[0].unit)})"
    if candidate.name in {c.name for c in found.without_gain}:
        return "did not make rollouts better, and something else looks like it"
    if abs(candidate.z) <= asked:
        return (
            f"less than the {asked:g} standard errors asked of what smoothing or another car-following law looks like"
        )
    if found.accepted and abs(candidate.z) <= gates.CLEAR:
        return f"less than the {gates.CLEAR:g} standard errors asked of a further cause"
    if found.accepted:
        return (
            f"may be what {found.accepted[0].candidate.name} leaves over, which is not of quite the form in the model"
        )
    if found.unexplained:
        return "what is unexplained says more"
    return "looks like what did not make rollouts better"


def power(found: Found) -> tuple[Power, ...]:
    """Return for every tested effect the size that would have been seen with a probability of 80 %."""
    out = []
    for c in hy.candidates(found.first):
        first = hy.acting_of(c)[0]
        size = max((4.2 + Z80) * c.error, c.least)  # 4.2 standard errors pass the corrected threshold
        out.append(Power(c.name, first.symbol, first.unit, float(size), SHARE_SEEN))
    return tuple(out)


def untestable(recording: Recording, windows: Windows, found: Found) -> dict[str, str]:
    """Return the effects that these data cannot show, and why."""
    tested = {c.name for c in hy.candidates(found.first)}
    why = {
        "vehicle_class": "own class is part of the drivers' distribution, which is fitted driver by driver",
        "memory": "windows are seconds long: a slow trend cannot be told from time_of_day and speed_dependent_headway",
        "correlated_noise": "modelled in the residuals' covariance and the null replicates; it makes no bias",
    }
    blind = not recording.has_leader_rows
    if blind or recording.is_smooth:
        why["measurement_artefact"] = (
            "positions are smooth already, or leaders have no rows: a seam leaves no jump to see"
        )
    for name in NAMES:
        if name in tested or name in why or name == "measurement_artefact":
            continue
        effect = BY_NAME[name]
        if name == hy.SCANNED[1] and several_periods(windows):
            why[name] = "several periods, each with its own clock: nothing is looked for along the time"
        elif blind:
            why[name] = (
                f"the recording does not show {', '.join(effect.required_stimuli)}: it holds followers and headways only"
            )
        elif name == "leader_class":
            why[name] = "no leader is known to be a truck"
        elif name == "desired_speed":
            why[name] = "one lane only: a common desired speed is fitted with the drivers"
        else:
            why[name] = (
                f"nothing in the recording to see it by ({', '.join(effect.required_stimuli) or 'gap and speed'})"
            )
    return why


def scans(evidence: ev.Evidence) -> tuple[Scan, ...]:
    """Return the free acceleration along the road and the free headway along the time."""
    out = []
    for name, covariate, unit in (("location", "position_m", "m/s^2"), ("time_of_day", "time_s", "1")):
        rows = [n for n, regressor in enumerate(evidence.regressors) if regressor.name == name and not regressor.fixed]
        if not rows:
            continue
        gram = evidence.gram[np.ix_(rows, rows)]
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-12))
        ridge = gram / np.outer(scale, scale) + 0.02 * np.eye(len(rows))
        inverse = np.linalg.inv(ridge) / np.outer(scale, scale)
        error = np.sqrt(np.diag(inverse @ gram @ inverse) * evidence.inflation)
        edges = np.array([evidence.regressors[n].low for n in rows] + [evidence.regressors[rows[-1]].high])
        out.append(Scan(covariate, unit, edges, inverse @ evidence.total()[rows], error))
    return tuple(out)


def notes(recording: Recording, windows: Windows, measurement: Noise, found: Found) -> tuple[str, ...]:
    """Return what a reader should know about how it was done."""
    seconds = (windows.seen.shape[2] - 1) * FRAME_STEP
    out = [
        f"{windows.drivers} drivers, {len(windows.seen)} windows of {seconds:g} s, of which the last {min(HORIZON, windows.seen.shape[2]) * FRAME_STEP:g} s or less are simulated",
        f"measurement noise of positions {measurement.deviation:.2g} m (standard deviation, from their spectrum)",
        "memory is merged with time_of_day and speed_dependent_headway: windows of seconds cannot tell them apart",
    ]
    if (windows.seen[:, UNTIL_CUT_IN] < 1e5).any():
        out.append(
            "vehicles cut in where a gap happens to be large: a small courtesy_yielding may be selection and is not named"
        )
    if not recording.has_leader_rows or not np.isfinite(windows.seen[:, SECOND]).any():
        out.append("second leaders, adjacent lanes and followers are not in the recording")
    if found.accepted and found.accepted[0].rivals:
        out.append(f"{found.accepted[0].candidate.name} cannot be separated from {', '.join(found.accepted[0].rivals)}")
    return tuple(out) + recording.notes
