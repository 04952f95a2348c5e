"""Vehicle types of a closed loop: calibrated or SUMO's defaults."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt
import pandas as pd

from idm_sumo.calibration import driver_table as d
from idm_sumo.calibration.whole import IDM
from idm_sumo.runtime.errors import InputError
from idm_sumo.sumo.export.vtypes import AS_CALIBRATED, CLASSES, DriverType, number, type_element

Floats = npt.NDArray[np.float64]

DEFAULTS = {"default-idm": "IDM", "krauss": "Krauss"}  # SUMO's models with SUMO's parameters

_LC2013 = (
    "lcStrategic", "lcCooperative", "lcSpeedGain", "lcKeepRight", "lcOvertakeRight", "lcLookaheadLeft",
    "lcSpeedGainRight",
    "lcSpeedGainLookahead", "lcSpeedGainRemainTime", "lcSpeedGainUrgency", "lcOvertakeDeltaSpeedFactor",
    "lcKeepRightAcceptanceTime", "lcCooperativeRoundabout", "lcCooperativeSpeed", "lcAssertive", "lcSigma",
)  # fmt: skip
_SL2015 = (
    "lcSublane", "lcPushy", "lcPushyGap", "lcImpatience", "lcTimeToImpatience", "lcAccelLat", "lcTurnAlignmentDistance",
    "lcMaxSpeedLatStanding", "lcMaxSpeedLatFactor", "lcLaneDiscipline", "minGapLat", "maxSpeedLat",
)  # fmt: skip
LANE_CHANGE_MODELS = {"LC2013": _LC2013, "SL2015": (*_LC2013, *_SL2015)}
ASSERTIVE = "lcAssertive"
SUBLANE = {"SL2015": ("--lateral-resolution", "0.8")}  # m; the model needs sublanes


def lane_change_attributes(model: str, parameters: Mapping[str, str]) -> dict[str, str]:
    """Return the attributes that set SUMO's lane changing.

    They are the same for all populations, so that these differ in car-following only. Keeping right is off and
    overtaking on the right allowed, as in California.

    Parameters
    ----------
    model : {"LC2013", "SL2015"}
        SUMO's lane-change model.
    parameters : mapping of str to str
        Its parameters by name; they take precedence.

    Returns
    -------
    dict of str to str
        Attributes of a ``<vType>``.

    Raises
    ------
    InputError
        For an unknown model or parameter, or a value that is no number.
    """
    if model not in LANE_CHANGE_MODELS:
        raise InputError(f"--lane-change-model {model}: is unknown; use one of {', '.join(LANE_CHANGE_MODELS)}")
    for name, value in parameters.items():
        if name not in LANE_CHANGE_MODELS[model]:
            raise InputError(
                f"--lane-change {name}: is no parameter of {model}; it has {', '.join(LANE_CHANGE_MODELS[model])}"
            )
        try:
            finite = np.isfinite(float(value))
        except ValueError:
            finite = False
        if not finite:
            raise InputError(f"--lane-change {name}={value}: is not a number; give one, as in {name}=1")
    common = {name: AS_CALIBRATED[name] for name in ("lcOvertakeRight", "lcKeepRight")}
    return {**common, "laneChangeModel": model, **parameters}


def calibrated_types(
    demand: pd.DataFrame,
    theta: Floats,
    lane_change: Mapping[str, str],
    desired_speed: npt.ArrayLike,
    *,
    speed_limit: float = np.inf,
    law: str = IDM,
) -> list[Element]:
    """Return the exported type of every vehicle.

    Parameters
    ----------
    demand : pandas.DataFrame
        Of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    theta : array, shape (vehicles, 5)
        ``a, b, T, d0`` of each by the law, and a ``d1`` that is zero, for SUMO has none.
    lane_change : mapping of str to str
        Of :func:`lane_change_attributes`. Without ``lcAssertive`` the IDM's is that of
        :func:`assertiveness`; SUMO's other laws ask of a follower no more than its deceleration by themselves.
    desired_speed : array_like, shape (vehicles,) or ()
        m/s.
    speed_limit : float
        The road's (m/s). SUMO lets no vehicle drive above it, unless its type has a speed factor.
    law : {"idm", "krauss", "eidm"}
        SUMO's model.

    Raises
    ------
    InputError
        If a parameter is missing, or a ``d1`` is left.
    """
    if not np.isfinite(theta).all():
        row = int(np.flatnonzero(~np.isfinite(theta).all(axis=1))[0])
        raise InputError(
            f"vehicle {demand[d.KEYS[1]].iloc[row]} has no parameters; calibrate it or give it the pooled ones"
        )
    if (theta[:, 4] != 0.0).any():
        raise InputError("SUMO's IDM has no d1: refit or linearise the drivers first")
    if law == IDM:
        lane_change = {ASSERTIVE: f"{assertiveness(theta):.3g}"} | dict(lane_change)
    limits = np.broadcast_to(np.asarray(desired_speed, dtype=np.float64), (len(demand),)).tolist()
    sizes = zip(*(demand[name].tolist() for name in (d.KEYS[1], d.LENGTH, d.WIDTH, d.CLASS)), strict=True)
    types = []
    for (vehicle, length, width, kind), (a, b, T, d0, _), v0 in zip(sizes, theta.tolist(), limits, strict=True):
        driver = DriverType(f"type.{vehicle}", a, b, T, d0, v0, length, width, int(kind))
        faster = {"speedFactor": number(v0 / speed_limit)} if v0 > speed_limit else {}
        types.append(type_element(driver, None, law=law, **faster, **lane_change))
    return types


def assertiveness(theta: Floats) -> float:
    r"""Return how short a gap behind is taken (``lcAssertive``).

    SUMO's LC2013 takes a gap of the follower's desired one divided by ``lcAssertive``. There an IDM brakes by
    :math:`a(k^2 - 1)`, so that :math:`k = \sqrt{1 + b/a}` asks of it no more than its comfortable deceleration: the
    safety criterion of MOBIL (Kesting, Treiber and Helbing, 2007). The follower is taken for a typical one.

    Parameters
    ----------
    theta : array, shape (vehicles, 5)
        ``a, b, T, d0, d1`` of each.

    Returns
    -------
    float
    """
    a, b = np.median(theta[:, :2], axis=0)
    return float(np.sqrt(1.0 + b / a))


def default_types(demand: pd.DataFrame, name: str, lane_change: Mapping[str, str]) -> list[Element]:
    """Return SUMO's own type for every vehicle.

    Size and class are the recorded ones. Everything else is SUMO's default, the scatter of desired speeds around the
    limit (speedDev 0.1) included.

    Parameters
    ----------
    demand : pandas.DataFrame
        As of :func:`idm_sumo.sumo.closed_loop.demand.demand_of`.
    name : {"default-idm", "krauss"}
        Key of ``DEFAULTS``.
    lane_change : mapping of str to str
        As of :func:`lane_change_attributes`.

    Returns
    -------
    list of Element
        A ``<vType>`` each, in the order of the demand.
    """
    rows = zip(*(demand[key].tolist() for key in (d.KEYS[1], d.LENGTH, d.WIDTH, d.CLASS)), strict=True)
    shared = {"carFollowModel": DEFAULTS[name], "collisionMinGapFactor": "0", **lane_change}
    types = []
    for vehicle, length, width, kind in rows:
        shape = {
            "vClass": CLASSES[int(kind)],
            "guiShape": CLASSES[int(kind)],
            "length": number(length),
            "width": number(width),
        }
        types.append(Element("vType", {"id": f"type.{vehicle}", **shape, **shared}))
    return types
