"""A car-following law with named causes, kept in a file.

Replay, export and closed loop read the file that a diagnosis writes.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from idm_sumo.models import laws
from idm_sumo.models.effects import slots
from idm_sumo.models.effects.catalogue import BY_NAME
from idm_sumo.models.effects.record import format_quantity
from idm_sumo.models.idm import UPPER, IDMParameters
from idm_sumo.runtime.errors import InputError, shown
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.inputs import parse_json, read_text
from idm_sumo.runtime.limits import DESIRED_SPEED

FORMAT = "idm-sumo extended model 1"
REACTIONS = (0.01, 10.0)  # s
WIDENED = 5.0  # times the upper bounds of calibration that a parameter of another law may have
MOST_LANES = 16  # no recorded road has more
GOLDEN = (5**0.5 - 1.0) / 2.0  # golden ratio; fractional parts of its multiples fill the unit interval evenly


@dataclass(frozen=True)
class Cause:
    """An effect that was found, with its magnitudes.

    Attributes
    ----------
    name : str
        Name in the catalogue.
    values : dict of str to float
        Parameters by symbol; a symbol left out takes its typical value.
    lanes : tuple of int
        The lanes in which it acts; empty for all.
    share : float
        Share of the drivers that have it.
    """

    name: str
    values: dict[str, float]
    lanes: tuple[int, ...] = ()
    share: float = 1.0

    def fill(self, m: npt.NDArray[np.float64]) -> None:
        """Write the values into a vector of magnitudes.

        Parameters
        ----------
        m : float64, shape (slots.COUNT,)
            Changed in place.
        """
        for parameter in BY_NAME[self.name].named_by(self.values):
            m[parameter.slot] = self.values.get(parameter.symbol, parameter.typical)


@dataclass(frozen=True)
class ExtendedModel:
    """A car-following law, its parameters and the causes found.

    Attributes
    ----------
    parameters : IDMParameters
        Of the median driver, refitted with the causes.
    desired_speed : float
        Desired speed (m/s).
    causes : tuple of Cause
        The named causes.
    source : str
        The recording it was found in.
    law : str
        The car-following law, of :data:`idm_sumo.models.laws.NAMES`, to which the parameters belong.
    reaction : float
        Time within which drivers of Krauss's law reach their safe speed (s).
    drivers : str
        Name of the table of each driver's own parameters, refitted with the causes, beside the model's file;
        empty if there is none.

    See Also
    --------
    idm_sumo.models.effects.extended_acceleration : the acceleration of a driver of the model.
    """

    parameters: IDMParameters
    desired_speed: float
    causes: tuple[Cause, ...] = field(default=())
    source: str = ""
    law: str = laws.NAMES[laws.IDM]
    reaction: float = laws.REACTION
    drivers: str = ""

    @property
    def is_idm(self) -> bool:
        """Whether the law is the IDM."""
        return self.law == laws.NAMES[laws.IDM]

    @property
    def share(self) -> float:
        """Share of the drivers that have every cause."""
        return min((cause.share for cause in self.causes), default=1.0)

    def without_partial_causes(self) -> ExtendedModel:
        """Return the model of drivers without the causes of some.

        Returns
        -------
        ExtendedModel
            With those causes only that all drivers have.
        """
        return replace(self, causes=tuple(cause for cause in self.causes if cause.share == 1.0))

    def has_partial_causes(self, vehicles: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return which vehicles are assumed to have every cause.

        For use where no table says which drivers have them. The choice depends on the number only and is
        spread evenly: multiples of the golden ratio fill the unit interval evenly.

        Parameters
        ----------
        vehicles : array_like
            Vehicle numbers.

        Returns
        -------
        bool array, shape of ``vehicles``
            True for about the share of the model.
        """
        return np.asarray(np.modf(np.asarray(vehicles, dtype=np.float64) * GOLDEN)[0] < self.share)

    def magnitudes(self, lane: int = 0) -> npt.NDArray[np.float64]:
        """Return the vector of magnitudes in a lane.

        Parameters
        ----------
        lane : int
            Lane number; 0 ignores the lanes of the causes.

        Returns
        -------
        float64, shape (slots.COUNT,)
            Of a driver with every cause.
        """
        m = np.zeros(slots.COUNT)
        m[slots.LAW], m[slots.REACTION_CHANGE] = laws.NAMES.index(self.law), self.reaction - laws.REACTION
        for cause in self.causes:
            if not cause.lanes or lane == 0 or lane in cause.lanes:
                cause.fill(m)
        return m

    def magnitudes_by_lane(self, lanes: int) -> npt.NDArray[np.float64]:
        """Return the magnitudes for each lane number.

        Parameters
        ----------
        lanes : int
            Largest lane number.

        Returns
        -------
        float64, shape (lanes + 1, slots.COUNT)
            Row 0 ignores the lanes of the causes.
        """
        return np.stack([self.magnitudes(lane) for lane in range(lanes + 1)])

    def to_json(self) -> str:
        """Return the model as text.

        Returns
        -------
        str
            JSON of the format ``FORMAT``.
        """
        causes = [
            {
                "name": cause.name,
                "parameters": {
                    p.symbol: {"value": float(cause.values.get(p.symbol, p.typical)), "unit": p.unit}
                    for p in BY_NAME[cause.name].named_by(cause.values)
                },
                "lanes": list(cause.lanes),
                "share": cause.share,
            }
            for cause in self.causes
        ]
        base = {**self.parameters._asdict(), "desired_speed": self.desired_speed}
        whole = {
            "format": FORMAT,
            "source": self.source,
            "law": self.law,
            "reaction": self.reaction,
            "base": base,
            "causes": causes,
            "drivers": self.drivers,
        }
        return json.dumps(whole, indent=2) + "\n"

    @classmethod
    def from_json(cls, text: str, *, name: str = "extended model") -> ExtendedModel:
        """Return the model of a text.

        Parameters
        ----------
        text : str
            JSON as :meth:`to_json` writes it.
        name : str
            Name of the file, for messages.

        Returns
        -------
        ExtendedModel
            The model.

        Raises
        ------
        InputError
            If the text has another format, or names an unknown cause or symbol, or a value is out of its bounds.
        """
        try:
            whole = parse_json(text, name, finite=False)  # bounds name what is not finite
            if whole["format"] != FORMAT:
                raise InputError(
                    f"{name}: format is {whole['format']!r}, not {FORMAT!r}; write it again with `diagnose`"
                )
            base = dict(whole["base"])
            limit = _within(base.pop("desired_speed"), "desired_speed", DESIRED_SPEED, name)
            causes = tuple(_cause(entry, name) for entry in whole["causes"])
            law = str(whole.get("law", laws.NAMES[laws.IDM]))
            if law not in laws.NAMES:
                raise InputError(f"{name}: law {law!r} is unknown; use one of {', '.join(laws.NAMES)}")
            reaction = _within(whole.get("reaction", laws.REACTION), "reaction", REACTIONS, name)
            own = IDMParameters(**{k: _within(v, k, _bounds_of(k), name) for k, v in base.items()})
            drivers, source = whole.get("drivers", ""), whole.get("source", "")
            if not (isinstance(drivers, str) and isinstance(source, str)):
                raise InputError(f"{name}: drivers and source are texts; write it again with `diagnose`")
            return cls(own, limit, causes, source, law, reaction, drivers)
        except InputError:
            raise
        except (AttributeError, KeyError, TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{name}: not an extended model ({error}); give the file that `diagnose` wrote") from None

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the model to a file, atomically.

        Parameters
        ----------
        path : path-like
            File to write; replaced if it exists.
        """
        with new_file(Path(path)) as part:
            part.write_text(self.to_json(), encoding="utf-8")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> ExtendedModel:
        """Read a model from a file.

        Parameters
        ----------
        path : path-like
            File that `diagnose` wrote.

        Returns
        -------
        ExtendedModel
            The model.

        Raises
        ------
        InputError
            If the file cannot be read or is no extended model.
        """
        return cls.from_json(read_text(Path(path), "give the file that `diagnose` wrote"), name=str(path))


def _cause(entry: dict[str, object], name: str) -> Cause:
    """Return one cause of a file after checking its symbols."""
    label = str(entry["name"])
    if label not in BY_NAME:
        raise InputError(f"{name}: cause {label!r} is unknown; use one of {', '.join(BY_NAME)}")
    known = {p.symbol: p for p in BY_NAME[label].all_parameters}
    given = entry["parameters"]
    if not isinstance(given, dict) or not set(given) <= set(known):
        raise InputError(f"{name}: cause {label!r} has the parameters {', '.join(sorted(known))}, not {given!r}")
    values = {symbol: _real(one["value"]) for symbol, one in given.items()}
    for symbol, value in values.items():
        p = known[symbol]
        if not p.lower <= value <= p.upper:
            raise InputError(
                f"{name}: cause {label!r}: {symbol} = {format_quantity(value, p.unit, 6)}; "
                f"give it from {p.lower:g} to {p.upper:g}"
            )
    share = _real(entry.get("share", 1.0))
    if not 0.0 < share <= 1.0:
        raise InputError(f"{name}: cause {label!r}: share = {share:g} of the drivers; give it above 0 and up to 1")
    lanes = entry.get("lanes") or []
    if not isinstance(lanes, list) or not all(type(lane) is int and 1 <= lane <= MOST_LANES for lane in lanes):
        raise InputError(
            f"{name}: cause {label!r}: lanes = {shown(lanes)}; give numbers of lanes from 1 to {MOST_LANES}"
        )
    return Cause(label, values, tuple(lanes), share)


def _real(value: object) -> float:
    """Return a number of a file.

    Raises TypeError for texts and truth values.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{shown(value)} is not a number")
    return float(value)


def _bounds_of(parameter: str) -> tuple[float, float]:
    """Return the bounds of a base parameter.

    They are those of calibration, widened for the other laws.
    """
    return 0.0, WIDENED * float(getattr(UPPER, parameter, 0.0))


def _within(value: object, key: str, bounds: tuple[float, float], name: str) -> float:
    number, (low, high) = _real(value), bounds
    if not low <= number <= high:
        raise InputError(f"{name}: {key} = {number:g}; give it from {low:g} to {high:g}")
    return number
