"""Pages of a data set of diagnoses: one of all recordings, and a plain one of each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from idm_sumo.models.effects import format_quantity
from idm_sumo.runtime.text import ranges

from ..page.page import filled, warning_of
from .dataset import PAGE
from .summary import in_words

VERDICTS = {
    "named": "causes are named",
    "none": "nothing was found that these data could show",
    "unknown": "something is there that no cause of the catalogue explains",
}


def page_of_one(name: str, content: Mapping[str, Any], *, is_measured: bool) -> str:
    """Return the page of one recording.

    Parameters
    ----------
    name : str
        Of the recording.
    content : mapping
        Its diagnosis, as of ``diagnosis.json``.
    is_measured : bool
        Whether the recording is of real traffic.
    """
    return filled(
        "many/recording.html.j2",
        title=f"{name} diagnosed",
        not_measured=warning_of([] if is_measured else [name]),
        verdict=VERDICTS[content["verdict"]],
        content=content,
        gain=_gain(content["gain"]),
        causes=_causes_table(content["causes"]),
        without_gain=_causes_table(content["without_gain"]),
        evidence=[f"{one['name']}: {one['evidence']}" for one in content["causes"]],
        unexplained=[_unexplained(one) for one in content["unexplained"]],
        ruled_out=pd.DataFrame(
            [{"effect": one["name"], "p-value": one["p_value"], "why": one["why"]} for one in content["ruled_out"]]
        ),
        page=PAGE,
    )


def page_of_all(rows: pd.DataFrame, summary: dict[str, Any], contents: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the page of a data set of diagnoses.

    Parameters
    ----------
    rows : pandas.DataFrame
        One row a recording, as the data set keeps them.
    summary : dict
        Of :func:`analysis.many.summary.summary_of`.
    contents : mapping of str to mapping
        Of each diagnosed recording, its diagnosis.
    """
    done = [row for row in rows.to_dict("records") if row["recording"] in contents and row["status"] == "done"]
    count = len(done)
    return filled(
        "many/report.html.j2",
        title=f"{count} recording{'s' * (count != 1)} diagnosed",
        not_measured=warning_of([str(row["recording"]) for row in done if row.get("measured") is False]),
        answer=in_words(summary),
        causes=_sizes_table(summary.get("causes", {})),
        recordings=[_listed(row, contents[str(row["recording"])]) for row in done],
        failed=rows.loc[rows["status"] == "failed", ["file", "reason"]],
        page=PAGE,
    )


def _listed(row: Mapping[str, Any], content: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the list of recordings says of one."""
    return {
        "name": row["recording"], "file": row["file"], "verdict": content["verdict"], "law": content["law"],
        "drivers": row["drivers"], "gain": _gain(content["gain"]),
        "causes": [f"{one['name']}: {_sizes(one['parameters'])}" for one in content["causes"]],
        "unexplained": [_unexplained(one) for one in content["unexplained"]],
    }  # fmt: skip


def _sizes_table(causes: Mapping[str, Any]) -> pd.DataFrame:
    """Return one row a parameter of each cause that was named: how often, and its size over recordings."""
    rows = []
    for name, cause in causes.items():
        often = f"{cause['named']} of {cause['of']}"
        how = {"cause": name, "named in": often, "without gain in": cause["without_gain"]}
        for symbol, size in (cause["sizes"] or {"–": None}).items():
            rows.append({**how, "parameter": symbol, **_over_recordings(size)})
    return pd.DataFrame(rows)


def _over_recordings(size: Mapping[str, Any] | None) -> dict[str, Any]:
    if size is None:
        size = {"value": np.nan, "unit": ""}
    low, high = size.get("ci95", (np.nan, np.nan))
    agreement = size.get("agreement")
    return {
        "mean": size["value"], "95 %, from": low, "to": high, "unit": size["unit"],
        "between recordings, standard deviation": size.get("between_sd", np.nan),
        "agreement": np.nan if agreement is None else agreement,
    }  # fmt: skip


def _causes_table(causes: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
    """Return one row a cause of a recording."""
    return pd.DataFrame([
        {
            "cause": one["name"], "size (95 % interval)": _sizes(one["parameters"]), "where": _where(one["where"]),
            "p-value": one["p_value"], "rests on drivers": one["effective_drivers"],
            "not to be told from": ", ".join(one["one_of"]) or "–",
        }
        for one in causes
    ])  # fmt: skip


def _sizes(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a cause's sizes with their intervals."""
    return ", ".join(
        f"{symbol} = {format_quantity(one['value'], one['unit'])} ({_interval(one['ci95'])})"
        for symbol, one in parameters.items()
    )


def _where(where: Mapping[str, Any] | None) -> str:
    if where is None:
        return "everywhere"
    parts = [
        f"{_interval(where[name])} {unit}" for name, unit in (("position_m", "m"), ("time_s", "s")) if where.get(name)
    ]
    if where.get("lanes"):
        parts.append(f"lanes {ranges(where['lanes'])}")
    return ", ".join(parts) or "everywhere"


def _unexplained(one: Mapping[str, Any]) -> str:
    return f"along {one['covariate']} from {_interval(one['range'])}, p = {one['p_value']:.2g}"


def _gain(gain: Mapping[str, Any]) -> str:
    """Return what the extended model spares held-out drivers."""
    if not gain["vehicles"]:
        return "not measured"
    return f"{gain['difference']:.3g} m ({_interval(gain['ci95'])}), of {gain['base']:.3g} m"


def _interval(ends: Iterable[float]) -> str:
    return " to ".join(f"{end:.3g}" for end in ends)
