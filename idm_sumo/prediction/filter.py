r"""A driver watched frame by frame: what it does beyond what its situation explains.

The first second foretells what anybody would do in this situation. What *this* driver adds to that, a deviation
:math:`\delta` of its log-parameters, shows only in what it does next. A cloud of deviations is drawn from what the predictor
leaves unknown; each drives a ghost from a recorded state, with the parameters foretold there and its own deviation. The
further a ghost is from the driver, the less its deviation weighs,

.. math:: \log w \leftarrow e^{-\Delta t/M}\log w - \kappa\,\Delta t\,|x - x_\mathrm{seen}|/\tau,

with :math:`\tau` the time since the ghost was set down. Every few seconds ghosts are set down anew where the driver is. The
cloud of a particle filter (Gordon, Salmond and Smith, 1993) never shrinks to a point here, because the likelihood is
tempered by :math:`\kappa`: on real drivers the past says little of the next ten seconds.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from idm_sumo import idm, road
from idm_sumo.calibration.hierarchical import to_parameters
from idm_sumo.errors import InputError
from idm_sumo.perception import leaders_along
from idm_sumo.prediction.observation import FEWEST_FRAMES, seen_in
from idm_sumo.prediction.rollout_predictor import RolloutPredictor
from idm_sumo.prediction.spread import logarithms
from idm_sumo.scenes import Scenes

Floats = npt.NDArray[np.float64]

REMEMBERED = 10  # frames, the predictor's second


class Frame(NamedTuple):
    """One instant of several drivers, arrays of shape ``(drivers,)``.

    Attributes
    ----------
    x, y : float64
        Front bumper (m): along the road, and to the left.
    speed : float64
        m/s.
    gap, leader_speed : float64
        m and m/s; a gap that is infinite or NaN is no leader.
    """

    x: Floats
    y: Floats
    speed: Floats
    gap: Floats
    leader_speed: Floats


def frames_of(scenes: Scenes, first: int, last: int) -> list[Frame]:
    """Return frames ``first .. last - 1`` of the recorded drivers, with the leaders they really had."""
    x, y, speed = (np.asarray(getattr(scenes, name)[:, first:last]) for name in ("x", "y", "speed"))
    leader = leaders_along(scenes, x, y, first)
    return [Frame(*columns) for columns in zip(x.T, y.T, speed.T, leader.gap.T, leader.speed.T, strict=True)]


class DriverFilter:
    """Parameters of drivers that are watched, kept up to date frame by frame.

    Parameters
    ----------
    predictor : RolloutPredictor
        Fitted.
    particles : int
        Deviations a driver.
    strength : float
        :math:`\kappa` (1/m): how strongly a ghost's error counts; 0 is the predictor alone.
    memory, restart : float
        s: in which old errors fade, and after which ghosts are set down anew.
    seed : int
        Of the cloud, which all drivers share.
    """

    def __init__(
        self, predictor: RolloutPredictor, particles: int = 200, strength: float = 0.3, memory: float = 20.0,
        restart: float = 5.0, seed: int = 1,
    ) -> None:  # fmt: skip
        self.predictor = predictor
        self.strength, self.memory = strength, memory
        self.restart_frames = max(round(restart / road.FRAME_STEP), 1)
        half = np.random.default_rng(seed).standard_normal((particles // 2, len(idm.LOWER)))
        self.deviations = np.concatenate([half, -half]) @ np.linalg.cholesky(predictor.covariance_).T  # mean exactly 0

    def start(self, frame: Frame) -> DriverFilter:
        """Begin with the first frame of some drivers; what was known of others is forgotten."""
        n, m = len(frame.x), len(self.deviations)
        self._past = [frame]
        self._log_weights = np.zeros((n, m))
        self._x, self._v = np.empty((n, m)), np.empty((n, m))
        self._theta, self._age = np.empty((n, m, self.deviations.shape[1])), 0
        self._set_down()
        return self

    def update(self, frame: Frame) -> DriverFilter:
        """Take in the next frame, 0.1 s later.

        Raises
        ------
        InputError
            If it has not the drivers of the frame before, or none was given to `start`.
        """
        if not hasattr(self, "_past") or len(frame.x) != len(self._past[-1].x):
            raise InputError("filter: a frame must hold the drivers that `start` was given, in the same order")
        before = self._past[-1]
        self._age += 1
        rear, leader_speed = _rear(before)
        fade, weight = np.exp(-road.FRAME_STEP / self.memory), self.strength / self._age
        _drive(self._x, self._v, self._theta, rear, leader_speed, self.predictor.desired_speed, frame.x, fade, weight,
               self._log_weights)  # fmt: skip
        self._past = [*self._past[1 - REMEMBERED :], frame]
        if self._age == self.restart_frames or len(self._past) == FEWEST_FRAMES:
            self._set_down()
        return self

    @property
    def parameters(self) -> Floats:
        """What the situation of the last second foretells with the driver's deviation, shape ``(drivers, 5)``."""
        found = to_parameters(self._foretold() + self.weights @ self.deviations)
        return np.where(self._led()[:, None], found, np.asarray(self.predictor.pooled_))

    @property
    def spread(self) -> Floats:
        """Covariance of ``log(a, b, T, d0, d1 + 1 m)`` that is left, shape ``(drivers, 5, 5)``."""
        weights = self.weights
        off = self.deviations - (weights @ self.deviations)[:, None]
        return np.asarray(np.einsum("nm,nmj,nmk->njk", weights, off, off))

    @property
    def weights(self) -> Floats:
        """How much each deviation counts for each driver, shape ``(drivers, particles)``, sum 1."""
        weights = np.exp(self._log_weights - self._log_weights.max(axis=1, keepdims=True))
        return np.asarray(weights / weights.sum(axis=1, keepdims=True))

    def _codes(self) -> Floats:
        return seen_in(*(np.stack(values, axis=1) for values in zip(*self._past, strict=True)))

    def _led(self) -> npt.NDArray[np.bool_]:
        return np.isfinite(self._past[-1].gap)

    def _foretold(self) -> Floats:
        """Return the logarithms foretold by the last frames; the population's where they cannot carry a prediction."""
        return logarithms(self.predictor.predict(self._codes()))

    def _set_down(self) -> None:
        """Put all ghosts where their drivers are."""
        now = self._past[-1]
        self._x[:], self._v[:], self._age = now.x[:, None], now.speed[:, None], 0
        self._theta[:] = to_parameters(self._foretold()[:, None] + self.deviations)


def _rear(frame: Frame) -> tuple[Floats, Floats]:
    led = np.isfinite(frame.gap)
    return np.where(led, frame.x + frame.gap, np.inf), np.where(led, frame.leader_speed, 0.0)


@njit(cache=True, error_model="numpy")
def _drive(x, v, theta, rear, leader_speed, desired_speed, seen, fade, weight, log_weights):  # type: ignore[no-untyped-def]
    """Move every ghost by a frame and weigh it."""
    inverse = 1.0 / desired_speed
    for i in range(x.shape[0]):
        for m in range(x.shape[1]):
            a, b, headway, d0, d1 = theta[i, m]
            acceleration = idm.acceleration_of(
                v[i, m], v[i, m] - leader_speed[i], rear[i] - x[i, m], a, idm.closing_weight(a, b), headway, d0, d1, inverse
            )
            x[i, m] += v[i, m] * road.FRAME_STEP
            v[i, m] = max(0.0, v[i, m] + road.FRAME_STEP * acceleration)
            error = abs(x[i, m] - seen[i])
            log_weights[i, m] *= fade
            if error == error:
                log_weights[i, m] -= weight * error
