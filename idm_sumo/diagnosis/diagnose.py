"""From a recording to its diagnosis."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, set_num_threads
from threadpoolctl import threadpool_limits

from idm_sumo.diagnosis import chance, injection, law, outcome
from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis.artefact import find_seam, repaired
from idm_sumo.diagnosis.decision import decide
from idm_sumo.diagnosis.evidence import Subject
from idm_sumo.diagnosis.fit import Fit, first_guess, fit_drivers
from idm_sumo.diagnosis.law import Followed
from idm_sumo.diagnosis.replicates import driver_noise
from idm_sumo.diagnosis.result import NAMED, Diagnosis
from idm_sumo.diagnosis.rollout import PLAIN
from idm_sumo.diagnosis.search import search
from idm_sumo.diagnosis.settings import SETTINGS, Settings
from idm_sumo.diagnosis.smoother import Smoother, local_cubic, posterior_mean, window_for
from idm_sumo.diagnosis.windows import Windows, cut_windows
from idm_sumo.recordings.recording import Recording
from idm_sumo.recordings.smoothing import WINDOW
from idm_sumo.runtime.progress import Progress, silent

LEAST_DRIVERS, LEAST_WINDOWS = 24, 60  # that say anything


def diagnose(
    recording: Recording, *, seed: int = 0, jobs: int = 1, injections: int = 0, only: Iterable[int] | None = None,
    progress: Progress = silent, settings: Settings = SETTINGS,
) -> Diagnosis:  # fmt: skip
    """Show what the simulation gets wrong, name the cause, extend the model, measure the gain.

    Parameters
    ----------
    recording : Recording
        As read (not smoothed).
    seed : int
        Of the folds, the null replicates and the bootstrap.
    jobs : int
        Threads of the compiled rollouts.
    injections : int
        Of each effect and size, to see which would have been found.
    only : iterable of int or None
        Vehicles whose drivers are examined, among the traffic of all; None for every one.
    progress : callable
        Called as the work proceeds.
    settings : Settings
        All numbers by which it decides.

    Returns
    -------
    Diagnosis
        Too little data gives the verdict none, with a note.
    """
    before = get_num_threads()
    set_num_threads(max(1, min(jobs, before)))
    try:
        with threadpool_limits(1, user_api="blas"):  # the threads are ours: many windows, small matrices
            return _diagnose(recording, np.random.default_rng(seed), injections, only, progress, settings)
    finally:
        set_num_threads(before)


def _diagnose(
    recording: Recording, rng: np.random.Generator, injections: int, only: Iterable[int] | None, progress: Progress,
    settings: Settings,
) -> Diagnosis:  # fmt: skip
    clock = [("start", time.perf_counter())]
    seam = find_seam(recording)
    recording = recording if seam is None else repaired(recording, seam)
    ready = prepared(recording, rng, only, progress, clock)
    if isinstance(ready, Windows):
        guess = first_guess(ready, PLAIN.copy(), np.array([0.01, 0.04]))
        return outcome.too_little(ready, guess, (LEAST_DRIVERS, LEAST_WINDOWS), _seconds(clock))
    subject, by_idm, followed = ready
    found = search(subject, followed.fit, settings, rng, progress)
    clock.append(("search", time.perf_counter()))
    progress("measuring the gain", 0, 1)
    decision = decide(subject, found, rng)
    clock.append(("gain", time.perf_counter()))
    told = outcome.told(recording, subject, found, decision, followed, subject.noises.measurement, rng)
    told = replace(
        told, seconds=_seconds(clock), law=outcome.law_of(subject.windows, followed, by_idm, rng),
        detectable=injection.detectable(subject, found, injections, rng, progress),
    )  # fmt: skip
    if seam is None:
        return told
    return replace(told, verdict=NAMED, causes=(outcome.seam_cause(seam), *told.causes))


class Prepared(NamedTuple):
    """A recording's windows, its drivers by the IDM, and by the law that they follow."""

    subject: Subject
    by_idm: Fit
    followed: Followed


def prepared(
    recording: Recording, rng: np.random.Generator, only: Iterable[int] | None, progress: Progress,
    clock: list[tuple[str, float]],
) -> Prepared | Windows:  # fmt: skip
    """Return the fitted drivers of a recording, or only its windows if they are too few to say anything; adds its stages to the clock."""
    progress("cutting windows", 0, 1)
    measurement = no.measurement_noise(recording)
    motion = no.motion_noise(recording, measurement)
    own = _follower_filter(measurement, rng)
    leaders = posterior_mean(measurement, motion) if recording.has_leader_rows else own
    windows = cut_windows(recording, own, leaders, rng)
    if only is not None:
        windows = windows.of_drivers(np.flatnonzero(np.isin(windows.vehicle, list(only))))
    clock.append(("windows", time.perf_counter()))
    if windows.drivers < LEAST_DRIVERS or len(windows.seen) < LEAST_WINDOWS:
        return windows
    progress("fitting drivers", 0, 1)
    start = chance.measured(measurement, own, 400, 160, rng)
    by_idm = fit_drivers(windows, PLAIN.copy(), np.array([start[0].var() + 1e-4, start[1].var() + 1e-4]))
    clock.append(("fit", time.perf_counter()))
    progress("comparing car-following laws", 0, 1)
    followed = law.followed(windows, by_idm, rng.spawn(1)[0])
    clock.append(("law", time.perf_counter()))
    leader = motion if recording.has_leader_rows and not recording.is_smooth else None
    noises = chance.Noises(measurement, no.QUIET, leader)
    return Prepared(_with_noise(Subject(windows, noises, recording.is_smooth), followed, rng), by_idm, followed)


def _with_noise(subject: Subject, followed: Followed, rng: np.random.Generator) -> Subject:
    """Return the subject with the drivers' noise that a fit leaves: what the fit explains is none."""
    fit: Fit = followed.fit
    noise = driver_noise(subject.windows, fit, subject.noises, rng, is_smooth=subject.is_smooth)
    return replace(subject, noises=replace(subject.noises, driver=noise))


def _follower_filter(measurement: no.Noise, rng: np.random.Generator) -> Smoother:
    """Return the filter of followers: the noisier the measurement, the longer."""
    _, speed, _ = chance.measured(measurement, local_cubic(WINDOW), 400, 160, rng)
    return local_cubic(window_for(float(speed.std())))


def _seconds(clock: list[tuple[str, float]]) -> dict[str, float]:
    return {name: now - then for (_, then), (name, now) in itertools.pairwise(clock)}
