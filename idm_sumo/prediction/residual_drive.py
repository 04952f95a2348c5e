"""Drivers with a residual, and what drives them."""

from __future__ import annotations

import json
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
from numba import njit

from idm_sumo.models import bicycle, idm
from idm_sumo.models import residual as r
from idm_sumo.models.idm import IDMParameters
from idm_sumo.prediction.residual_rollout import Shared
from idm_sumo.recordings import columns as c
from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.threads import in_threads
from idm_sumo.scenes.traffic import NOBODY
from idm_sumo.scenes.windows import Scenes
from idm_sumo.simulation.driver_parameters import PARAMETERS
from idm_sumo.simulation.rollout import Trajectories, perceive, steer

Floats = npt.NDArray[np.float64]

MODEL = "residual_model"  # the column that holds what all drivers share, as JSON
OWN = ("residual_lasting_m_s2", "residual_1s_m_s2", "residual_3s_m_s2")
LEADER_ACCELERATION = "residual_leader_m_s2"
COLUMNS = (*OWN, LEADER_ACCELERATION, MODEL)
POPULATION = "population"  # that of a driver without a residual
ROOM = 5  # rows of what a driver needs for its sums


class ResidualModel(NamedTuple):
    """What all drivers share.

    Attributes
    ----------
    pooled : IDMParameters
        The IDM that the residual is added to.
    weights : float64, shape (20,)
        Of the present state, its squares and products (m/s²).
    center, scale : float64, shape (5,)
        Mean and standard deviation of the state: speed (m/s), logarithm of the gap (m), approach rate (m/s), time
        gap (s), leader's acceleration (m/s²).
    desired_speed : float
        m/s.
    observed : int
        Frames that are seen of a driver before the simulation.
    """

    pooled: IDMParameters
    weights: Floats
    center: Floats
    scale: Floats
    desired_speed: float
    observed: int

    @property
    def shared(self) -> Shared:
        """The same without weights, as the compiled rollout reads it."""
        return Shared(np.asarray(self.pooled, dtype=np.float64), self.center, self.scale)

    def to_json(self) -> str:
        """Return the model as text.

        Returns
        -------
        str
        """
        arrays = {name: getattr(self, name).tolist() for name in ("weights", "center", "scale")}
        numbers = {"desired_speed_m_s": self.desired_speed, "observed": self.observed}
        return json.dumps({"pooled": list(self.pooled), **arrays, **numbers})

    @classmethod
    def from_json(cls, text: str) -> ResidualModel:
        """Read a model from text.

        Parameters
        ----------
        text : str

        Returns
        -------
        ResidualModel

        Raises
        ------
        InputError
            If it is no such text.
        """
        try:
            read = json.loads(text)
            arrays = [np.array(read[name], dtype=np.float64) for name in ("pooled", "weights", "center", "scale")]
            speed, observed = float(read["desired_speed_m_s"]), int(read["observed"])
        except (ValueError, KeyError, TypeError):
            raise InputError(f"{MODEL}: not a residual model; `idm-sumo predict --method residual` writes it") from None
        sizes = (len(PARAMETERS), r.REGRESSORS, r.STATE, r.STATE)
        whole = all(a.shape == (n,) and np.isfinite(a).all() for a, n in zip(arrays, sizes, strict=True))
        if not (whole and (arrays[3] > 0.0).all() and 0.0 < speed < np.inf and observed > 0):
            raise InputError(f"{MODEL}: has impossible numbers; `idm-sumo predict --method residual` writes it")
        pooled, weights, center, scale = arrays
        return cls(IDMParameters(*pooled.tolist()), weights, center, scale, speed, observed)


class ResidualDrivers(NamedTuple):
    """Predicted drivers with a residual.

    Attributes
    ----------
    model : ResidualModel
    own : float64, shape (drivers, 3)
        m/s²: what lasts, and what fades within 1 s and 3 s.
    leader_acceleration : float64, shape (drivers,)
        At the start (m/s²).
    status : str, shape (drivers,)
        "ok", or why the driver is the pooled one, without a residual.
    keys : pandas.DataFrame
        ``period, vehicle, first_frame``.
    weights : float64, shape (drivers, 20), or None
        The shared weights of the fold that left the driver out; by default the model's.
    """

    model: ResidualModel
    own: Floats
    leader_acceleration: Floats
    status: npt.NDArray[np.str_]
    keys: pd.DataFrame
    weights: Floats | None = None

    def __repr__(self) -> str:
        """Return one line: drivers, and those as the population."""
        return f"<ResidualDrivers: {len(self.own):,} drivers, {int((self.status != 'ok').sum()):,} as the population>"

    def rows(self, which: slice | npt.NDArray[np.int64] | npt.NDArray[np.bool_]) -> ResidualDrivers:
        """Return some of the drivers.

        Parameters
        ----------
        which : slice, int64 or bool array

        Returns
        -------
        ResidualDrivers
        """
        weights = None if self.weights is None else self.weights[which]
        own, start, status = self.own[which], self.leader_acceleration[which], self.status[which]
        return ResidualDrivers(self.model, own, start, status, self.keys.iloc[which], weights)

    @classmethod
    def of_table(cls, table: pd.DataFrame, keys: pd.DataFrame, source: str) -> ResidualDrivers:
        """Return the drivers of windows from a table.

        Parameters
        ----------
        table : pandas.DataFrame
            As ``idm-sumo predict --method residual`` writes it.
        keys : pandas.DataFrame
            ``period, vehicle`` of each driver that is wanted, and ``first_frame`` if the window matters.
        source : str
            Of the table, for messages.

        Returns
        -------
        ResidualDrivers

        Raises
        ------
        InputError
            If a window has no row, or the rows are of several models.
        """
        if absent := [name for name in ("status", *COLUMNS) if name not in table]:
            raise InputError(
                f"{source}: column {absent[0]!r} is missing; write the table with `idm-sumo predict --method residual`"
            )
        named = table.assign(**{c.PERIOD: table[c.PERIOD].astype(str)}).drop_duplicates(list(keys))
        own = keys.merge(named[[*keys, "status", *COLUMNS]], on=list(keys), how="left")
        if own[MODEL].isna().any():
            raise InputError(f"{source}: not a residual for each window that is driven; predict this recording")
        models = own.loc[own[MODEL] != POPULATION, MODEL].unique()
        if len(models) != 1:
            raise InputError(
                f"{source}: column {MODEL!r} holds {len(models)} models, needed is one; predict them together"
            )
        status = np.where(own[MODEL] == POPULATION, POPULATION, "ok")
        numbers = own[[*OWN, LEADER_ACCELERATION]].to_numpy(np.float64)
        return cls(ResidualModel.from_json(models[0]), numbers[:, :3].copy(), numbers[:, 3].copy(), status, keys)

    def check_observed(self, frames: int, source: str) -> None:
        """Raise unless so many frames were observed.

        Parameters
        ----------
        frames : int
        source : str
            Of the drivers, for the message.

        Raises
        ------
        InputError
            If another number of frames was observed.
        """
        if self.model.observed != frames:
            raise InputError(
                f"{source}: predicted from {self.model.observed} frames, {frames} are observed here; "
                f"give --observed {self.model.observed}"
            )

    def to_pandas(self) -> pd.DataFrame:
        """Return one row a driver.

        Returns
        -------
        pandas.DataFrame
            ``period, vehicle, first_frame, status`` and what drives it.
        """
        table = self.keys.reset_index(drop=True).assign(status=self.status)
        table[list(OWN)] = self.own
        table[LEADER_ACCELERATION] = self.leader_acceleration
        table[MODEL] = np.where(self.status == "ok", self.model.to_json(), POPULATION)
        return table

    def shared_weights(self) -> Floats:
        """Return every driver's shared weights, 0 without a residual.

        Returns
        -------
        float64, shape (drivers, 20)
        """
        weights = np.broadcast_to(self.model.weights, (len(self.own), r.REGRESSORS))
        if self.weights is not None:
            weights = self.weights
        return np.where((self.status == "ok")[:, None], weights, 0.0)


def drive_residual(scenes: Scenes, drivers: ResidualDrivers) -> Trajectories:
    """Drive every vehicle by the pooled IDM and its residual.

    Parameters
    ----------
    scenes : Scenes
    drivers : ResidualDrivers
        Of the same windows.

    Returns
    -------
    Trajectories
        By the paper's transition model: Euler with the old speed.

    Raises
    ------
    InputError
        If there are not as many drivers as windows.
    """
    if len(drivers.own) != len(scenes):
        raise InputError(f"drivers: {len(drivers.own)} for {len(scenes)} windows; predict the scenes that are driven")
    out, first, t, model = Trajectories.of(scenes), scenes.start, scenes.traffic, drivers.model
    start = np.stack([getattr(scenes, name)[:, first] for name in ("x", "y", "heading", "speed")], axis=1)
    in_threads(
        _drive_all, len(scenes), model.shared, drivers.shared_weights(), np.ascontiguousarray(drivers.own),
        np.ascontiguousarray(drivers.leader_acceleration), model.desired_speed, start, scenes.length,
        scenes.road.lane_center(scenes.lane), scenes.cell + first, scenes.vehicle,
        t.offsets, t.x, t.speed, t.length, t.vehicle,
        out.x, out.y, out.heading, out.speed, out.acceleration, out.steering, out.gap, out.leader,
    )  # fmt: skip
    return out


@njit(cache=True, error_model="numpy")
def residual_of(speed, rate, gap, leader_acceleration, time, shared, weights, own, scratch):  # type: ignore[no-untyped-def]
    """Return the residual of one driver.

    Parameters
    ----------
    speed, rate, gap, leader_acceleration, time : float
        m/s, m/s, m, m/s², s since the start.
    shared : Shared
    weights : float64, shape (20,)
    own : float64, shape (3,)
    scratch : float64, shape (5, 20)
        Changed.

    Returns
    -------
    float
        m/s², 0 without a leader.
    """
    if not (gap > idm.SMALLEST_GAP and gap < np.inf):
        return 0.0
    state, values, fades = scratch[0, : r.STATE], scratch[1], scratch[2, : r.OWN]
    by_speed, by_gap = scratch[3, : r.STATE], scratch[4, : r.STATE]
    r.standard_state(speed, rate, gap, leader_acceleration, shared.center, shared.scale, state, by_speed, by_gap)
    r.regressors(state, values)
    r.fading(time, fades)
    total = 0.0
    for j in range(r.REGRESSORS):
        total += weights[j] * values[j]
    for j in range(r.OWN):
        total += own[j] * fades[j]
    return total


@njit(cache=True, error_model="numpy")
def driven(speed, leader_speed, gap, leader_acceleration, time, shared, weights, own, limit, scratch):  # type: ignore[no-untyped-def]
    """Return the acceleration of one driver.

    Parameters
    ----------
    speed, leader_speed, gap, leader_acceleration, time
        m/s, m/s, m (infinite without a leader), m/s², s since the start.
    shared : Shared
    weights : float64, shape (20,)
    own : float64, shape (3,)
    limit : float
        Desired speed (m/s).
    scratch : float64, shape (5, 20)
        Changed.

    Returns
    -------
    float
        m/s².
    """
    a, b, headway, d0, d1 = shared.pooled
    rate = speed - leader_speed
    plain = idm.acceleration(speed, rate, gap, a, b, headway, d0, d1, limit)
    extra = residual_of(speed, rate, gap, leader_acceleration, time, shared, weights, own, scratch)
    return max(plain + extra, -idm.EMERGENCY_BRAKING)


@njit(cache=True, nogil=True, error_model="numpy")
def _drive_all(  # type: ignore[no-untyped-def]
    begin, end, shared, weights, own, followed, limit, start, length, lane_y, first_cell, number,
    offsets, traffic_x, traffic_speed, traffic_length, traffic_vehicle,
    x, y, heading, speed, acceleration, steering, gap, leader,
):  # fmt: skip
    steps = acceleration.shape[1]
    scratch = np.empty((ROOM, r.REGRESSORS))
    for i in range(begin, end):
        x[i, 0], y[i, 0], psi, v = start[i]
        heading[i, 0], speed[i, 0], known, before = psi, v, followed[i], 0.0
        cx, cy = bicycle.center_of_front(x[i, 0], y[i, 0], psi, length[i])
        axles = bicycle.wheelbase(length[i])
        for k in range(steps + 1):
            row, d = perceive(
                first_cell[i] + k, x[i, k], number[i], offsets, traffic_x, traffic_length, traffic_vehicle
            )
            leader[i, k], gap[i, k] = row, d
            if k == steps:
                break
            leader_speed = traffic_speed[row] if row != NOBODY else 0.0
            if k > 0:
                known = r.followed_acceleration(known, before, leader_speed, FRAME_STEP)
            before = leader_speed
            time = k * FRAME_STEP
            acceleration[i, k] = driven(v, leader_speed, d, known, time, shared, weights[i], own[i], limit, scratch)
            steering[i, k] = steer(cy, psi, v, length[i], lane_y[i])
            cx, cy, psi, v = bicycle.step(cx, cy, psi, v, acceleration[i, k], steering[i, k], axles, FRAME_STEP)
            x[i, k + 1], y[i, k + 1] = bicycle.front_of_center(cx, cy, psi, length[i])
            heading[i, k + 1], speed[i, k + 1] = psi, v
