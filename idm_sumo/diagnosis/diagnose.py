"""From a recording to its diagnosis."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numba import get_num_threads, set_num_threads
from threadpoolctl import threadpool_limits

from idm_sumo.diagnosis import chance, free_gates, gates, injection, law, some_drivers, statements, tables
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.artefact import find_seam, repaired
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.fit import Fit, first_guess, fit_drivers, for_rollouts
from idm_sumo.diagnosis.gain import Errors, all_gains, compare, driven, typical_gain
from idm_sumo.diagnosis.gain_gates import LAWLIKE, NO_SHAPE, is_confirmed
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.law import Followed
from idm_sumo.diagnosis.law_misfit import LawMisfit, law_misfit
from idm_sumo.diagnosis.look import Subject
from idm_sumo.diagnosis.result import NAMED, NONE, UNKNOWN, Detectable, Diagnosis, Gain, Law
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.search import Found, left_without_causes, search, with_its_noise
from idm_sumo.diagnosis.search_among_some import search_among_some
from idm_sumo.diagnosis.sizes import ROUNDS, with_cause, without_cause
from idm_sumo.diagnosis.smoother import Smoother, local_cubic, posterior_mean, window_for
from idm_sumo.diagnosis.windows import Windows, cut_windows
from idm_sumo.models import laws
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import WINDOW
from idm_sumo.runtime.progress import Progress, silent

HELD_OUT = 4  # every fourth block of neighbours takes no part in naming and fitting
LEAST_DRIVERS = 24  # that name and fit
LEAST_WINDOWS = 60
LEAST_HELD_OUT = 1e-3  # of the ADE of held-out drivers, that a further cause must spare beside the others


def diagnose(
    recording: Recording, *, seed: int = 0, jobs: int = 1, injections: int = 0, only: Iterable[int] | None = None,
    progress: Progress = silent,
) -> Diagnosis:  # fmt: skip
    """Show what the simulation gets wrong, name the cause, extend the model, measure the gain.

    Parameters
    ----------
    recording : Recording
        As read (not smoothed).
    seed : int
        Of the split into drivers, the replicates and the bootstrap.
    jobs : int
        Threads of the compiled rollouts.
    injections : int
        Of each effect and size, to see which would have been found.
    only : iterable of int or None
        Vehicles whose drivers are examined, among the traffic of all; None for every one.
    progress : callable

    Returns
    -------
    Diagnosis

    Notes
    -----
    Drivers of whole blocks of neighbours are held out before anything is looked at. Too little data gives the
    verdict none, with a note.
    """
    before = get_num_threads()
    set_num_threads(max(1, min(jobs, before)))
    try:
        with threadpool_limits(1, user_api="blas"):  # the threads are ours: many windows, small matrices
            return _diagnose(recording, np.random.default_rng(seed), injections, only, progress)
    finally:
        set_num_threads(before)


def _diagnose(
    recording: Recording, rng: np.random.Generator, injections: int, only: Iterable[int] | None, progress: Progress
) -> Diagnosis:
    clock = [("start", time.perf_counter())]
    progress("cutting windows", 0, 1)
    seam = find_seam(recording)
    recording = recording if seam is None else repaired(recording, seam)
    measurement = no.measurement_noise(recording)
    motion = no.motion_noise(recording, measurement)
    own = _follower_filter(measurement, rng)
    windows = cut_windows(recording, own, posterior_mean(measurement, motion) if recording.has_leader_rows else own)
    if only is not None:
        windows = windows.of_drivers(np.flatnonzero(np.isin(windows.vehicle, list(only))))
    train, held = _split(windows, rng)
    clock.append(("windows", time.perf_counter()))
    if train.drivers < LEAST_DRIVERS or len(train.seen) < LEAST_WINDOWS:
        return _too_little(windows, train, clock)
    progress("fitting drivers", 0, 1)
    start = chance.measured(measurement, own, 400, 160, rng)
    by_idm = fit_drivers(train, PLAIN.copy(), np.array([start[0].var() + 1e-4, start[1].var() + 1e-4]), rounds=ROUNDS)
    clock.append(("fit", time.perf_counter()))
    progress("comparing car-following laws", 0, 1)
    followed = law.followed(train, by_idm, rng.spawn(1)[0])  # what comes after has its own chance, whatever the law
    base = followed.fit
    clock.append(("law", time.perf_counter()))
    leader = motion if recording.has_leader_rows and not recording.is_smooth else None
    noises = chance.Noises(measurement, no.QUIET, leader)
    subject = with_its_noise(Subject(train, noises, rg.grid_of(windows), recording.is_smooth), base, rng)
    found = search(subject, base, rng, progress)
    followed, found = _by_the_law_with_causes(subject, followed, by_idm, found, rng, progress)
    found = search_among_some(subject, found, rng, progress)
    clock.append(("search", time.perf_counter()))
    progress("measuring the gain", 0, 1)
    told = _told(recording, windows, held, found, measurement, clock, rng)
    told = replace(
        told, law=_law(held, followed, by_idm, rng), by_law=followed.by_law,
        law_misfit=_misfit(subject, found.last if told.causes else found.first),
        detectable=_detectable(subject, found, injections, rng, progress),
    )  # fmt: skip
    return (
        told
        if seam is None
        else replace(told, verdict=NAMED, causes=(statements.seam_cause(seam), *told.causes), unexplained=())
    )


def _by_the_law_with_causes(
    subject: Subject, followed: Followed, by_idm: Fit, found: Found, rng: np.random.Generator, progress: Progress
) -> tuple[Followed, Found]:
    """Return the law that drivers surely follow with the causes in the model, and the causes beyond that one.

    The law came first, without any cause, and may have taken up a part of one, or all of it: where nothing is named beyond another law
    than the IDM, causes are looked for beyond the IDM; and where nothing is beyond the IDM, beyond another one that is likelier, but not
    surely; and where something is there, but without gain, beyond the law that is likeliest with that. (Not if what is strange beyond the
    first, and made up by no law, is strange beyond the other, too. They must be surely likelier than what is there, likelier if the first of
    them is what no law looks like, and was not there.) What is named beyond one law, and beyond another nothing that would
    make up for it, is no cause. Nor need the first one be if it is the form of any law: then causes are looked for beyond the likeliest
    other law.
    """
    windows, names = subject.windows, _names(found)
    asked = names or [one.name for one in found.without_gain]
    rival = _rival(windows, followed, found, rng)
    if rival in (None, law.law_of(found.fit)):
        return followed, found
    base = by_idm
    if rival != laws.IDM:
        base = fit_drivers(windows, followed.forms[rival], by_idm.start_variance, rounds=ROUNDS)
    again = search(with_its_noise(subject, base, rng), base, rng, progress, asked)
    if not names and free_gates.is_still_strange(found.unexplained, again.first):
        return followed, found
    gain = law.likelihood_gain(windows, found.fit, again.fit, rng)
    if names and not again.accepted and gain.difference > 0.0:
        return followed, _refused(found)  # what another law, likelier without any cause, does by itself
    taken_up = _is_of_no_law(again) and _names(again)[0] not in names
    if not (law.is_sure(gain) or (taken_up and gain.ci95[0] > 0.0)):
        return followed, found
    if not (names or taken_up) and law.rival(windows, again.fit, _names(again), followed.forms, rng) is not None:
        return followed, found  # causes that an IDM needs to come near to another law
    likelier = None
    if rival != laws.IDM:
        with_idm = fit_drivers(windows, law.beneath(again.fit.by_lane, PLAIN), by_idm.start_variance, rounds=ROUNDS)
        likelier = law.likelihood_gain(windows, with_idm, again.fit, rng)
        if not law.is_sure(likelier):
            return followed, found  # an IDM with the same causes is about as likely
    return followed._replace(fit=base, likelier=likelier, runner_up=None), again


def _rival(windows: Windows, followed: Followed, found: Found, rng: np.random.Generator) -> int | None:
    """Return the law beyond which causes are looked for once more, if any."""
    names = _names(found)
    if not names:
        likelier = _rival_with_what_gains_nothing(windows, followed, found, rng)
        if likelier is not None:
            return likelier
        return followed.runner_up if law.law_of(found.fit) == laws.IDM else laws.IDM
    likelier = law.rival(windows, found.fit, names, followed.forms, rng)
    return followed.runner_up if likelier is None and names[0] == LAWLIKE else likelier


def _rival_with_what_gains_nothing(
    windows: Windows, followed: Followed, found: Found, rng: np.random.Generator
) -> int | None:
    """Return the law that drivers more likely follow with what is surely there and without gain, if any: theirs may have taken it up.

    (Headways that grow with speed made a smooth optimal velocity of one that is not, which drove as well without them as the true one with.)
    """
    if not found.without_gain:
        return None
    surest = max(found.without_gain, key=lambda one: abs(one.z))
    return law.rival(windows, with_cause(found.fit, surest), [surest.name], followed.forms, rng)


def _is_of_no_law(found: Found) -> bool:
    """Return whether the first cause is who is ahead, or a lane change to come: no law of car-following looks like it."""
    return bool(found.accepted) and found.accepted[0].candidate.name in NO_SHAPE


def _names(found: Found) -> list[str]:
    return [cause.candidate.name for cause in found.accepted]


def _follower_filter(measurement: no.Noise, rng: np.random.Generator) -> Smoother:
    """Return the filter of followers: the noisier the measurement, the longer."""
    _, speed, _ = chance.measured(measurement, local_cubic(WINDOW), 400, 160, rng)
    return local_cubic(window_for(float(speed.std())))


def _confirmed(found: Found, held: Windows, rng: np.random.Generator) -> tuple[Found, Errors, Errors, tuple[Gain, ...]]:
    """Return what was found, and the errors without and with it of drivers that were never touched.

    Causes that they do not bear out are kept as causes without gain.
    """
    base = driven(held, found.base)
    if found.accepted and len(held.seen):
        extended = driven(held, found.fit)
        gains = all_gains(base, extended, held.platoon, rng)
        first = found.accepted[0]
        typical = typical_gain(base.ade_m, extended.ade_m, held.platoon, rng, held_out=True)
        if is_confirmed(gains[0], typical, first.gain, first.candidate):
            kept = _each_by_itself(found, held, extended, rng)
            if kept is found:
                return found, base, extended, gains
            if not kept.accepted:
                found = _refused(found)
                return found, base, base, all_gains(base, base, held.platoon, rng)
            extended = driven(held, kept.fit)
            return kept, base, extended, all_gains(base, extended, held.platoon, rng)
        found = _refused(found)
    return found, base, base, all_gains(base, base, held.platoon, rng)


def _each_by_itself(found: Found, held: Windows, extended: Errors, rng: np.random.Generator) -> Found:
    """Return what was found without causes that rest on few drivers, or spare held-out ones nothing beside the others.

    They are there without gain; the drivers are fitted anew without them. A cause that is left alone has been confirmed by all of the gain.
    """

    def is_idle(name: str) -> bool:
        without = driven(held, without_cause(found.fit, name)).ade_m
        mean = compare("ade_m", without, extended.ade_m, held.platoon, rng, held_out=True)
        typical = typical_gain(without, extended.ade_m, held.platoon, rng, held_out=True)
        return mean.difference < LEAST_HELD_OUT * mean.base and typical.ci95[0] <= 0.0

    first, *further = found.accepted
    idle = [one for one in further if _is_of_few(found, one.candidate) or is_idle(one.candidate.name)]
    stands_alone = len(idle) == len(further)
    if _is_of_few(found, first.candidate) or (not stands_alone and is_idle(first.candidate.name)):
        idle.append(first)
    fit = found.fit
    for cause in idle:
        fit = without_cause(fit, cause.candidate.name)
    there = (*found.without_gain, *(cause.candidate for cause in idle))
    kept = tuple(cause for cause in found.accepted if cause not in idle)
    return replace(found, fit=fit, accepted=kept, without_gain=there) if idle else found


def _is_of_few(found: Found, candidate: Candidate) -> bool:
    """Return whether a cause rests on too few drivers to be one."""
    return hy.effective_drivers(found.first, candidate) < gates.FEWEST_DRIVERS


def _refused(found: Found) -> Found:
    """Return what was found, its causes as there without gain."""
    there = (*found.without_gain, *(cause.candidate for cause in found.accepted))
    left = left_without_causes(found.first)
    return replace(found, fit=found.base, accepted=(), without_gain=there, unexplained=left, share=None)


def _split(windows: Windows, rng: np.random.Generator) -> tuple[Windows, Windows]:
    """Return the drivers that name and fit, and those held out, by blocks of neighbours."""
    blocks = np.unique(windows.platoon)
    chosen = rng.permutation(blocks)[: max(1, len(blocks) // HELD_OUT)] if len(blocks) > 1 else blocks[:0]
    is_held = np.isin(windows.platoon, chosen)
    return windows.of_drivers(np.flatnonzero(~is_held)), windows.of_drivers(np.flatnonzero(is_held))


def _seconds(clock: list[tuple[str, float]]) -> dict[str, float]:
    return {name: now - then for (_, then), (name, now) in itertools.pairwise(clock)}


def _too_little(windows: Windows, train: Windows, clock: list[tuple[str, float]]) -> Diagnosis:
    """Return the verdict none for a recording that cannot say anything."""
    fit = first_guess(windows, PLAIN.copy(), np.array([0.01, 0.04]))
    note = (
        f"too little to say anything: {windows.drivers} drivers with {len(windows.seen)} windows of car-following "
        f"(at least {LEAST_DRIVERS} and {LEAST_WINDOWS} are needed to name and fit); an effect of any size may be there"
    )
    model = statements.model_of(fit, (), "")
    return Diagnosis(
        NONE, (), (), (), None, (), (), dict.fromkeys(statements.NAMES, "too few drivers"), (), model, model,
        tables.residuals(windows, None, None), tables.drivers(windows, fit, {}), (), dict(windows.excluded), (note,),
        _seconds(clock),
    )  # fmt: skip


def _told(
    recording: Recording, windows: Windows, held: Windows, found: Found, measurement: no.Noise,
    clock: list[tuple[str, float]], rng: np.random.Generator,
) -> Diagnosis:  # fmt: skip
    """Measure the gain on the held-out drivers and put everything into words."""
    if found.share is not None:
        held = some_drivers.by_their_other_windows(held, found.fit, found.share.value)
        windows = some_drivers.by_their_windows(windows, found.fit, found.share.value)
    found, base, extended, whole = _confirmed(found, held, rng)
    gains = _gains(held, found, extended, rng)
    shares = _shares(gains)
    verdict = NAMED if found.accepted else UNKNOWN if found.unexplained else NONE
    clock.append(("gain", time.perf_counter()))
    known = {
        "vehicle": held.vehicle, "period": held.period, "base": base.ade_m, "extended": extended.ade_m,
    }  # fmt: skip
    return Diagnosis(
        verdict=verdict,
        causes=statements.causes(found, shares, gains),
        without_gain=statements.without_gain(found),
        unexplained=statements.unexplained(found),
        gain=whole[0],
        other_gains=whole[1:],
        ruled_out=statements.ruled_out(found),
        untestable=statements.untestable(recording, windows, found),
        power=statements.power(found),
        model=statements.model_of(found.fit, found.accepted, recording.source, found.share),
        base_model=statements.model_of(found.base, (), recording.source),
        residuals=tables.residuals(held, base.residual, extended.residual),
        drivers=tables.drivers(windows, for_rollouts(windows, found.fit), known),
        scans=statements.scans(found.first),
        excluded=dict(windows.excluded),
        notes=statements.notes(recording, windows, measurement, found),
        seconds=_seconds(clock),
        other_law=statements.other_law(found.last),
    )


def _detectable(
    subject: Subject, found: Found, injections: int, rng: np.random.Generator, progress: Progress
) -> tuple[Detectable, ...]:
    """Return which sizes would have been found; nothing unless injections are asked for."""
    if not injections:
        return ()
    if found.share is not None:
        told_apart = some_drivers.by_their_windows(subject.windows, found.fit, found.share.value)
        subject = replace(subject, windows=told_apart)
    return injection.detectable(subject, found, injections, rng, progress)


def _misfit(subject: Subject, evidence: Evidence) -> LawMisfit | None:
    """Return the shape that the law lacks, as the last look shows it."""
    if evidence.of_form is None:
        return None
    return law_misfit(subject.windows, evidence.of_form, subject.grid.pivot)


def _law(held: Windows, followed: Followed, by_idm: Fit, rng: np.random.Generator) -> Law | None:
    """Return the law that drivers follow if it is not the IDM, and what it does to those held out; no causes in either."""
    if followed.likelier is None or not len(held.seen):
        return None
    base, other = driven(held, by_idm), driven(held, followed.fit)
    gain = compare("ade_m", base.ade_m, other.ade_m, held.platoon, rng, held_out=True)
    return Law(laws.NAMES[law.law_of(followed.fit)], followed.likelier, gain)


def _gains(held: Windows, found: Found, extended: Errors, rng: np.random.Generator) -> dict[str, Gain]:
    """Return what each cause spares of the ADE of held-out drivers, beside the others."""
    out = {}
    for name in _names(found):
        without = driven(held, without_cause(found.fit, name))
        out[name] = compare("ade_m", without.ade_m, extended.ade_m, held.platoon, rng, held_out=True)
    return out


def _shares(gains: Mapping[str, Gain]) -> Mapping[str, float]:
    """Return each cause's share of the gain: what is lost when it alone is left out, scaled to sum to one."""
    lost = {name: max(gain.difference, 1e-6) for name, gain in gains.items()}
    return {name: value / sum(lost.values()) for name, value in lost.items()}
