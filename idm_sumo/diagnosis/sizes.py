"""The size of a cause: moved to where the recording's score, less that of replicates, vanishes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import evidence as ev
from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis import regressors as rg
from idm_sumo.diagnosis.chance import Chance
from idm_sumo.diagnosis.edges import sharpened
from idm_sumo.diagnosis.fit import Fit, fit_drivers, improve
from idm_sumo.diagnosis.gain import driven, typical, typical_gain
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.look import Look, Subject
from idm_sumo.diagnosis.recovery import recovered
from idm_sumo.diagnosis.result import Gain
from idm_sumo.diagnosis.rollout import ROWS
from idm_sumo.diagnosis.windows import Windows
from idm_sumo.models.effects import BY_NAME, Parameter
from idm_sumo.runtime.threads import each_in_threads

Floats = npt.NDArray[np.float64]

ROUNDS = 12  # of a fit from scratch
CLIMBS = 5
REFINEMENTS = 4
ROUNDS_OF_REPLICATES = 3
STEEPEST = 0.6  # of the information: replicates follow the model that drives them only in part
LONGEST_MOVE, SETTLED = 0.6, 0.02  # of a magnitude, in one step; below, it has settled
LARGEST_FACTOR = 6.0  # by which steps may grow
# Of the ADE, by another size; and by sizes of causes refined together: what one took up of another before that was in the model may drive a
# little better than the truth. (A place a third too strong and a delay half as long spared 1.4 % more than what was nearly hidden.)
LARGEST_LOSS, LARGEST_LOSS_TOGETHER = 0.01, 0.02
DELAY = "reaction_delay"
# Sizes of what fitted drivers have made up for so well that those of the truth are far away: from one of these a climb begins.
FAR = {DELAY: (0.2, 0.4, 0.8), "desired_speed": (0.1, 0.2, 0.3)}


def with_cause(fit: Fit, candidate: Candidate, value: float | None = None) -> Fit:
    """Return the fit with a cause in its magnitudes, the drivers not yet refitted."""
    by_lane = fit.by_lane.copy()
    of_each_kind = by_lane.reshape(-1, ROWS, by_lane.shape[1])  # of drivers who may have another cause, or not
    for number, (slot, size) in enumerate(hy.slots_of(candidate)):
        of_each_kind[:, hy.lanes_of(candidate), slot] = size if number or value is None else value
    return replace(fit, by_lane=by_lane)


def with_value(fit: Fit, name: str, value: float) -> Fit:
    """Return the fit with another magnitude of a cause that is in it, the drivers not yet refitted."""
    by_lane, slot = fit.by_lane.copy(), magnitude_of(fit, name).slot
    by_lane[rg.acts(by_lane, slot), slot] = value
    return replace(fit, by_lane=by_lane)


def without_cause(fit: Fit, name: str) -> Fit:
    """Return the fit with a cause that is in it taken out, the drivers not yet refitted."""
    by_lane = fit.by_lane.copy()
    for parameter in BY_NAME[name].all_parameters:
        by_lane[:, parameter.slot] = 0.0
    return replace(fit, by_lane=by_lane)


def refitted(subject: Subject, fit: Fit, *, rounds: int) -> Fit:
    """Return the fit with drivers, population and noise adapted to its magnitudes."""
    for _ in range(rounds):
        fit = improve(subject.windows, fit)
    return fit


def anew(subject: Subject, fit: Fit) -> Fit:
    """Return drivers, population and noise fitted from scratch to the same magnitudes: fits on the way to rest do not compare."""
    return fit_drivers(subject.windows, fit.by_lane, fit.start_variance, rounds=ROUNDS)


@dataclass(frozen=True)
class Tried:
    """A candidate at the size where the data want it, and how much they want it (twice the log-likelihood's gain)."""

    candidate: Candidate
    fit: Fit
    support: float


def climbed(subject: Subject, fit: Fit, candidate: Candidate, chances: Sequence[Chance] = ()) -> Tried:
    """Move a candidate's magnitude to where its score vanishes.

    The score near zero underrates what is not linear (a dead band, a long delay) or what the fitted drivers have absorbed. The
    integral of the score over the magnitude, freed from the replicates' at every point, is the log-likelihood that it gains. Where that
    leads away from the recorded vehicles (another form of the effect), the magnitude stays where the climb began. On the way replicates
    with ``chances`` are evaluated, if there are any: what smoothing makes of a short delay is not what it makes of the longer one with which
    the candidate was found; drivers drawn anew, far from where those were whom they replace, answer a place or a time from there; and
    what the car-following's form takes off a magnitude changes with it. (Headways that are half as long again behind trucks had come to
    0.29 for that, and as metres.) The way to a delay or to another desired speed is long, and the first chance alone is evaluated there.
    """
    is_far = candidate.name in FAR
    begins = _far_away(subject, fit, candidate) if is_far else [refitted(subject, with_cause(fit, candidate), rounds=2)]
    now, evaluated, scores = begins[-1], {0.0: candidate.bias}, {0.0: candidate.score}
    here = ev.look_here(subject, now)
    if is_far and chances:
        nothing = with_cause(fit, candidate, _signed(candidate, hy.NEXT_TO_NOTHING))
        evaluated, scores = _evaluated_on_the_way(subject, candidate.name, [nothing, *begins], chances[:1])
    elif chances:
        evaluated[_value(now, candidate.name)] = ev.local_biases(subject, now, here, chances)[candidate.name].score
    value, support = _value(now, candidate.name), 0.0
    error, stride, path = candidate.error, Stride(), list[Tried]()
    for _ in range(CLIMBS):
        step = ev.local_scores(ev.look_here(subject, now) if path else here)[candidate.name]
        free = scores[value] = step.score - _between(evaluated, value)
        support = 2.0 * _integral(scores, value)
        error = candidate.error * np.sqrt(candidate.information / max(step.information, 1e-9))
        path.append(Tried(replace(candidate, value=value, error=error), now, support))
        value = stride.moved(magnitude_of(now, candidate.name), value, free / max(step.information, 1e-9))
        if stride.settled:
            break
        now = refitted(subject, with_value(now, candidate.name, value), rounds=1)
    end = Tried(replace(candidate, value=value, error=error), now, support)
    before, after = (typical_ade(subject.windows, one.fit) for one in (path[0], end))
    return end if after < (1.0 + LARGEST_LOSS) * before else path[0]


def _between(evaluated: Mapping[float, float], value: float) -> float:
    """Return what replicates say at a magnitude between those at which they were evaluated, which may be of either sign."""
    known = sorted(evaluated)
    return float(np.interp(value, known, [evaluated[size] for size in known]))


def _integral(scores: Mapping[float, float], end: float) -> float:
    """Return the integral from zero of scores known at some magnitudes, zero one of them.

    In the order of the magnitudes, not of the climb: who comes back to where it began has gained nothing.
    """
    known = sorted(value for value in scores if min(0.0, end) <= value <= max(0.0, end))
    area = float(np.trapezoid([scores[value] for value in known], known))
    return area if end >= 0.0 else -area


def _evaluated_on_the_way(
    subject: Subject, name: str, models: list[Fit], chances: Sequence[Chance]
) -> tuple[dict[float, float], dict[float, float]]:
    """Return what replicates say of ever larger sizes, and the recording's scores less that; the first size counts as none."""
    evaluated, scores = dict[float, float](), dict[float, float]()
    for number, model in enumerate(models):
        here, value = ev.look_here(subject, model), _value(model, name) if number else 0.0
        evaluated[value] = ev.local_biases(subject, model, here, chances)[name].score
        scores[value] = ev.local_scores(here)[name].score - evaluated[value]
    return evaluated, scores


def ade_of(windows: Windows, fit: Fit) -> Floats:
    """Return the average displacement error (m) of each driver that fits."""
    return driven(windows, fit, known=True).ade_m


def typical_ade(windows: Windows, fit: Fit) -> float:
    """Return the geometric mean, over the drivers that fit, of their average displacement errors (m)."""
    return float(np.exp(typical(ade_of(windows, fit)).mean()))


def _signed(candidate: Candidate, size: float) -> float:
    """Return a size with the sign that a candidate has, or, if its effect cannot have that one, with the other.

    A form of a delay may look negative near zero and yet be the true one farther away; and who acts on what is still to come reads a
    past that is not there.
    """
    return float(np.copysign(size, candidate.value)) if candidate.is_possible else size


def _far_away(subject: Subject, fit: Fit, candidate: Candidate) -> list[Fit]:
    """Return fits with ever larger sizes, up to the one after which more is left.

    They are from scratch: drivers fitted without a delay, say, are far from those with one.
    """
    models, least = list[Fit](), np.inf
    for size in FAR[candidate.name]:
        by_lane = with_cause(fit, candidate, _signed(candidate, size)).by_lane
        model = fit_drivers(subject.windows, by_lane, fit.start_variance, rounds=6)
        left = typical_ade(subject.windows, model)
        if left >= least:
            break
        models, least = [*models, model], left
    return models


def refined(subject: Subject, fit: Fit, names: list[str], chances: list[Chance], rng: np.random.Generator) -> Fit:
    """Move the magnitudes in the model to where recording and replicates agree.

    What replicates show depends on the model that drives them, and they begin where the recorded vehicles were, which the true
    effect put there: so replicates are made anew until nothing moves, with the same chance in every round, or they would never agree
    with each other. Sizes that drive the vehicles worse, and likely so, are not taken.
    """
    begin = fit
    evaluated: dict[str, ReplicateScore] = {}
    for _ in range(ROUNDS_OF_REPLICATES):
        fit = refitted(subject, recovered(subject, sharpened(subject, fit, names)), rounds=1)
        here = ev.look_here(subject, fit)
        biases = ev.local_biases(subject, fit, here, chances)
        evaluated = {name: ReplicateScore.at(_value(fit, name), biases[name], evaluated.get(name)) for name in names}
        fit, was_there = _settle(subject, fit, here, evaluated)
        if was_there:
            break
    fit = anew(subject, fit)
    lost = gain_of(subject, fit, begin, rng)
    return begin if drive_worse(lost, len(names)) else fit


def drive_worse(lost: Gain, causes: int) -> bool:
    """Return whether refined sizes of so many causes likely drive vehicles too much worse to be taken."""
    return lost.is_likely and lost.difference > (LARGEST_LOSS if causes == 1 else LARGEST_LOSS_TOGETHER)


def _settle(subject: Subject, fit: Fit, here: Look, evaluated: dict[str, ReplicateScore]) -> tuple[Fit, bool]:
    """Step towards where the recording says what replicates are expected to say; return whether it was there from the start, too."""
    strides = {name: Stride() for name in evaluated}
    for number in range(REFINEMENTS):
        found = ev.local_scores(ev.look_here(subject, fit) if number else here)
        for name, stride in strides.items():
            value = _value(fit, name)
            free = found[name].score - evaluated[name].expected(value)
            step = free / max(found[name].information, 1e-9)
            fit = with_value(fit, name, stride.moved(magnitude_of(fit, name), value, step))
        fit = refitted(subject, fit, rounds=1)
        if all(stride.settled for stride in strides.values()):
            return fit, number == 0
    return fit, False


def _value(fit: Fit, name: str) -> float:
    return float(fit.by_lane[0, magnitude_of(fit, name).slot])


@dataclass(frozen=True)
class ReplicateScore:
    """The score of replicates, and how it changes with the magnitude that drives them."""

    value: float
    score: float
    slope: float = 0.0

    @classmethod
    def at(cls, value: float, local: ev.Local, before: ReplicateScore | None) -> ReplicateScore:
        """Return what was evaluated at a magnitude; with what was evaluated before at another one, its slope."""
        moved = 0.0 if before is None else value - before.value
        if before is None or abs(moved) < SETTLED * abs(value):
            return cls(value, local.score)
        most = STEEPEST * local.information
        return cls(value, local.score, float(np.clip((local.score - before.score) / moved, -most, most)))

    def expected(self, value: float) -> float:
        """Return the score that replicates would have at a magnitude nearby."""
        return self.score + self.slope * (value - self.value)


def gain_of(subject: Subject, before: Fit, after: Fit, rng: np.random.Generator) -> Gain:
    """Return the share of a driver's ADE that one model spares beside another, the typical one of the drivers that fit."""
    base, extended = each_in_threads(lambda fit: ade_of(subject.windows, fit), (before, after))
    return typical_gain(base, extended, subject.windows.platoon, rng, held_out=False)


class Stride:
    """Steps towards the size of a magnitude that grow as long as they go the same way.

    The population follows a magnitude only slowly (expectation and maximisation), and the score with it: a step that is right
    for the drivers as they are is too short.
    """

    def __init__(self) -> None:
        self.settled = False
        self._factor, self._last = 0.5, 0.0

    def moved(self, first: Parameter, value: float, step: float) -> float:
        """Return the magnitude after a step: within its bounds, and off zero, where no further step could be taken."""
        same = step * self._last > 0.0
        self._factor = (
            min(2.0 * self._factor, LARGEST_FACTOR) if same or not self._last else max(0.25 * self._factor, 0.5)
        )
        self._last, self.settled = step, abs(step) < SETTLED * abs(value)
        longest = LONGEST_MOVE * abs(value)
        moved = value + float(np.clip(self._factor * step, -longest, longest))
        return float(np.clip(moved, first.lower, first.upper)) or hy.NEXT_TO_NOTHING * first.typical


def magnitude_of(fit: Fit, name: str) -> Parameter:
    """Return the first parameter of an effect in the form that acts in a fit: at zero the effect is not there."""
    return BY_NAME[name].acting(fit.by_lane[0])[0]
