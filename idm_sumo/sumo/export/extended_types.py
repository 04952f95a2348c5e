"""Effects that SUMO vehicle types can express.

What they cannot express, only the Python-driven loop can. SUMO's EIDM is not used, though it has a reaction time and
looks several vehicles ahead. Behind a leader that oscillates for 30 s, a type stays this near (mean distance, m) to a
driver with the effect:

=====================================  =====  =====  =====
type                                   0.2 s  0.4 s  0.8 s
=====================================  =====  =====  =====
IDM without the delay                  0.21   0.48   1.71
EIDM, ``treaction`` of the delay       0.28   0.48   1.59
EIDM, ``treaction`` of twice that      0.23   0.36   1.27
IDM, ``actionStepLength`` twice that   0.07   0.12   0.27
=====================================  =====  =====  =====

and with a second leader of weight 0.2 the IDM without it is 0.37 m off, the EIDM 0.41 m whatever its ``maxvehpreview``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.models.effects import BY_NAME, Cause, ExtendedModel, slots
from idm_sumo.models.effects.time_of_day import drifted
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP, TRUCK
from idm_sumo.sumo.export.vtypes import number

Floats = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

LOOP = "only our own loop: `idm-sumo replay --model`, `idm-sumo interactive --model`"


class Expressed(NamedTuple):
    """Drivers with the effects that SUMO can express.

    Attributes
    ----------
    theta : float64, shape (drivers, 5)
        ``a, b, T, d0, 0`` (SI units).
    maximum_speed : float64, shape (drivers,)
        m/s.
    extra : sequence of dict of str to str, shape (drivers,)
        Further attributes of each type.
    notes : tuple of str
        One line an effect: how it is expressed, or that it is not.
    """

    theta: Floats
    maximum_speed: Floats
    extra: Sequence[dict[str, str]]
    notes: tuple[str, ...]

    def of(self, order: npt.NDArray[np.int64]) -> Expressed:
        """Return the drivers in another order.

        Parameters
        ----------
        order : int64, shape (drivers,)
            Numbers of the drivers.

        Returns
        -------
        Expressed
        """
        extra = [self.extra[n] for n in order]
        return self._replace(theta=self.theta[order], maximum_speed=self.maximum_speed[order], extra=extra)


def express(model: ExtendedModel, table: pd.DataFrame, theta: Floats, maximum_speed: Floats) -> Expressed:
    """Return types' parameters with the effects that SUMO has.

    Parameters
    ----------
    model : ExtendedModel
    table : pandas.DataFrame
        Drivers: ``period``, ``vehicle``, ``vehicle_class``, ``depart_s``, and, if known, ``has_what_some_have``.
    theta : float64, shape (drivers, 5)
        ``a, b, T, d0, 0`` (SI units).
    maximum_speed : float64, shape (drivers,)
        m/s.

    Returns
    -------
    Expressed
    """
    no_idm = (
        f"law {model.law}: the types are IDM ones of the drivers as given, its causes on top; the law itself is {LOOP}"
    )
    none: list[dict[str, str]] = [{} for _ in theta]
    held = Expressed(theta.copy(), maximum_speed.copy(), none, () if model.is_idm else (no_idm,))
    some = table[d.HAS].to_numpy(dtype=bool) if d.HAS in table else model.has_partial_causes(table[c.VEHICLE])
    for cause in model.causes:
        how = None if cause.lanes else _HOW.get(cause.name)
        if how is None:
            where = f" in lane {', '.join(map(str, cause.lanes))}" if cause.lanes else ""
            held = held._replace(notes=(*held.notes, f"{cause.name}{where}: no SUMO vehicle type has it; {LOOP}"))
        else:
            which = some if cause.share < 1.0 else np.ones(len(table), dtype=bool)
            held = how(held, cause, table, which)
            if cause.share < 1.0:
                said = f"{held.notes[-1]}; {which.sum()} of {len(which)} drivers have it"
                held = held._replace(notes=(*held.notes[:-1], said))
    return held


def _size(cause: Cause, symbol: str) -> float:
    """Return the value of an effect's parameter."""
    m = np.zeros(slots.COUNT)
    cause.fill(m)
    return float(m[next(p.slot for p in BY_NAME[cause.name].parameters if p.symbol == symbol)])


def _delay(held: Expressed, cause: Cause, _: pd.DataFrame, which: Booleans) -> Expressed:
    r"""Let drivers act at intervals of :math:`2\tau`.

    What they act on is then :math:`\tau` old on average.
    """
    tau = _size(cause, "tau")
    steps = max(round(2.0 * tau / FRAME_STEP), 1)
    every = number(round(steps * FRAME_STEP, 1))
    known = ", which makes the own speed late, too" if _size(cause, "eta") > 0.0 else ""
    note = (
        f"reaction_delay: actionStepLength = {every} s, whose mean age is half of it, for tau = {tau:.3g} s (give "
        f"--integration ballistic, or SUMO warns of it){known}; exactly it is {LOOP}"
    )
    return _with_attribute(held, which, "actionStepLength", every, note)


def _with_attribute(held: Expressed, which: Booleans, name: str, value: str, note: str) -> Expressed:
    """Return the drivers with one more attribute for some."""
    extra = [{**one, name: value} if has else one for one, has in zip(held.extra, which, strict=True)]
    return held._replace(extra=extra, notes=(*held.notes, note))


def _own_class(held: Expressed, cause: Cause, table: pd.DataFrame, which: Booleans) -> Expressed:
    """Change the time headway of trucks."""
    truck = which & (table[d.CLASS].to_numpy() == TRUCK) if d.CLASS in table else np.zeros(len(table), dtype=bool)
    share = _size(cause, "theta")
    note = f"vehicle_class: tau of {truck.sum()} trucks times {1 + share:.3g}"
    return _longer(held, truck, share, note)


def _period(held: Expressed, cause: Cause, table: pd.DataFrame, which: Booleans) -> Expressed:
    """Change the time headway of drivers by departure."""
    since = table[d.DEPART] - table.groupby(c.PERIOD)[d.DEPART].transform("min")
    begin, end, share = (_size(cause, symbol) for symbol in ("t_1", "t_2", "theta"))
    if "delta" in cause.values:
        return _drift(held, since.to_numpy(np.float64), cause.values["delta"], begin, end, which)
    inside = ((since >= begin) & (since < end)).to_numpy() & which
    note = (
        f"time_of_day: tau of {inside.sum()} drivers who depart between {begin:g} and {end:g} s times {1 + share:.3g}; "
        f"who is on the road then keeps its headway; exactly it is {LOOP}"
    )
    return _longer(held, inside, share, note)


def _drift(held: Expressed, since: Floats, drift: float, begin: float, end: float, which: Booleans) -> Expressed:
    """Change the time headway linearly over departures."""
    share = np.array([drifted(t, drift, begin, end) for t in since]) - 1.0
    note = (
        f"time_of_day: tau of drivers by departure times {1.0 - drift:.3g} at {begin:g} s to {1.0 + drift:.3g} "
        f"at {end:g} s; each then keeps its headway; exactly it is {LOOP}"
    )
    return _longer(held, which, share[which], note)


def _longer(
    held: Expressed, which: npt.NDArray[np.bool_], share: float | npt.NDArray[np.float64], note: str
) -> Expressed:
    """Return the drivers with some time headways changed."""
    theta = held.theta.copy()
    theta[which, 2] *= 1.0 + share
    return held._replace(theta=theta, notes=(*held.notes, note))


def _desired(held: Expressed, cause: Cause, _: pd.DataFrame, which: Booleans) -> Expressed:
    """Change the desired speed."""
    if _size(cause, "lane") != 0.0 or _size(cause, "n") != 0.0:
        return held._replace(notes=(*held.notes, f"desired_speed by lane: no SUMO vehicle type has it; {LOOP}"))
    factor = 1.0 + _size(cause, "delta")
    note = f"desired_speed: maxSpeed times {factor:.3g}" + (f", speedFactor {factor:.3g}" if factor > 1.0 else "")
    held = held._replace(maximum_speed=np.where(which, held.maximum_speed * factor, held.maximum_speed))
    return _with_attribute(held, which, "speedFactor", number(max(factor, 1.0)), note)


_HOW = {
    "reaction_delay": _delay,
    "vehicle_class": _own_class,
    "time_of_day": _period,
    "desired_speed": _desired,
}
