r"""Three ways to do without ``d1``, and what each costs.

SUMO's IDM has no :math:`d_1\sqrt{v/v_0}`.

``refit``
    Four parameters calibrated with :math:`d_1 = 0`, under the integration that will drive them.
``linearised``
    :math:`\sqrt v` replaced by its tangent at the driver's mean speed; see :func:`linearise`.
``exact``
    The jam distance set anew every step from outside (:func:`idm_sumo.sumo.export.native.drive_natively`
    with ``d1``): no vehicle type can hold it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import integrators, solver
from idm_sumo.calibration.coordinates import LOWER, from_search
from idm_sumo.calibration.problem import Problem, prepare
from idm_sumo.models import idm
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import desired_speeds_of, parameters_of

Floats = npt.NDArray[np.float64]

REFIT = ("a_refit", "b_refit", "T_refit", "d0_refit")
REFIT_ADE, REFIT_INTEGRATION = "ade_refit_m", "refit_integration"
MEAN_SPEED = "mean_speed_m_s"
SLOWEST = 1.0  # m/s: the tangent at standstill would be vertical
D1 = 4  # place of d1 among the parameters


def linearise(parameters: npt.ArrayLike, mean_speed: npt.ArrayLike, desired_speed: npt.ArrayLike) -> Floats:
    r"""Return parameters without ``d1``, linearised at the mean speed.

    They want the same gap at, and about, the mean speed.

    .. math:: d_0' = d_0 + \tfrac12 d_1\sqrt{\bar v/v_0},\qquad T' = T + \frac{d_1}{2\sqrt{\bar v v_0}}

    Parameters
    ----------
    parameters : array_like, shape (n, 5)
        ``a, b, T, d0, d1``.
    mean_speed, desired_speed : array_like, shape (n,) or ()
        m/s; a mean speed below 1 m/s counts as that.

    Returns
    -------
    float64, shape (n, 5)
        The last column is 0.
    """
    theta = np.array(parameters, dtype=np.float64)
    v, v0 = np.maximum(np.asarray(mean_speed, dtype=np.float64), SLOWEST), np.asarray(desired_speed, dtype=np.float64)
    theta[:, 3] += 0.5 * theta[:, 4] * np.sqrt(v / v0)
    theta[:, 2] += 0.5 * theta[:, 4] / np.sqrt(v * v0)
    theta[:, 4] = 0.0
    return theta


def mean_speeds(scenes: Scenes) -> Floats:
    """Return every driver's recorded mean speed (m/s).

    Parameters
    ----------
    scenes : Scenes

    Returns
    -------
    float64, shape (vehicles,)
        Over the simulated window.
    """
    speed = scenes.speed[:, scenes.start : scenes.start + scenes.window.horizon + 1]
    known = np.isfinite(speed)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, speed, 0.0).sum(axis=1) / known.sum(axis=1))


def refit(
    problem: Problem, parameters: npt.ArrayLike, mean_speed: npt.ArrayLike, *, integration: str = "euler"
) -> tuple[Floats, Floats]:
    """Calibrate four parameters with ``d1 = 0``.

    By the solver of all five (:mod:`idm_sumo.calibration.solver`), which holds ``d1`` and drives by the
    integration. No driver is left worse than without its ``d1``, or linearised.

    Parameters
    ----------
    problem : Problem
        With the objective ``"ade"``.
    parameters : array_like, shape (n, 5)
        The drivers as calibrated.
    mean_speed : array_like, shape (n,)
        m/s.
    integration : {"euler", "ballistic", "paper"}

    Returns
    -------
    parameters : float64, shape (n, 5)
        The last column is 0.
    ade : float64, shape (n,)
        m, NaN where no frame counts.

    Raises
    ------
    InputError
        If there is no such integration.
    """
    theta = integrators.as_parameters(problem, parameters)
    held = integrators.integrated(problem, integration)._replace(moves_d1=0.0)
    designs = solver.design_of_starts(solver.STARTS)
    designs[:, D1] = LOWER[D1]
    z, _, _ = solver.fit_all(held, np.arange(len(theta)), designs)
    linear = np.clip(linearise(theta, mean_speed, problem.desired_speed), idm.LOWER, idm.UPPER)
    ways = np.stack([from_search(z), linear, theta * [1.0, 1.0, 1.0, 1.0, 0.0]])
    ade = np.stack([integrators.ades(problem, way, integration) for way in ways])
    best = np.argmin(np.where(np.isnan(ade), np.inf, ade), axis=0)
    each = np.arange(len(theta))
    return ways[best, each], ade[best, each]


def refit_table(drivers: pd.DataFrame, scenes: Scenes | Sequence[Scenes], *, integration: str = "euler",
                desired_speed: float | None = None) -> pd.DataFrame:  # fmt: skip
    """Return the columns with which drivers can be exported.

    The refit, its ADE and the mean speed.

    Parameters
    ----------
    drivers : pandas.DataFrame
        As :func:`idm_sumo.calibration.table.calibrate` returns them.
    scenes : Scenes or sequence of Scenes
        What they were calibrated to.
    integration : {"euler", "ballistic"}
        What SUMO will use.
    desired_speed : float, optional
        m/s; by default the drivers' own (``desired_speed_m_s``), else the road's speed limit.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame, a_refit, b_refit, T_refit, d0_refit, ade_refit_m,
        refit_integration, mean_speed_m_s``, one row a window of the scenes.

    Raises
    ------
    InputError
        If a window has no driver in the table.
    """
    tables = []
    for part in as_list(scenes):
        theta, speed = parameters_of(drivers, part), mean_speeds(part)
        start = np.where(np.isnan(theta), idm.TEXTBOOK, theta)
        limit = desired_speeds_of(drivers, part, desired_speed)
        fitted, ade = refit(prepare(part, desired_speed=limit), start, speed, integration=integration)
        lost = np.isnan(theta).any(axis=1)  # what could not be calibrated cannot be refitted
        fitted[lost], ade[lost] = np.nan, np.nan
        table = part.keys().assign(**{name: fitted[:, i] for i, name in enumerate(REFIT)})
        tables.append(table.assign(**{REFIT_ADE: ade, REFIT_INTEGRATION: integration, MEAN_SPEED: speed}))
    return pd.concat(tables, ignore_index=True)


def without_d1_costs(drivers: pd.DataFrame, scenes: Scenes | Sequence[Scenes], *, integration: str = "euler",
                       desired_speed: float | None = None) -> pd.DataFrame:  # fmt: skip
    """Return what each way to do without ``d1`` costs.

    Parameters
    ----------
    drivers : pandas.DataFrame
        As :func:`idm_sumo.calibration.table.calibrate` returns them.
    scenes : Scenes or sequence of Scenes
        What they were calibrated to.
    integration : {"euler", "ballistic"}
        What SUMO will use.
    desired_speed : float, optional
        m/s; by default the drivers' own (``desired_speed_m_s``), else the road's speed limit.

    Returns
    -------
    pandas.DataFrame
        ``period, vehicle, first_frame``; ``ade_m`` (five parameters, the paper's
        integration), ``ade_exact_m`` (five parameters, SUMO's), ``ade_refit_m``,
        ``ade_linearised_m`` and ``ade_dropped_m`` (``d1`` left out without a replacement), in
        metres over the calibration window, by the compiled kernel;
        :mod:`idm_sumo.sumo.export.parity` proves that SUMO drives the same.

    Raises
    ------
    InputError
        If a window has no driver in the table.
    """
    fitted = drivers
    if not refitted_for(drivers, integration):
        fitted = refit_table(drivers, scenes, integration=integration, desired_speed=desired_speed)
    tables, first = [], 0
    for part in as_list(scenes):
        theta = parameters_of(drivers, part)
        problem = prepare(part, desired_speed=desired_speeds_of(drivers, part, desired_speed))
        lost = np.isnan(theta).any(axis=1)
        ways = {
            "ade_m": (theta, "paper"), "ade_exact_m": (theta, integration),
            "ade_linearised_m": (linearise(theta, mean_speeds(part), problem.desired_speed), integration),
            "ade_dropped_m": (theta * [1.0, 1.0, 1.0, 1.0, 0.0], integration),
        }  # fmt: skip
        ade = {name: np.where(lost, np.nan, integrators.ades(problem, *way)) for name, way in ways.items()}
        ade[REFIT_ADE] = fitted[REFIT_ADE].to_numpy()[first : first + len(part)]
        tables.append(part.keys().assign(**ade))
        first += len(part)
    return pd.concat(tables, ignore_index=True)


def refitted_for(drivers: pd.DataFrame, integration: str) -> bool:
    """Return whether drivers hold refits for an integration.

    Parameters
    ----------
    drivers : pandas.DataFrame
    integration : {"euler", "ballistic"}

    Returns
    -------
    bool
    """
    return REFIT_INTEGRATION in drivers and bool((drivers[REFIT_INTEGRATION] == integration).all())


def cost_summary(costs: pd.DataFrame) -> pd.DataFrame:
    """Return one row a choice: its ADE and its cost.

    Parameters
    ----------
    costs : pandas.DataFrame
        Of :func:`without_d1_costs`.

    Returns
    -------
    pandas.DataFrame
        ``choice``, mean and median ADE (m), the mean difference from five parameters, its
        90th percentile, and the number of drivers.
    """
    names = [name for name in costs.columns if name.startswith("ade_")]
    extra = costs[names].sub(costs["ade_m"], axis=0)
    return pd.DataFrame({
        "choice": [name.removeprefix("ade_").removesuffix("m").removesuffix("_") or "calibrated" for name in names],
        "ade_m": costs[names].mean().to_numpy(), "ade_median_m": costs[names].median().to_numpy(),
        "cost_m": extra.mean().to_numpy(), "cost_p90_m": extra.quantile(0.9).to_numpy(),
        "drivers": int(costs["ade_m"].notna().sum()),
    })  # fmt: skip


def as_list(scenes: Scenes | Sequence[Scenes]) -> list[Scenes]:
    """Return one or several periods' scenes as a list.

    Parameters
    ----------
    scenes : Scenes or sequence of Scenes

    Returns
    -------
    list of Scenes
    """
    return [scenes] if isinstance(scenes, Scenes) else list(scenes)
