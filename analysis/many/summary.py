"""One summary across recordings: drivers, laws, causes and their sizes, and how well recordings agree."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.diagnosis.result import Z95
from idm_sumo.simulation.driver_parameters import PARAMETERS

UNITS = {"a": "m/s²", "b": "m/s²", "T": "s", "d0": "m", "d1": "m"}


def pooled(values: npt.ArrayLike, errors: npt.ArrayLike) -> dict[str, Any] | None:
    r"""Return the estimate of several studies together.

    Each study's true value is its own, drawn about a common mean (DerSimonian and Laird, 1986). With the weights
    :math:`w_i = 1/s_i^2` and :math:`Q = \sum w_i (y_i - \bar y)^2`, the variance between studies is
    :math:`\tau^2 = \max(0, (Q - k + 1) / (\sum w_i - \sum w_i^2 / \sum w_i))`, and the mean is weighted by
    :math:`1/(s_i^2 + \tau^2)`.

    Parameters
    ----------
    values, errors : array_like, shape (studies,)
        Estimates and their standard errors; those without a positive error are left out.

    Returns
    -------
    dict or None
        ``value``, ``ci95``, the standard deviation ``between_sd``, the number of ``recordings``, and ``agreement``:
        the share of the variance of the estimates that is chance (1 less Higgins' :math:`I^2`; 1 if the recordings
        differ no more than their errors let expect), None for one. None without an estimate.
    """
    y, s = np.asarray(values, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    known = np.isfinite(y) & np.isfinite(s) & (s > 0.0)
    y, w = y[known], 1.0 / s[known] ** 2
    if not len(y):
        return None
    q, spare = float((w * (y - np.average(y, weights=w)) ** 2).sum()), len(y) - 1
    between = max(0.0, (q - spare) / (w.sum() - (w**2).sum() / w.sum())) if spare else 0.0
    w = 1.0 / (1.0 / w + between)
    mean, error = float(np.average(y, weights=w)), float(1.0 / np.sqrt(w.sum()))
    return {
        "value": mean, "ci95": [mean - Z95 * error, mean + Z95 * error], "between_sd": float(np.sqrt(between)),
        "recordings": len(y), "agreement": (min(1.0, spare / q) if q > 0.0 else 1.0) if spare else None,
    }  # fmt: skip


def summary_of(rows: pd.DataFrame, diagnoses: Iterable[dict[str, Any]] = ()) -> dict[str, Any]:
    """Return what many recordings say together.

    Parameters
    ----------
    rows : pandas.DataFrame
        One row a recording, as the data set keeps them.
    diagnoses : iterable of dict
        Of the diagnosed recordings, as of ``diagnosis.json``.

    Returns
    -------
    dict
        As JSON can hold it.
    """
    done = rows[rows["status"] == "done"]
    found: dict[str, Any] = {
        "recordings": {"done": len(done), "failed": int((rows["status"] == "failed").sum())},
        "drivers": int(done["drivers"].sum()) if "drivers" in done else 0,
        "vehicle_seconds": round(float(done["vehicle_seconds"].sum()), 1) if "vehicle_seconds" in done else 0.0,
    }
    if "a_sd" in done:
        found["parameters"] = _parameters(done)
    if contents := list(diagnoses):
        found |= _diagnosed(contents)
    return found


def _parameters(done: pd.DataFrame) -> dict[str, Any]:
    """Return each parameter's mean over drivers, as the recordings tell it together."""
    told = {}
    for name in PARAMETERS:
        estimate = pooled(done[name], done[f"{name}_sd"] / np.sqrt(done["ok"].clip(lower=1)))
        if estimate is not None:
            told[name] = {"unit": UNITS[name], **estimate}
    return told


def _diagnosed(contents: list[dict[str, Any]]) -> dict[str, Any]:
    """Return verdicts, laws, causes and the gain of diagnoses together."""
    gains = [one["gain"] for one in contents if one["gain"]["vehicles"]]
    return {
        "verdicts": _counted(one["verdict"] for one in contents),
        "laws": _counted(one["law"] for one in contents),
        "causes": _causes(contents),
        "gain_m": pooled([one["difference"] for one in gains], [_error(one["ci95"]) for one in gains]),
    }


def _causes(contents: list[dict[str, Any]]) -> dict[str, Any]:
    """Return of each cause how often it was named, and its sizes."""
    named = [cause for one in contents for cause in one["causes"]]
    without = Counter(cause["name"] for one in contents for cause in one["without_gain"])
    counts = Counter(cause["name"] for cause in named)
    told: dict[str, Any] = {}
    for name in sorted({*counts, *without}, key=lambda one: (-counts[one], -without[one], one)):
        sizes: dict[str, list[dict[str, Any]]] = {}
        for cause in named:
            if cause["name"] == name:
                for symbol, size in cause["parameters"].items():
                    sizes.setdefault(symbol, []).append(size)
        told[name] = {
            "named": counts[name], "without_gain": without[name], "of": len(contents),
            "sizes": {symbol: _size(each) for symbol, each in sizes.items()},
        }  # fmt: skip
    return told


def _size(sizes: list[dict[str, Any]]) -> dict[str, Any]:
    """Return sizes of several recordings as one; without intervals there is only their mean."""
    values = [one["value"] for one in sizes]
    together = pooled(values, [_error(one["ci95"]) for one in sizes])
    return {"unit": sizes[0]["unit"], **(together or {"value": float(np.mean(values)), "recordings": len(values)})}


def _error(interval: list[float]) -> float:
    """Return the standard error that a 95 % interval amounts to."""
    return (interval[1] - interval[0]) / (2.0 * Z95)


def _counted(values: Iterable[str]) -> dict[str, int]:
    return dict(Counter(values).most_common())


def in_words(summary: dict[str, Any]) -> list[str]:
    """Return a summary as lines for a terminal.

    Parameters
    ----------
    summary : dict
        Of :func:`summary_of`.
    """
    lines = [f"{summary['recordings']['done']} recordings, {summary['drivers']:,} drivers, "
             f"{summary['vehicle_seconds']:,.0f} vehicle-seconds"]  # fmt: skip
    lines += [f"mean {name}: {_told(one)}" for name, one in summary.get("parameters", {}).items()]
    for title in ("verdicts", "laws"):
        if counts := summary.get(title):
            lines.append(f"{title}: " + ", ".join(f"{name} {count}" for name, count in counts.items()))
    for name, cause in summary.get("causes", {}).items():
        sizes = "".join(f"; {symbol} {_told(one)}" for symbol, one in cause["sizes"].items())
        rest = f", without gain in {cause['without_gain']}" if cause["without_gain"] else ""
        lines.append(f"{name}: named in {cause['named']} of {cause['of']}{rest}{sizes}")
    if gain := summary.get("gain_m"):
        lines.append(f"gain on held-out drivers: {_told({'unit': 'm', **gain})}")
    return lines


def _told(one: dict[str, Any]) -> str:
    said = f"{one['value']:.3g} {one['unit']}"
    if "ci95" in one:
        said += f" (95 %: {one['ci95'][0]:.3g} to {one['ci95'][1]:.3g}"
        said += f"; agreement {one['agreement']:.0%})" if one["agreement"] is not None else ")"
    return said
