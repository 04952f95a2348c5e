"""The library of columns: what a little of each hypothesis does to the rollouts.

What is linear in an acceleration goes through the linear response to pulses; what is not linear near zero is a difference of rollouts.
Effects say in their own files in which forms they are looked for. Beside them stand free fields, which belong to no effect, and the
law's own misfit: smooth functions of gap, speed and approach rate.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.bins import edges_of, numbered, pulse_means, response_by_bin
from idm_sumo.diagnosis.fit import Fit, Linear, linearise
from idm_sumo.diagnosis.free_fields import RESPONSE, content_of, covariates, free_groups, moving
from idm_sumo.diagnosis.plan import (
    BASIS,
    FREE_BINS,
    MISFIT,
    MOST_BINS,
    PERIODS,
    WIDTH,
    Axis,
    Group,
    Plan,
    coarser,
    periods_of,
)
from idm_sumo.models.effects import CATALOGUE, Effect
from idm_sumo.models.effects.form import LANE, POSITION, TIME, Form, Moments

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

LONGEST, CALMEST = 3.0, 1.5  # times the ninetieth percentile of a column's length; times the median response
NOTHING = 1e-9


class Answer(NamedTuple):
    """Rollouts at a fit: their linear model, their response to pulses of acceleration, their state by frame."""

    line: Linear
    response: Floats
    state: Floats


def answer_of(windows: w.Windows, fit: Fit) -> Answer:
    """Return the rollouts; windows that answer pulses much more than usual count less.

    A driver's own noise is such pulses, and what it leaves is in proportion to the response, while the covariance of what windows
    leave is pooled.
    """
    response, state = ro.respond(windows.seen, windows.driver, fit.theta, fit.by_lane)
    line = linearise(windows, fit)
    size = np.sqrt((response**2).sum(axis=(1, 2)))
    calm = np.minimum(1.0, CALMEST * np.median(size) / np.maximum(size, NOTHING))
    return Answer(replace(line, whitener=line.whitener * calm[:, None, None]), response, state)


def plan_of(windows: w.Windows, fit: Fit, *, free: bool = True) -> Plan:
    """Return what is asked of a recording whose model is that of a fit."""
    seen = windows.seen[:, :, w.LEAD : -1]
    lanes = tuple(int(n) for n in np.unique(seen[:, w.LANE]))
    span = float(seen[:, w.TIME].min()), float(seen[:, w.TIME].max())
    plan = Plan((), float(seen[:, w.V].mean()), lanes, span)
    places = edges_of(seen[:, w.X], WIDTH[POSITION], MOST_BINS)
    times = edges_of(seen[:, w.TIME], WIDTH[TIME], MOST_BINS)
    groups = [Group(MISFIT), *_of_effects(windows, fit, plan, places, times)]
    if free:
        groups += free_groups(windows, plan, places, times)
    return plan.only(groups)


def _of_effects(windows: w.Windows, fit: Fit, plan: Plan, places: Floats, times: Floats) -> Iterator[Group]:
    several = len(plan.lanes) > 1
    for effect in CATALOGUE:
        there = present_form(fit, effect)
        if there is not None:
            yield Group(effect.name, there, present=True)
        for form in effect.forms:
            if (form.along == TIME and periods_of(windows) > 1) or (form.along == LANE and not several):
                continue
            if there is not None and form.field is None:
                continue  # the column of a little more stands for it
            if form.along == LANE:
                yield Group(effect.name, form, axes=(Axis(LANE, np.arange(0.5, max(plan.lanes) + 1.0)),))
            elif form.along:
                edges = places if form.along == POSITION else times
                yield Group(effect.name, form, axes=(Axis(form.along, edges),))
                for lane in plan.lanes if several and form is effect.forms[0] and form.along == POSITION else ():
                    yield Group(effect.name, form, axes=(Axis(form.along, coarser(edges, FREE_BINS)),), lane=lane)
            else:
                yield Group(effect.name, form)
        if several and there is None:
            yield from _by_lane(effect, plan)


def _by_lane(effect: Effect, plan: Plan) -> Iterator[Group]:
    """Yield the effect's first form in each lane alone."""
    form = next((form for form in effect.forms if not form.along), None)
    if form is not None:
        for lane in plan.lanes:
            yield Group(effect.name, form, lane=lane)


def present_form(fit: Fit, effect: Effect) -> Form | None:
    """Return the step back to nothing of an effect that is in the model; None if it is not there.

    A secant over its whole size: a small step more moves the few drivers farthest who are at the edge of stability with it.
    """
    for magnitude in (*effect.parameters[:1], *filter(None, [effect.alternative])):
        each = fit.by_lane[:, magnitude.slot]
        value = float(each[np.abs(each).argmax()])
        if value != 0.0:
            return Form(magnitude.slot, size=-value)
    return None


def basis(speed: Floats, rate: Floats, gap: Floats, pivot: float) -> Floats:
    """Return smooth accelerations (m/s²) of speed, approach rate and gap, of about one; the last axis is of functions."""
    parts = (speed - pivot) / 10.0, rate / 3.0, np.log(np.maximum(gap, 1.0) / (2.0 + 1.2 * np.maximum(speed, 0.0)))
    powers = [(1.0, one, one * one, one * one * one) for one in (np.tanh(0.5 * part) * 2.0 for part in parts)]
    return np.stack([powers[0][a] * powers[1][b] * powers[2][c] for a, b, c in BASIS], axis=-1)


def _moments(windows: w.Windows, state: Floats, plan: Plan) -> Moments:
    seen = windows.seen[:, :, w.LEAD : -1]
    x = state[:, :, ro.BASE_X]
    return Moments(
        state[:, :, ro.BY_T], state[:, :, ro.BY_V0], state[:, :, ro.BASE_A], state[:, :, ro.BASE_V], x,
        seen[:, w.REAR] - x, seen[:, w.TIME], seen[:, w.SPEED], seen[:, w.ACCELERATION], seen[:, w.ACCELERATION_OF_LATE],
        seen[:, w.KIND], seen[:, w.OWN_KIND], seen[:, w.LANE], seen[:, w.ADJACENT], seen[:, w.NEXT_BESIDE],
        x - seen[:, w.BEHIND], seen[:, w.UNTIL_CUT_IN], seen[:, w.UNTIL_OWN], plan.speed, float(max(plan.lanes)), *plan.span,
    )  # fmt: skip


def columns(windows: w.Windows, fit: Fit, answer: Answer, plan: Plan, longest: Floats | float = np.inf) -> Floats:
    """Return all columns of some windows, differences of rollouts no longer than they may be; ``(windows, moments, columns)``."""
    see = _moments(windows, answer.state, plan)
    out = _linear(windows, answer.state, see, answer.response, plan)
    out[:, :, secants_of(plan)] = shortened(_secants(windows, fit, answer, plan), longest)
    return _with_lanes(see, plan, out)


def seen_through(windows: w.Windows, fit: Fit, answer: Answer, plan: Plan, vectors: Floats, longest: Floats) -> Floats:
    """Return the products of vectors, shape ``(windows, vectors, moments)``, with all columns: few vectors are much faster than the columns."""
    see = _moments(windows, answer.state, plan)
    out = _linear(windows, answer.state, see, vectors @ answer.response, plan)
    out[:, :, secants_of(plan)] = vectors @ shortened(_secants(windows, fit, answer, plan), longest)
    return _with_lanes(see, plan, out)


def _linear(windows: w.Windows, state: Floats, see: Moments, response: Floats, plan: Plan) -> Floats:
    """Return the columns that are linear in an acceleration, through a response to pulses; the others are zero."""
    seen = windows.seen[:, :, w.LEAD : -1]
    known = covariates(seen, state) | {POSITION: see.position, TIME: see.time, LANE: see.lane}
    known |= moving(see.position, see.time, plan.span)
    period = np.unique(windows.period, return_inverse=True)[1][windows.driver] if periods_of(windows) > 1 else None
    out = np.zeros((*response.shape[:2], plan.count))
    values: dict[object, Floats] = {}
    numbers: dict[object, Integers] = {}
    for group in plan.groups:
        here = out[:, :, group.first : group.first + group.count]
        if not group.competes:
            here[:] = response @ (_smooth(see, plan) if group.name == MISFIT else _waves(see))
            continue
        if group.of_lane or group.is_secant:
            continue
        key = group.form.field if group.form is not None else group.content
        if key not in values:
            values[key] = group.form.field(see) if group.form is not None else content_of(group.content, see)  # type: ignore[misc]
        if not group.axes:
            here[:] = response @ pulse_means(np.ascontiguousarray(values[key]))[:, :, None]
            continue
        where = (*((axis.name, *axis.edges[:3], len(axis.edges)) for axis in group.axes), group.lane, group.period)
        if where not in numbers:
            numbers[where] = _number(group, known, see.lane, period)
        response_by_bin(response, numbers[where], values[key], here)
    return out


def _smooth(see: Moments, plan: Plan) -> Floats:
    """Return the mean accelerations of the law's own misfit, by pulse."""
    smooth = basis(see.speed, see.speed - see.leader_speed, see.gap, plan.speed)
    fields = np.concatenate([smooth, content_of(RESPONSE, see)[:, :, None]], axis=2)
    return np.asarray(fields.reshape(len(fields), -1, ro.BIN, fields.shape[2]).mean(axis=2))


def _waves(see: Moments) -> Floats:
    """Return the accelerations of swings in the middle of each pulse, sines first."""
    middle = see.time.reshape(len(see.time), -1, ro.BIN).mean(axis=2)
    turned = 2.0 * np.pi * middle[:, :, None] / PERIODS
    return np.concatenate([np.sin(turned), np.cos(turned)], axis=2)


def _with_lanes(see: Moments, plan: Plan, out: Floats) -> Floats:
    """Return columns with those of effects in one lane: those of all lanes, for windows that lie in it."""
    lane = see.lane[:, see.lane.shape[1] // 2]
    everywhere = {g.form: g.first for g in plan.groups if g.form is not None and not g.axes and not g.of_lane}
    for group in plan.groups:
        if group.of_lane and group.form is not None:
            out[:, :, group.first] = out[:, :, everywhere[group.form]] * (lane == group.lane)[:, None]
    return out


def _number(group: Group, known: dict[str, Floats], lane: Floats, period: Integers | None) -> Integers:
    """Return the bin of a group that each frame is in, -1 for none."""
    number = np.zeros(lane.shape, np.int64)
    for axis, count in zip(group.axes, group.shape, strict=True):
        values = known[axis.name]
        if axis.name == POSITION:  # who drives on beyond what was recorded is at its end
            values = np.clip(values, axis.edges[0], axis.edges[-1] - 1e-6)
        here = numbered(values, axis.edges)
        number = np.where((number >= 0) & (here >= 0), number * count + here, -1)
    if group.lane:
        number = np.where(lane == group.lane, number, -1)
    if group.period >= 0 and period is not None:
        number = np.where((period == group.period)[:, None], number, -1)
    return number


def secants_of(plan: Plan) -> Integers:
    """Return the numbers of the columns that are differences of rollouts."""
    return np.array([group.first for group in plan.groups if group.is_secant], np.int64)


def _secants(windows: w.Windows, fit: Fit, answer: Answer, plan: Plan) -> Floats:
    """Return the differences of rollouts, shape ``(windows, moments, secants)``."""
    groups = [group for group in plan.groups if group.is_secant]
    changed = ro.positions_otherwise(windows, fit.theta, [moved(fit, group) for group in groups])
    sizes = np.array([group.form.size for group in groups if group.form is not None])
    return np.asarray((changed - answer.line.simulated[:, :, None]) / sizes)


def moved(fit: Fit, group: Group) -> Floats:
    """Return the magnitudes with a group's form on top: added where it acts, companions set."""
    assert group.form is not None
    by_lane = fit.by_lane.copy()
    there = by_lane[:, group.form.slot] != 0.0
    rows = there if group.present else np.ones(len(by_lane), bool)
    if group.lane:
        rows = np.arange(len(by_lane)) % ro.ROWS == group.lane
    by_lane[rows, group.form.slot] += group.form.size
    for slot, value in group.form.fixed:
        by_lane[rows, slot] = value
    return by_lane


def longest_of(windows: w.Windows, fit: Fit, answer: Answer, plan: Plan, most: int = 600) -> Floats:
    """Return how long each difference of rollouts may be in one window: a few times what nine of ten with any effect have.

    Where a simulated vehicle nearly hits its leader, a little more of anything moves it by kilometres. Some of the windows tell.
    """
    rows = np.arange(0, len(windows.seen), max(1, len(windows.seen) // most))
    size = np.abs(_secants(windows.of_rows(rows), fit, of_rows(answer, rows), plan)).max(axis=1)
    usual = [float(np.percentile(one[one > NOTHING], 90)) if (one > NOTHING).any() else 1.0 for one in size.T]
    return LONGEST * np.array(usual)


def shortened(secants: Floats, longest: Floats | float) -> Floats:
    """Return differences of rollouts of which none is longer than it may be."""
    size = np.abs(secants).max(axis=1)
    return np.asarray(secants * np.minimum(1.0, longest / np.maximum(size, NOTHING))[:, None, :])


def chunks(windows: w.Windows, most: int = 400) -> Iterator[slice]:
    """Yield slices of windows of whole drivers."""
    begin = 0
    edges = np.flatnonzero(np.diff(windows.driver)) + 1
    for end in [*edges.tolist(), len(windows.driver)]:
        if end - begin >= most or end == len(windows.driver):
            if end > begin:
                yield slice(begin, end)
            begin = end


def of_rows(answer: Answer, rows: slice | Integers) -> Answer:
    """Return the rollouts of some windows."""
    line = answer.line
    some = Linear(*(part[rows] for part in (line.error, line.jacobian, line.shared, line.simulated, line.whitener)))
    return Answer(some, answer.response[rows], answer.state[rows])
