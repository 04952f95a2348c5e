"""The content of ``diagnosis.json`` from a diagnosis."""

from __future__ import annotations

from typing import Any

import numpy as np

from idm_sumo.diagnosis import CauseFound, Diagnosis, Gain, LawMisfit, RuledOut

GAIN = ("metric", "base", "extended", "difference", "ci95", "vehicles", "held_out")
NOT_MEASURED = Gain("ade_m", 0.0, 0.0, 0.0, (0.0, 0.0), 0)  # zero vehicles: none were held out
Range = tuple[float, float]


def contract(found: Diagnosis) -> dict[str, Any]:
    """Return the content of ``diagnosis.json``.

    A cause without bounds of place or time gets those of all residuals.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    dict
        Content for :func:`analysis.diagnosis.contract.write_diagnosis`.
    """
    whole = extent(found)
    unexplained = [
        {
            "covariate": one.covariate,
            "range": list(one.range),
            "position_m": list(one.position_m or whole["position"]),
            "time_s": list(one.time_s or whole["time"]),
            "p_value": one.p_value,
        }
        for one in found.unexplained
    ]
    gain = found.gain or NOT_MEASURED
    return {
        "verdict": found.verdict,
        "causes": [_cause(cause, whole) for cause in found.causes],
        "unexplained": unexplained,
        "gain": {name: getattr(gain, name) for name in GAIN},
        "ruled_out": [_ruled_out(one) for one in found.ruled_out],
        "without_gain": [_cause(cause, whole) for cause in found.without_gain],
        "untestable": dict(found.untestable),
        "law": found.model.law,
        "law_misfit": _misfit(found.law_misfit),
        "detectable": [{**vars(one), "found": one.share} for one in found.detectable],
    }


def _misfit(misfit: LawMisfit | None) -> dict[str, Any] | None:
    if misfit is None:
        return None
    cell = misfit.surest
    surest = None if cell is None else {
        "x_name": cell.x_name, "x_m_s": list(cell.x_m_s), "gap_m": list(cell.gap_m),
        "acceleration_m_s2": cell.acceleration, "standard_error_m_s2": cell.standard_error, "drivers": cell.drivers,
    }  # fmt: skip
    return {"typical_m_s2": misfit.typical_m_s2, "p_value": misfit.p_value, "surest": surest}


def _cause(cause: CauseFound, whole: dict[str, Range]) -> dict[str, Any]:
    where = None
    if cause.where is not None:
        where = {
            "position_m": list(cause.where.position_m or whole["position"]),
            "time_s": list(cause.where.time_s or whole["time"]),
            "lanes": None if cause.where.lanes is None else list(cause.where.lanes),
        }
    return {
        "name": cause.name,
        "parameters": {
            s: {"value": p.value, "unit": p.unit, "ci95": list(p.ci95)} for s, p in cause.parameters.items()
        },
        "where": where,
        "p_value": cause.p_value,
        "evidence": cause.evidence,
        "one_of": list(cause.one_of),
        "gain": None if cause.gain is None else {name: getattr(cause.gain, name) for name in GAIN},
        "effective_drivers": cause.effective_drivers,
        "at_bound": cause.at_bound,
        "probability": cause.probability,
    }


def _ruled_out(one: RuledOut) -> dict[str, Any]:
    size = one.estimate
    return {
        "name": one.name, "p_value": one.p_value, "value": None if size is None else size.value,
        "ci95": None if size is None else list(size.ci95), "unit": None if size is None else size.unit,
        "confusable_with": list(one.confusable_with), "why": one.why,
    }  # fmt: skip


def extent(found: Diagnosis) -> dict[str, Range]:
    """Return the residuals' ranges of position and time.

    Parameters
    ----------
    found : Diagnosis
        The diagnosis.

    Returns
    -------
    dict of str to (float, float)
        ``position`` (m) and ``time`` (s).
    """
    extent: dict[str, Range] = {}
    for name in ("position", "time"):
        values = found.residuals[name].to_numpy(np.float64) if len(found.residuals) else np.zeros(1)
        extent[name] = (float(values.min()), float(values.max()))
    return extent
