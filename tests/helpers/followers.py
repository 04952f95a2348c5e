"""Windows of followers that really drive by an IDM, and pieces of what a search finds in them."""

from __future__ import annotations

import numpy as np
import pandas as pd

from idm_sumo.diagnosis import noise as no
from idm_sumo.diagnosis import rollout as ro
from idm_sumo.diagnosis import windows as w
from idm_sumo.diagnosis.evidence import Evidence
from idm_sumo.diagnosis.fit import Fit
from idm_sumo.diagnosis.hypotheses import Candidate
from idm_sumo.diagnosis.left_over import LeftOver
from idm_sumo.diagnosis.regressors import Regressor
from idm_sumo.diagnosis.sizes import Tried
from idm_sumo.diagnosis.smoother import local_cubic
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.recording import Recording
from idm_sumo.roads.us101 import US101

DRIVERS, EACH = 30, 3


def followers(by_lane: np.ndarray, rng: np.random.Generator, lanes: int = 1) -> tuple[w.Windows, np.ndarray]:
    """Return windows of IDM drivers, with given magnitudes, behind leaders that oscillate.

    They lie in the lanes by turns.
    """
    count, frames = DRIVERS * EACH, w.LEAD + w.HORIZON + 1
    time = 0.1 * np.arange(frames)
    wave = rng.uniform(0.2, 0.6, (count, 1))
    phase = rng.uniform(0.0, 6.0, (count, 1))
    speed = 9.0 + 3.0 * np.sin(wave * time + phase)
    place = 9.0 * time - 3.0 / wave * (np.cos(wave * time + phase) - np.cos(phase))
    seen = np.zeros((count, w.COLUMNS, frames))
    seen[:, w.REAR], seen[:, w.SPEED] = place + 20.0, speed
    seen[:, w.ACCELERATION] = np.gradient(speed, 0.1, axis=1)
    seen[:, w.SECOND], seen[:, w.BEHIND], seen[:, w.ADJACENT] = np.inf, -np.inf, np.nan
    seen[:, [w.SINCE, w.UNTIL_CUT_IN, w.UNTIL_OWN]] = 1e6
    seen[:, w.TIME], seen[:, w.OWN_KIND] = time, 2.0
    seen[:, w.LANE] = 1.0 + np.arange(count)[:, None] % lanes
    seen[:, w.V] = speed
    theta = np.exp(np.log([1.2, 1.8, 1.2, 2.2, 28.0]) + 0.2 * rng.standard_normal((DRIVERS, 5)) * [1, 1, 1, 1, 0.2])
    driver = np.repeat(np.arange(DRIVERS), EACH)
    x, v = ro.drive(seen, driver, theta, by_lane, np.zeros(2), ro.NO_PUSH, 0)
    seen[:, w.X], seen[:, w.V] = x, v
    windows = w.Windows(
        seen, seen[:, w.LEADERS], driver, np.arange(1, DRIVERS + 1), np.full(DRIVERS, "p"),
        np.arange(DRIVERS) // 5, local_cubic(21), local_cubic(21), {},
    )  # fmt: skip
    return windows, theta


def candidate(z, name="perception_threshold", value=0.5, fixed=()):
    """Return a cause that stands out by ``z`` standard errors."""
    return Candidate(name, value, 0.01, z, 1e-9, Regressor(name, value, fixed), 1.0, 0.0)


FIT = Fit(np.zeros(5), np.eye(5), np.zeros((1, 5)), np.eye(1), np.ones(1), np.ones(2), ro.PLAIN)


def tried(z, name="perception_threshold", value=0.5, support=100.0):
    """Return such a cause, fitted, likelier by ``support``."""
    return Tried(Candidate(name, value, 0.01, z, 1e-9, Regressor(name, value), 1.0, 0.0), FIT, support)


def free(covariate, z, *, is_credible=True):
    """Return structure along a covariate that no cause explains."""
    return LeftOver(covariate, (0.0, 1.0), None, None, 0.2, z, 1e-9, is_credible)


def evidence(delay, *left):
    """Return what is seen if a delay stands out by so many standard errors, with what is free."""
    regressors = [Regressor("reaction_delay", 0.2, ((0, 0.2),))]
    drivers, information = 30, 1e4
    u = np.full((drivers, 1), delay * np.sqrt(1.5 * 1.5 * information) / drivers)
    part = np.full((drivers, 1), information / drivers)
    return Evidence(regressors, u, np.zeros((2, 1)), np.array([[information]]), part, np.arange(drivers), left)


def recorded(x: np.ndarray, *, is_smooth: bool = False) -> Recording:
    """Return vehicles with these positions, shape ``(vehicles, frames)``."""
    vehicles, frames = x.shape
    time = 0.1 * np.arange(frames)
    table = pd.DataFrame({
        c.PERIOD: "p", c.VEHICLE: np.repeat(np.arange(1, vehicles + 1), frames),
        c.FRAME: np.tile(np.arange(frames), vehicles),
        c.TIME: np.tile(time, vehicles), c.X: x.ravel(), c.Y: -2.0, c.SPEED: 10.0, c.ACCELERATION: 0.0, c.HEADING: 0.0,
        c.LENGTH: 4.5, c.WIDTH: 2.0, c.CLASS: 2, c.LANE: 1, c.LEADER: 0, c.HEADWAY: np.nan,
    })  # fmt: skip
    return Recording(Recording.from_table(table, road=US101).table, US101, is_smooth=is_smooth)


# Spectra of what vehicles do and of what a camera adds.
MOTION = no.Noise(0.0, np.array([0.4]), np.array([5.0]))
ERRORS = no.Noise(0.04, np.array([0.02]), np.array([0.4]))
