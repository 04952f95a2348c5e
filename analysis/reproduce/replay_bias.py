"""The effect of replayed followers, which cannot react.

The same modelled vehicles are driven with followers that react.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.evaluation.metrics import summary
from idm_sumo.evaluation.reacting import score_with_reacting
from idm_sumo.recordings import columns as c
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.scenes.windows import LEADER_FROM_LANE, Scenes

from ..closed_loop.populations import PARAMETERS, Drivers

Floats = npt.NDArray[np.float64]

REACTING = (0, 1, 3)  # numbers of followers that react


def replay_bias(drivers: Drivers, sample: int, seed: int, progress: Progress = silent) -> pd.DataFrame:
    """Drive some drivers with replayed and with reacting followers.

    Parameters
    ----------
    drivers : Drivers
        Drivers of the closed loop, with their parameters.
    sample : int
        Largest number of drivers, drawn at random.
    seed : int
        For the draw.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    pandas.DataFrame
        One row a model and number of reacting followers: ``model, reacting, vehicles, collisions`` (at fault),
        ``contacts`` (all), ``struck_from_behind``, ``ade_m, ade_se_m, min_gap_m, mean_followers``. Empty if the
        recording does not hold the surroundings.
    """
    scenes = drivers.scenes
    if scenes.leader_source != LEADER_FROM_LANE:
        return pd.DataFrame()
    rng = np.random.default_rng(seed)
    chosen = np.sort(rng.choice(len(scenes), min(sample, len(scenes)), replace=False))
    some, followers, rows = scenes.subset(chosen), _followers(drivers), []
    models = {"idm_oracle": _own(drivers.table, drivers, some), "idm_pooled": np.tile(drivers.pooled, (len(some), 1))}
    if drivers.predicted is not None:
        models["idm_prediction"] = _own(drivers.predicted, drivers, some)
    for number, (name, theta) in enumerate(models.items()):
        for reacting in REACTING:
            progress("replay bias", number * len(REACTING) + REACTING.index(reacting), len(models) * len(REACTING))
            scores = score_with_reacting(some, theta, followers, reacting=reacting)
            rows.append({"model": name, "reacting": reacting, **_figures(scores)})
    progress("replay bias", 1, 1)
    return pd.DataFrame(rows)


def _own(table: pd.DataFrame, drivers: Drivers, scenes: Scenes) -> Floats:
    """Return the drivers' own parameters, shape ``(vehicles, 5)``.

    Where a fit failed they are the pooled ones.
    """
    row = pd.Index(table[c.VEHICLE]).get_indexer(pd.Index(scenes.vehicle))
    theta = np.tile(np.asarray(drivers.pooled, dtype=np.float64), (len(scenes), 1))
    theta[row >= 0] = table[PARAMETERS].to_numpy(np.float64)[row[row >= 0]]
    return theta


def _followers(drivers: Drivers) -> pd.DataFrame:
    """Return the calibrated parameters of all drivers.

    Others drive by the pooled ones (vehicle 0).
    """
    rest = pd.DataFrame([{c.VEHICLE: 0, **drivers.pooled._asdict()}])
    return pd.concat([drivers.table[[c.VEHICLE, *PARAMETERS]], rest], ignore_index=True)


def _figures(scores: pd.DataFrame) -> dict[str, float]:
    whole = summary(scores)
    figures = {name: whole[name] for name in ("vehicles", "collisions", "contacts", "ade_m", "ade_se_m", "min_gap_m")}
    struck = (scores["contact_edge"] == "rear") & ~scores["at_fault"]
    return figures | {"struck_from_behind": int(struck.sum()), "mean_followers": float(scores["followers"].mean())}


def in_words(table: pd.DataFrame) -> str:
    """Describe the effect of the replayed followers.

    Parameters
    ----------
    table : pandas.DataFrame
        As :func:`replay_bias` returns it.

    Returns
    -------
    str
        A sentence, empty without rows.
    """
    if table.empty:
        return ""
    parts = []
    for model, rows in table.groupby("model", sort=False):
        by = rows.set_index("reacting")
        replayed, reacting = by.loc[0], by.loc[max(REACTING)]
        parts.append(
            f"{model}: {replayed['contacts']:.0f} contacts ({replayed['collisions']:.0f} at fault, "
            f"{replayed['struck_from_behind']:.0f} struck "
            f"from behind) with replayed followers, {reacting['contacts']:.0f} ({reacting['collisions']:.0f}, "
            f"{reacting['struck_from_behind']:.0f}) with {max(REACTING)} that react; "
            f"ADE {replayed['ade_m']:.2f} and {reacting['ade_m']:.2f} m"
        )
    return f"Of {table['vehicles'].iloc[0]:.0f} modelled vehicles: " + "; ".join(parts) + "."
