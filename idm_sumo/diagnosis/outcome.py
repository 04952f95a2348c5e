"""A decision in the words of the contract: nothing is decided here."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from idm_sumo.diagnosis import tables
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.artefact import Seam
from idm_sumo.diagnosis.decision import Claim, Decision
from idm_sumo.diagnosis.evidence import Subject
from idm_sumo.diagnosis.fit import Fit, for_rollouts
from idm_sumo.diagnosis.gain import all_gains, compare, driven
from idm_sumo.diagnosis.law import Followed, reaction_of
from idm_sumo.diagnosis.law import law_of as number_of
from idm_sumo.diagnosis.law_misfit import law_misfit
from idm_sumo.diagnosis.library import magnitude_of
from idm_sumo.diagnosis.model import Placed
from idm_sumo.diagnosis.noise import Noise
from idm_sumo.diagnosis.plan import periods_of
from idm_sumo.diagnosis.result import (
    NONE,
    Z95,
    CauseFound,
    Diagnosis,
    Estimate,
    Law,
    Region,
    RuledOut,
    Scan,
    Unexplained,
)
from idm_sumo.diagnosis.search import Found, Look
from idm_sumo.diagnosis.some_drivers import Some
from idm_sumo.diagnosis.swings import tried
from idm_sumo.models import laws
from idm_sumo.models.effects import BY_NAME, Cause, ExtendedModel, format_quantity
from idm_sumo.models.idm import IDMParameters
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.recordings.recording import Recording

SHARE = "share"  # of the drivers, who have a cause: given with its parameters where not all do
SEAM_WIDTH, SEAM_DOUBT = 4.0, 0.08  # m; of its shift: smoothing blurs it


def told(
    recording: Recording, subject: Subject, found: Found, decision: Decision, followed: Followed, measurement: Noise,
    rng: np.random.Generator,
) -> Diagnosis:  # fmt: skip
    """Return a decision as a diagnosis."""
    windows = subject.windows
    gains = all_gains(decision.base, decision.extended, windows.platoon, rng)
    named = {one.name for one in (*decision.named, *decision.without_gain)}
    known = {
        "vehicle": windows.vehicle, "period": windows.period,
        "base": decision.base.ade_m, "extended": decision.extended.ade_m,
    }  # fmt: skip
    causes = tuple(_cause(one, decision.fit, decision.some) for one in decision.named)
    apart = windows if decision.some is None else decision.some.windows
    return Diagnosis(
        verdict=decision.verdict,
        causes=causes,
        without_gain=tuple(_cause(one, found.last.fit) for one in decision.without_gain),
        unexplained=_all_unexplained(decision, found),
        gain=gains[0],
        other_gains=gains[1:],
        ruled_out=_ruled_out(found.last, named),
        untestable=_untestable(recording, windows, found),
        model=_model(decision.fit, decision.named, recording.source, decision.some),
        base_model=_model(found.base, (), recording.source),
        residuals=tables.residuals(windows, decision.base.residual, decision.extended.residual),
        drivers=tables.drivers(apart, for_rollouts(apart, decision.fit), known),
        scans=_scans(found.first),
        excluded=dict(windows.excluded),
        notes=_notes(recording, windows, measurement),
        by_law=followed.by_law,
        law_misfit=law_misfit(windows, decision.look.of_form, decision.look.library.plan.speed),
    )


def too_little(windows: w.Windows, fit: Fit, least: tuple[int, int], seconds: Mapping[str, float]) -> Diagnosis:
    """Return the verdict none for a recording that cannot say anything."""
    note = (
        f"too little to say anything: {windows.drivers} drivers with {len(windows.seen)} windows of car-following "
        f"(at least {least[0]} and {least[1]} are needed); an effect of any size may be there"
    )
    model = _model(fit, (), "")
    return Diagnosis(
        NONE, (), (), (), None, (), (), dict.fromkeys(BY_NAME, "too few drivers"), model, model,
        tables.residuals(windows, None, None), tables.drivers(windows, fit, {}), (), dict(windows.excluded), (note,), seconds,
    )  # fmt: skip


def law_of(windows: w.Windows, followed: Followed, by_idm: Fit, rng: np.random.Generator) -> Law | None:
    """Return the law that drivers follow if it is not the IDM, and what it does to them; no causes in either."""
    if followed.likelier is None:
        return None
    base, other = driven(windows, by_idm), driven(windows, followed.fit)
    gain = compare("ade_m", base.ade_m, other.ade_m, windows.platoon, rng, held_out=True)
    return Law(laws.NAMES[number_of(followed.fit)], followed.likelier, gain)


def seam_cause(seam: Seam) -> CauseFound:
    """Return a seam of the measurement as a cause; it is repaired before behaviour is looked at."""
    half = Z95 * seam.error + SEAM_DOUBT * abs(seam.shift)
    return CauseFound(
        "measurement_artefact", {"shift": Estimate(seam.shift, "m", (seam.shift - half, seam.shift + half))},
        Region(position_m=(seam.position - SEAM_WIDTH, seam.position + SEAM_WIDTH)), seam.p_value,
        f"recorded positions of all vehicles jump by {seam.shift:.2f} m at {seam.position:.0f} m, which no driver does; "
        "positions beyond were moved back before anything else was tested",
    )  # fmt: skip


def _model(fit: Fit, claims: tuple[Claim, ...], source: str, some: Some | None = None) -> ExtendedModel:
    """Return the median driver's model with the named causes."""
    a, b, headway, gap, limit = (float(v) for v in np.exp(fit.mean))
    share = 1.0 if some is None else some.share.value
    causes = tuple(
        Cause(one.name, _values(fit, one.placed), (one.placed.lane,) if one.placed.lane else (), share)
        for one in claims
        if one.placed is not None
    )
    law = laws.NAMES[number_of(fit)]
    return ExtendedModel(IDMParameters(a, b, headway, gap, 0.0), limit, causes, source, law, reaction_of(fit))


def _values(fit: Fit, placed: Placed) -> dict[str, float]:
    row = int(np.abs(fit.by_lane[:, placed.form.slot]).argmax())
    return {p.symbol: float(fit.by_lane[row, p.slot]) for p in BY_NAME[placed.name].acting(fit.by_lane[row])}


def _cause(claim: Claim, fit: Fit, some: Some | None = None) -> CauseFound:
    assert claim.placed is not None
    placed, first = claim.placed, claim.placed.magnitude
    half = Z95 * claim.error
    low, high = max(placed.value - half, first.lower), min(placed.value + half, first.upper)
    parameters = {first.symbol: Estimate(placed.value, first.unit, (low, high))}
    for parameter in BY_NAME[placed.name].all_parameters:
        value = _values(fit, placed).get(parameter.symbol)
        if value is not None and parameter.symbol not in parameters:
            slack = _slack(parameter.unit, value)
            within = max(value - slack, parameter.lower), min(value + slack, parameter.upper)
            parameters[parameter.symbol] = Estimate(value, parameter.unit, within)
    sentence = _sentence(claim)
    if some is not None:
        parameters[SHARE] = some.share
        sentence += f"; {some.share.value:.0%} of the drivers have it, the others are likelier without"
    return CauseFound(
        placed.name, parameters, _region(placed), claim.p, sentence, claim.one_of, claim.gain,
        claim.probability, claim.effective_drivers, placed.at_bound,
    )  # fmt: skip


def _slack(unit: str, value: float) -> float:
    """Return half of the width within which a companion parameter was not told apart."""
    return {"m": 8.0, "s": 0.5 * min(abs(value), 12.0), "1": 0.5}.get(unit, 0.0)


def _region(placed: Placed) -> Region | None:
    lanes = (placed.lane,) if placed.lane else None
    if "lane" in placed.edges:
        lanes = (int(placed.edges["lane"][0] + 0.5),)
    position, period = placed.edges.get("position"), placed.edges.get("time")
    return Region(position, period, lanes) if position or period or lanes else None


def _sentence(claim: Claim) -> str:
    assert claim.placed is not None
    effect, first = BY_NAME[claim.name], claim.placed.magnitude
    region = _region(claim.placed)
    where = "" if region is None or region.lanes is None else f" in lane {region.lanes[0]}"
    late = "; it rests on what happens later, so a replay can have it and a forecast cannot" if effect.hindsight else ""
    bound = "; its size is at the bound of what is searched, and may be larger" if claim.placed.at_bound else ""
    rivals = f"; these data cannot tell it from {', '.join(claim.one_of)}" if claim.one_of else ""
    return (
        f"drivers behave as if each {effect.summary}{where}: {first.symbol} = {format_quantity(claim.placed.value, first.unit)}, "
        f"with a probability of {claim.probability:.2f}, on about {claim.effective_drivers:.0f} drivers{bound}{late}{rivals}"
    )


def _all_unexplained(decision: Decision, found: Found) -> tuple[Unexplained, ...]:
    """Return where and when the model is wrong without a name for it, the surest first; nothing beside what is named."""
    if decision.named:
        return ()
    out = [_unexplained(one, found) for one in decision.unexplained]
    if decision.swing is not None:
        low, high, _, z = decision.swing
        name = f"oscillation of drivers' own, periods around {0.5 * (low + high):.1f} s"
        out.append(Unexplained(name, (low, high), None, None, _p(z, tried() * len(found.last.library.names))))
    return tuple(sorted(out, key=lambda one: one.p_value))


def _unexplained(claim: Claim, found: Found) -> Unexplained:
    edges = found.last.library.edges(claim.hypothesis)
    lane = found.last.library.group_of(claim.hypothesis).lane
    position, period = edges.get("position"), edges.get("time")
    others = [ends for name, ends in edges.items() if name not in ("position", "time")]
    whole = others[0] if others else position if position is not None else edges["time"]
    return Unexplained(claim.name + (f" in lane {lane}" if lane else ""), whole, position, period, claim.p)


def _ruled_out(look: Look, named: set[str]) -> tuple[RuledOut, ...]:
    """Return every tested effect that is not claimed, with its estimate in the first component that is about nothing else."""
    library, component = look.library, look.selection.components[-1]
    out = []
    for family, name in enumerate(library.names):
        if name not in BY_NAME or name in named:
            continue
        inside = np.where(library.family == family, component.log_bf + np.log(library.within), -np.inf)
        best = int(np.argmax(inside))
        first = magnitude_of(library.group_of(best))
        half, value = Z95 * float(component.deviation[best]), float(component.size[best])
        low, high = max(value - half, first.lower), min(value + half, first.upper)
        estimate = Estimate(value, first.unit, (min(low, value), max(high, value)))
        chance = look.selection.is_by_chance(family, float(component.by_family[family]))
        why = (
            "chance makes as much"
            if chance
            else "something else explains it as well, or its size is no more than an error of the model"
        )
        out.append(
            RuledOut(name, _p(component.z[best], len(library.names)), BY_NAME[name].confusable_with, estimate, why)
        )
    return tuple(sorted(out, key=lambda one: one.p_value))


def _p(z: float, looks: int) -> float:
    from scipy.stats import norm

    return float(min(1.0, 2.0 * looks * norm.sf(abs(z))))


def _untestable(recording: Recording, windows: w.Windows, found: Found) -> dict[str, str]:
    """Return the effects that these data cannot show, and why."""
    tested, why = set(found.first.library.names), {}
    for name, effect in BY_NAME.items():
        if effect.untestable:
            why[name] = effect.untestable
        elif name not in tested and effect.forms:
            needs = ", ".join(effect.required_stimuli) or "gap and speed"
            several = periods_of(windows) > 1 and all(form.along == "time" or not form.field for form in effect.forms)
            why[name] = (
                "several periods, each with its own clock"
                if several
                else f"nothing in the recording to see it by ({needs})"
            )
    return why


def _scans(look: Look) -> tuple[Scan, ...]:
    """Return the free acceleration along the road and the free headway along the time, smoothed by their priors."""
    evidence, out = look.evidence, []
    for group in evidence.plan.groups:
        if group.lane or not group.name or len(group.axes) != 1 or group.form is None or group.present:
            continue
        axis, unit = group.axes[0], magnitude_of(group).unit
        if (axis.name, unit) not in (("position", "m/s^2"), ("time", "1")):
            continue
        rows = np.arange(group.first, group.first + group.count)
        gram = evidence.gram[np.ix_(rows, rows)] / evidence.inflation
        inverse = np.linalg.inv(gram + np.eye(len(rows)) / magnitude_of(group).typical ** 2)
        estimate = inverse @ evidence.score[rows] / evidence.inflation
        covariate = {"position": "position_m", "time": "time_s"}[axis.name]
        out.append(Scan(covariate, unit, axis.edges, estimate, np.sqrt(np.diag(inverse))))
    return tuple(out)


def _notes(recording: Recording, windows: w.Windows, measurement: Noise) -> tuple[str, ...]:
    """Return what a reader should know about how it was done."""
    seconds = (windows.seen.shape[2] - 1 - w.LEAD) * FRAME_STEP
    out = [
        f"{windows.drivers} drivers, {len(windows.seen)} windows of {seconds:g} s",
        f"measurement noise of positions {measurement.deviation:.2g} m (standard deviation, from their spectrum)",
    ]
    if not recording.has_leader_rows or not np.isfinite(windows.seen[:, w.SECOND]).any():
        out.append("second leaders, adjacent lanes and followers are not in the recording")
    return tuple(out) + recording.notes
