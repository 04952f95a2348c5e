"""One driver of an extended model, as near to its recording as can be."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from idm_sumo.models.effects import ExtendedModel
from idm_sumo.models.idm import LOWER, UPPER
from idm_sumo.recordings.recording import Recording
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.extended_rollout import drive_extended
from idm_sumo.simulation.surroundings import RecordedDrivers, TrafficDetails, what_is_seen


def nearest(
    scenes: Scenes, recording: Recording, model: ExtendedModel, start: npt.NDArray[np.float64], *, refit: bool
) -> tuple[npt.NDArray[np.float64], ExtendedModel]:
    """Return the parameters and the model nearest to the driver.

    Parameters are fitted anew if asked. A model with causes that only some drivers have is tried with and
    without them.

    Parameters
    ----------
    scenes : Scenes
        One driver, in one window or several.
    recording : Recording
        Its period.
    model : ExtendedModel
    start : ndarray, shape (1, 5)
        Parameters to begin with.
    refit : bool, keyword-only
        Whether to fit the parameters anew.

    Returns
    -------
    theta : ndarray, shape (1, 5)
    model : ExtendedModel
    """
    kinds = [model] if model.share == 1.0 else [model, model.without_partial_causes()]
    if len(kinds) == 1 and not refit:
        return start, model
    seen = what_is_seen(recording, scenes)
    each = [(fit_extended(scenes, seen, one, start) if refit else start, one) for one in kinds]
    return min(each, key=lambda one: _ade(_off(scenes, seen, one[1], one[0])))


def _off(
    scenes: Scenes, seen: tuple[TrafficDetails, RecordedDrivers], model: ExtendedModel, theta: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Return the distance (m) from the recording, frame by frame of every window."""
    driven = drive_extended(scenes, seen, model, theta, desired_speed=model.desired_speed)
    return np.asarray(driven.x - scenes.x[:, scenes.start : scenes.start + scenes.window.horizon + 1]).ravel()


def _ade(off: npt.NDArray[np.float64]) -> float:
    return float(np.abs(off).mean())


def fit_extended(
    scenes: Scenes, seen: tuple[TrafficDetails, RecordedDrivers], model: ExtendedModel, start: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Fit one driver of an extended model to its recording.

    Parameters
    ----------
    scenes : Scenes
        One driver, in one window or several.
    seen : (TrafficDetails, RecordedDrivers)
        What it sees.
    model : ExtendedModel
    start : ndarray, shape (1, 5)
        Where the fit begins; it also begins at the model's own parameters.

    Returns
    -------
    ndarray, shape (1, 5)
        ``a, b, T, d0, d1``.
    """
    lower, upper = np.array(LOWER), np.array(UPPER)

    def off(theta: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return _off(scenes, seen, model, theta)

    found = []
    for begin in (start[0], np.array(model.parameters)):
        inside = np.clip(begin, lower + 1e-6, upper - 1e-6)
        # Nearly the sum of distances, as the plain fit: squares would favour the end of the horizon.
        fit = least_squares(
            off, inside, bounds=(lower, upper), x_scale=upper - lower, loss="soft_l1", f_scale=0.05, max_nfev=200
        )
        found += [inside, fit.x]
    return np.asarray(min(found, key=lambda theta: _ade(off(theta))))[None]
