"""The driver table: one row a window, whatever happens."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numba
import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import identifiability, reference, solver, status
from idm_sumo.calibration.chunks import CHUNK, chunks
from idm_sumo.calibration.departures import departures
from idm_sumo.calibration.desired_speed import AUTO, estimate_desired_speeds
from idm_sumo.calibration.kernel import from_search
from idm_sumo.calibration.problem import Problem, only, prepare
from idm_sumo.calibration.search import GAUSS_NEWTON, Search
from idm_sumo.calibration.without_d1 import MEAN_SPEED, mean_speeds
from idm_sumo.models import idm
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.workers import in_processes
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import DESIRED_SPEED
from idm_sumo.simulation.rollout import drive_idm

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
NAMES = list(idm.IDMParameters._fields)

GAUSS_NEWTON_SEARCH = Search()
SLOW_CHUNK = 64  # windows at a time for scipy's solver, which takes a thousand times longer
REFERENCE_STARTS = 10


def calibrate(
    scenes: Scenes,
    *,
    objective: str = "ade",
    loss: str | None = None,
    search: Search = GAUSS_NEWTON_SEARCH,
    desired_speed: npt.ArrayLike | None = None,
    mask: npt.NDArray[np.bool_] | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> pd.DataFrame:
    """Fit the IDM to every window of ``scenes``.

    Parameters
    ----------
    scenes : Scenes
    objective : {"ade", "gap", "speed", "log-gap"}
        What is minimised: the mean over the simulated frames.
    loss : {"squared", "huber", "soft-l1"}, optional
        Of the gap, speed and log-gap errors.
    search : Search
        How the minimum is searched: by ours, or as in the paper by L-BFGS-B.
    desired_speed : array_like, shape (vehicles,) or (), or "auto", optional
        :func:`idm_sumo.calibration.desired_speed.estimate_desired_speeds` says what "auto" takes.
        :math:`v_0` in m/s, by default the speed limit.
    mask : bool, shape (vehicles, frames), optional
        False where a recorded frame is not to count; NaN frames never do.
    jobs : int, optional
        Processes, by joblib's current backend (``joblib.parallel_config(backend="dask")``
        spreads a campaign over machines). By default one, with a thread a core.
    progress : Progress, optional

    Returns
    -------
    pandas.DataFrame
        One row a window, in order: ``period, vehicle, first_frame``; ``a, b, T, d0, d1`` (SI); ``desired_speed_m_s``;
        ``ade_m`` of the full replay at these parameters; ``objective``; ``status`` (see
        :mod:`idm_sumo.calibration.status`); ``at_bound`` and ``undetermined`` (names joined by
        commas, '' for none); ``frames`` that count, ``leader_frames`` among the simulated,
        ``leader_changes``; ``effective_frames``; ``a_sd`` ... ``d1_sd`` (SI): the 95 % interval is
        ``p ± 1.96 sd`` for ``T, d0, d1`` and ``p exp(± 1.96 sd / p)`` for ``a, b``; ``mean_speed_m_s`` of the simulated
        window; when, where and as what the driver enters (:func:`idm_sumo.calibration.departures.departures`).
        Parameters are NaN where there was nothing to fit.

    Raises
    ------
    InputError
        For an unknown objective or loss, or arrays of the wrong shape. Never for what is recorded.
    """
    report, n = progress or silent, len(scenes)
    if isinstance(desired_speed, str):
        if desired_speed != AUTO:
            raise InputError(f"desired_speed: {desired_speed!r} is unknown; give a speed in m/s, or {AUTO!r}")
        desired_speed = estimate_desired_speeds(scenes)
    limit = np.asarray(scenes.road.desired_speed(desired_speed), dtype=np.float64)
    work = partial(_calibrate_chunk, objective=objective, loss=loss, search=search)
    size = CHUNK if search.solver == GAUSS_NEWTON else SLOW_CHUNK
    if jobs is not None and jobs > 1:
        size = max(1, min(size, -(-n // jobs)))
    tasks = (
        (piece, part, limit[piece] if limit.ndim else limit, None if mask is None else mask[piece])
        for piece, part in chunks(scenes, size)
    )
    _check(limit, mask, scenes)
    tables, done = [], 0
    for table in _run(work, tasks, jobs):
        tables.append(table)
        done += len(table)
        report("calibration", done, n)
    return pd.concat(tables, ignore_index=True) if tables else work(slice(0, 0), scenes, limit, mask)


def _check(limit: Floats, mask: npt.NDArray[np.bool_] | None, scenes: Scenes) -> None:
    """Raise for arrays of the wrong shape, before cutting them."""
    if limit.shape not in ((), (len(scenes),)):
        raise InputError(f"desired_speed: shape {limit.shape} is neither () nor that of the {len(scenes)} windows")
    if mask is not None and mask.shape != scenes.x.shape:
        raise InputError(f"mask: shape {mask.shape} is not that of the scenes, {scenes.x.shape} (vehicles, frames)")


def _run(work: partial[pd.DataFrame], tasks: Iterator[tuple[object, ...]], jobs: int | None) -> Iterator[pd.DataFrame]:
    """Yield the chunks' tables in order."""
    if jobs is None or jobs <= 1:
        return (work(*task) for task in tasks)
    threads = max(1, numba.get_num_threads() // jobs)
    # Pieces are small: memory-mapped they would be read-only, which is another type to numba.
    calls = ((threads, work, task) for task in tasks)
    return in_processes(jobs, calls, _with_threads, pre_dispatch="2*n_jobs", max_nbytes=None)


def _with_threads(threads: int, work: partial[pd.DataFrame], task: tuple[object, ...]) -> pd.DataFrame:
    """Work in another process, with its share of the cores."""
    numba.set_num_threads(min(threads, numba.get_num_threads()))
    return work(*task)


def _calibrate_chunk(
    piece: slice, scenes: Scenes, limit: Floats, mask: npt.NDArray[np.bool_] | None, *,
    objective: str, loss: str | None, search: Search,
) -> pd.DataFrame:  # fmt: skip
    """Fit a piece of a campaign; ``scenes`` holds just that."""
    problem = prepare(scenes, objective=objective, loss=loss, desired_speed=limit, mask=mask)
    state = status.statuses(problem, scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1])
    which = np.flatnonzero(~np.isin(state.astype(str), list(status.WITHOUT_FIT)))
    z, value, rested = _fit(problem, which, search, piece.start)
    state[which[~rested & (state[which] == status.OK)]] = status.NOT_CONVERGED
    return _as_table(scenes, problem, state, which, z, value, limit)


def _fit(problem: Problem, which: Integers, search: Search, first: int) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return search coordinates, objective and whether the search rested."""
    if search.solver == GAUSS_NEWTON:
        z, value, rested = solver.fit_all(problem, which, solver.design_of_starts(search.starts or solver.STARTS))
        return z, value, rested
    starts = search.starts or REFERENCE_STARTS
    z, value = reference.l_bfgs_b(problem, which, starts=starts, seed=search.seed, first=first)
    return z, value, np.isfinite(value)


def _as_table(
    scenes: Scenes,
    problem: Problem,
    state: npt.NDArray[np.object_],
    which: Integers,
    z: Floats,
    value: Floats,
    limit: Floats,
) -> pd.DataFrame:
    """Return one row a window, NaN without a fit."""
    n = len(scenes)
    found = identifiability.identify(only(problem, which), z)
    theta = _spread(from_search(z), which, n)
    table = scenes.keys()
    table[NAMES] = theta
    table[DESIRED_SPEED] = problem.desired_speed
    table["ade_m"] = full_ade(scenes, theta, limit, problem.counted)
    table["objective"] = _spread(value, which, n)
    table["status"] = pd.Series(state, dtype=str)
    table["at_bound"] = identifiability.names_of(identifiability.at_bound(theta))
    uncertain = np.zeros((n, len(NAMES)), dtype=np.bool_)
    uncertain[which] = identifiability.undetermined(found, z)
    table["undetermined"] = identifiability.names_of(uncertain)
    table["frames"] = problem.counted.sum(axis=1)
    table["leader_frames"] = status.leader_frames(problem)
    table["leader_changes"] = status.leader_changes(problem)
    table["effective_frames"] = _spread(found.effective_frames, which, n)
    table[[f"{name}_sd" for name in NAMES]] = _spread(found.sd, which, n)
    table[MEAN_SPEED] = mean_speeds(scenes)
    entries = departures(scenes)
    return table.join(entries[[name for name in entries if name not in table]])


def _spread(values: Floats, which: Integers, n: int) -> Floats:
    """Return ``values`` in rows ``which`` of ``n``, NaN elsewhere."""
    result = np.full((n, *values.shape[1:]), np.nan)
    result[which] = values
    return result


def full_ade(
    scenes: Scenes, theta: Floats, desired_speed: npt.ArrayLike | None, counted: npt.ArrayLike = True
) -> Floats:
    """Return the ADE (m) of the full two-dimensional replay.

    It differs from the objective by tenths of a millimetre; by centimetres, or once in thousands of
    drivers decimetres, where a car drives so close to the border between two leaders that the
    millimetres between the two rollouts decide whom it follows.

    Parameters
    ----------
    scenes : Scenes
    theta : float64, shape (windows, 5)
        ``a, b, T, d0, d1`` in SI units.
    desired_speed : array_like, shape (windows,) or (), optional
        m/s; by default the road's speed limit.
    counted : array_like of bool, shape (windows, frames) or ()
        Which simulated frames count; those that were not recorded never do.

    Returns
    -------
    float64, shape (windows,)
        NaN without parameters.
    """
    driven = drive_idm(scenes, np.where(np.isnan(theta), idm.TEXTBOOK, theta), desired_speed=desired_speed)
    frames = slice(scenes.start + 1, scenes.start + scenes.window.horizon + 1)
    off = np.hypot(driven.x[:, 1:] - scenes.x[:, frames], driven.y[:, 1:] - scenes.y[:, frames])
    counted = np.asarray(counted) & np.isfinite(off)
    with np.errstate(invalid="ignore", divide="ignore"):
        ade = np.where(counted, off, 0.0).sum(axis=1) / counted.sum(axis=1)
    return np.asarray(np.where(np.isnan(theta[:, 0]), np.nan, ade))
