"""The schema of ``diagnosis.json``, checked before it is written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Interval = tuple[Number, Number]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Parameter(_Part):
    """One parameter of a cause, with its 95 % interval.

    Attributes
    ----------
    value : float
        Estimate in SI units.
    unit : str
        Its unit.
    ci95 : (float, float)
        Ends of the interval.
    """

    value: Number
    unit: str
    ci95: Interval

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.ci95[0] > self.ci95[1]:
            raise ValueError(f"ci95 {self.ci95} is not in order")
        return self


class Where(_Part):
    """A part of the road and of the recording.

    Attributes
    ----------
    position_m, time_s : (float, float) or None
        Intervals of position and time.
    lanes : list of int or None
        Lane numbers as in the recording; None for all.
    """

    position_m: Interval | None = None
    time_s: Interval | None = None
    lanes: list[int] | None = None


class Gain(_Part):
    """The gain of the extended model on held-out drivers."""

    metric: Literal["ade_m"]
    base: Number
    extended: Number
    difference: Number
    ci95: Interval
    vehicles: Annotated[int, Field(ge=0)]
    held_out: Literal[True]


class Share(Gain):
    """The share of a driver's error that one cause spares."""

    metric: Literal["share_of_ade"]  # type: ignore[assignment]


class Cause(_Part):
    """A cause: its size, significance and gain.

    Attributes
    ----------
    one_of : list of str
        Effects from which these data cannot tell it.
    gain : Share or None
        Share of a driver's error that it spares beside the other causes, on drivers that took no part in its size.
    effective_drivers : float
        On how many drivers it rests.
    at_bound : bool
        Whether its magnitude is at a bound of what is searched.
    probability : float
        That it is this effect and neither another one nor nothing.
    """

    name: str
    parameters: dict[str, Parameter]
    where: Where | None
    p_value: Probability
    evidence: Annotated[str, Field(min_length=1)]
    one_of: list[str]
    gain: Share | None
    effective_drivers: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    at_bound: bool
    probability: Probability


class Unexplained(_Part):
    """A pattern that no cause of the catalogue explains."""

    covariate: str
    range: Interval
    position_m: Interval | None = None
    time_s: Interval | None = None
    p_value: Probability


class RuledOut(_Part):
    """A tested hypothesis that was not kept, and its size."""

    name: str
    p_value: Probability
    value: Number | None
    ci95: Interval | None
    unit: str | None
    confusable_with: list[str]
    why: str


class Detectable(_Part):
    """An effect's size, injected into the recording's own followers.

    Attributes
    ----------
    found : float
        Share of the injections in which it stood out.
    of : int
        Number of injections.
    """

    name: str
    symbol: str
    unit: str
    size: Number
    found: Probability
    of: Annotated[int, Field(ge=1)]


class MisfitCell(_Part):
    """What the law lacks in a range of states."""

    x_name: Literal["speed", "approach_rate"]
    x_m_s: Interval
    gap_m: Interval
    acceleration_m_s2: Number
    standard_error_m_s2: Number
    drivers: Annotated[int, Field(ge=0)]


class LawMisfit(_Part):
    """The shape that the law lacks.

    Attributes
    ----------
    typical_m_s2 : float
        Typical size of its coefficients; zero if the law lacks nothing.
    surest : MisfitCell or None
        Where it is most standard errors.
    """

    typical_m_s2: Number
    p_value: Probability
    surest: MisfitCell | None


class Diagnosis(_Part):
    """The content of ``diagnosis.json``.

    ``law`` is the car-following law to which the causes are added.
    """

    verdict: Literal["named", "none", "unknown"]
    causes: list[Cause]
    unexplained: list[Unexplained]
    gain: Gain
    ruled_out: list[RuledOut]
    without_gain: list[Cause]
    untestable: dict[str, str]
    law: str
    law_misfit: LawMisfit | None
    detectable: list[Detectable]

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if (self.verdict == "named") != bool(self.causes):
            raise ValueError(f"verdict {self.verdict!r} with {len(self.causes)} causes")
        if self.verdict == "unknown" and not self.unexplained:
            raise ValueError("verdict 'unknown' needs an entry in `unexplained`")
        return self


def schema() -> dict[str, Any]:
    """Return the JSON schema of ``diagnosis.json``.

    Returns
    -------
    dict
        As it is kept beside this module, in ``diagnosis.schema.json``.
    """
    return Diagnosis.model_json_schema()


def write_diagnosis(path: Path, content: dict[str, Any]) -> None:
    """Check the content against the schema and write it.

    Parameters
    ----------
    path : Path
        JSON file to write.
    content : dict
        As :func:`analysis.diagnosis.report.contract` returns it.

    Raises
    ------
    pydantic.ValidationError
        If the content does not fit the schema, which is a defect of this program.
    """
    checked = Diagnosis.model_validate(content).model_dump(mode="json")
    path.write_text(json.dumps(checked, indent=2, allow_nan=False) + "\n", encoding="utf-8")
