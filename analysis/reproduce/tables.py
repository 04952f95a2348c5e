"""The paper's tables, and further rows."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration.identifiability import along_flat_direction
from idm_sumo.calibration.kernel import to_search
from idm_sumo.calibration.problem import prepare as calibration_problem
from idm_sumo.evaluation.metrics import summary
from idm_sumo.models.idm import LOWER, UPPER, IDMParameters
from idm_sumo.prediction.driving_code import FEATURES
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import Window
from idm_sumo.simulation.rollout import Trajectories, drive_constant_velocity

from . import paper
from .drivers import Drive, Drivers
from .prediction.share import drive_by
from .study import Study, predictions

METHODS = (
    "idm_average", "idm_prediction", "idm_rollout", "idm_residual", "idm_first_gap", "idm_pooled", "idm_typical",
    "idm_hierarchical", "idm_oracle",
)  # fmt: skip
SHARES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.4)  # moves along the flattest direction, in ranges between the bounds
FEATURE_SETS = tuple(chosen for size in (1, 2, 3) for chosen in combinations(FEATURES, size))


def methods(
    study: Study, drive: Drive, progress: Progress = silent
) -> tuple[pd.DataFrame, dict[str, list[Trajectories]], dict[str, pd.DataFrame]]:
    """Drive the test drivers by every method.

    Parameters
    ----------
    study : Study
        Training and test drivers.
    drive : callable
        Drives scenes by parameters. The residual, which no parameters hold, is always driven by the kernel.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    table : pandas.DataFrame
        One row a method: ``method, ade_m, ade_se_m, fde_m, fde_se_m, collisions, vehicles`` and further metrics.
    trajectories : dict of str to list of Trajectories
        By method, one a period.
    scores : dict of str to pandas.DataFrame
        By method, one row a window.
    """
    progress("driving the test drivers", 0, 2)
    driven = {"constant_velocity": [drive_constant_velocity(scenes) for scenes in study.test.scenes]}
    driven |= study.test.drive_each(predictions(study), drive)
    driven["idm_residual"] = drive_by(study.learned.residual, study.test)
    driven = {name: driven[name] for name in ("constant_velocity", *METHODS)}
    progress("driving the test drivers", 1, 2)
    scores = {name: study.test.score(t) for name, t in driven.items()}
    progress("driving the test drivers", 2, 2)
    table = pd.DataFrame([{"method": name, **summary(score)} for name, score in scores.items()])
    return table, driven, scores


def features(study: Study) -> pd.DataFrame:
    """Return the accuracy for each combination of features.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    pandas.DataFrame
        One row a combination of the driving code's features, then two with the other reading of ``nu``: the paper
        calls it relative velocity where it motivates it, and velocity where it computes it.
    """
    codes = study.test.code(study.settings.observed)
    k, other = study.settings.neighbours, "own" if study.settings.code_speed == "relative" else "relative"
    cases: list[tuple[str, tuple[str, ...], str]] = [
        ("+".join(chosen), chosen, study.settings.code_speed) for chosen in FEATURE_SETS
    ]
    cases += [("+".join(chosen).replace("nu", f"nu_{other}"), chosen, other) for chosen in (("nu",), tuple(FEATURES))]
    rows = [(name, study.neighbours(codes, k, chosen, speed)) for name, chosen, speed in cases]
    return pd.DataFrame([{"features": name, **_score(study.test, theta)} for name, theta in rows])


def neighbours(study: Study) -> pd.DataFrame:
    """Return the accuracy for each number of neighbours.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    pandas.DataFrame
        One row a number ``k``.
    """
    codes = study.test.code(study.settings.observed)
    most = len(study.library[1])
    counts = [k for k in study.settings.neighbour_counts if k <= most]
    return pd.DataFrame([{"k": k, **_score(study.test, study.neighbours(codes, k))} for k in counts])


def frame_window(study: Study) -> Window:
    """Return the window for the largest number of observed frames.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    Window
        All rows of :func:`frames` start at its common start.
    """
    s = study.settings
    return Window(observed=max(s.frame_counts), horizon=s.horizon, from_entry=s.rollout_start == "entry")


def frames(study: Study, test: Drivers) -> pd.DataFrame:
    """Return the accuracy for each number of observed frames.

    Every row starts at the same moment, after the largest number of frames, so that only the
    observation differs.

    Parameters
    ----------
    study : Study
        Training and test drivers.
    test : Drivers
        Test drivers with windows of :func:`frame_window`.

    Returns
    -------
    pandas.DataFrame
        One row a number of frames.
    """
    s = study.settings
    rows = []
    for count in s.frame_counts:
        theta = study.neighbours(test.code(count), s.neighbours)
        rows.append({"frames": count, **_score(test, theta)})
    return pd.DataFrame(rows)


def _score(drivers: Drivers, theta: npt.NDArray[np.float64]) -> dict[str, float]:
    return dict(summary(drivers.score(drivers.drive(theta))))


def beside_paper(
    table: pd.DataFrame, printed: dict[str, paper.Printed] | dict[int, paper.Printed], key: str
) -> pd.DataFrame:
    """Return a table with the paper's numbers added.

    Parameters
    ----------
    table : pandas.DataFrame
        Results of this run.
    printed : dict
        Rows of the paper's table.
    key : str
        Column whose values are the keys of ``printed``.

    Returns
    -------
    pandas.DataFrame
        With the paper's ADE and FDE, their standard errors, and collisions, NaN where it has none.
    """
    ours = table.copy()
    for name in ("ade_m", "ade_se_m", "fde_m", "fde_se_m", "collisions"):
        ours[f"paper_{name}"] = [getattr(printed[k], name) if k in printed else np.nan for k in table[key]]
    return ours


def flat_directions(study: Study) -> pd.DataFrame:
    """Return the cost of moves along each oracle's flattest direction.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    pandas.DataFrame
        See :func:`idm_sumo.calibration.identifiability.along_flat_direction`.
    """
    tables = []
    for scenes, theta in zip(study.test.scenes, study.test.parts(predictions(study)["idm_oracle"]), strict=True):
        problem = calibration_problem(scenes, desired_speed=study.settings.desired_speed)
        tables.append(along_flat_direction(problem, to_search(theta), SHARES))
    return pd.concat(tables, ignore_index=True)


def at_bound(study: Study) -> pd.DataFrame:
    """Return how often parameters are at a bound or undetermined.

    Parameters
    ----------
    study : Study
        Training and test drivers.

    Returns
    -------
    pandas.DataFrame
        One row a parameter, over all oracle fits.
    """
    fits = pd.concat([study.train_fits, study.test_fits])
    hits, vague = (fits[name].fillna("").str.split(",") for name in ("at_bound", "undetermined"))
    rows = []
    for name in IDMParameters._fields:
        values = fits[name].dropna()
        rows.append(
            {
                "parameter": name,
                "lower bound": getattr(LOWER, name),
                "upper bound": getattr(UPPER, name),
                "share at a bound": float(hits.map(lambda found, name=name: name in found).mean()),
                "share not determined": float(vague.map(lambda found, name=name: name in found).mean()),
                "median": float(values.median()),
                "mean": float(values.mean()),
                "pooled": getattr(study.pooled, name),
            }
        )
    return pd.DataFrame(rows)
