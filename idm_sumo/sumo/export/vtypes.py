"""One driver as a SUMO vehicle type.

Every attribute that changes how a type drives is written, so that no default of SUMO's decides it.
"""

from __future__ import annotations

import re
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

from idm_sumo.calibration.whole import EIDM, IDM, KRAUSS
from idm_sumo.models import idm
from idm_sumo.recordings.columns import FRAME_STEP

STEPPING = 0.25  # s: longer than our step, so SUMO's IDM computes one acceleration a step, as we do

# Recorded class to SUMO's class and shape; 0 is not recorded.
CLASSES = {0: "passenger", 1: "motorcycle", 2: "passenger", 3: "truck"}

# What makes the type drive as calibrated wherever it is used, and SUMO's reason for each.
AS_CALIBRATED = {
    "carFollowModel": "IDM",
    "delta": f"{idm.EXPONENT:g}",
    "stepping": f"{STEPPING:g}",
    "emergencyDecel": f"{idm.EMERGENCY_BRAKING:g}",
    "speedFactor": "1",  # by default drawn at random around 1, which would change v0
    "speedDev": "0",
    "actionStepLength": f"{FRAME_STEP:g}",  # a longer one would be a reaction time that was not calibrated
    "startupDelay": "0",
    "impatience": "0",
    "collisionMinGapFactor": "0",  # a collision is a contact of bumpers, not a gap below minGap
    "laneChangeModel": "LC2013",
    # By default a vehicle brakes behind a slower one on its LEFT, so as not to overtake on the
    # right: a European rule, by which an IDM driver slows down for a vehicle in another lane.
    "lcOvertakeRight": "1",
    "lcKeepRight": "0",  # drivers in California need not return to the right
}  # fmt: skip

# What a law needs beside the IDM's own attributes, or in place of them; None: SUMO's model has no such one.
LAW_ATTRIBUTES: dict[str, dict[str, str | None]] = {
    IDM: {},
    KRAUSS: {"carFollowModel": "Krauss", "delta": None, "stepping": None, "sigma": "0"},  # a noise was not fitted
    EIDM: {
        "carFollowModel": "EIDM",
        "sigmaleader": "0", "sigmagap": "0", "sigmaerror": "0",  # random errors, which were not fitted
        "treaction": "0",  # every step is an action point
        "ccoolness": "0",  # no second law behind leaders who brake
        "jerkmax": "1000",  # m/s³: no limit
        "taccmax": "0.01", "Mbegin": "1e-6",  # a start takes one step, the least that SUMO's schema allows
    },
}  # fmt: skip


class DriverType(NamedTuple):
    """Contents of a vehicle type, in SI units.

    Attributes
    ----------
    identifier : str
    a, b, T, d0 : float
        IDM parameters (m/s², m/s², s, m).
    maximum_speed : float
        Desired speed :math:`v_0` on a road that allows it (m/s).
    length, width : float
        m.
    vehicle_class : int
        Recorded class, key of ``CLASSES``.
    """

    identifier: str
    a: float
    b: float
    T: float
    d0: float
    maximum_speed: float
    length: float
    width: float
    vehicle_class: int


def identifier(*parts: object) -> str:
    """Return parts joined by dots, as SUMO accepts names.

    Parameters
    ----------
    *parts : object
        For example period and vehicle: ``0750-0805.123``.

    Returns
    -------
    str
    """
    return re.sub(r"[^A-Za-z0-9_.\-+]", "_", ".".join(str(part) for part in parts))


def type_element(driver: DriverType, parent: Element | None = None, *, law: str = IDM, **extra: str) -> Element:
    """Return the ``<vType>`` of a driver.

    Numbers are written in full, so that the type is exactly the calibrated driver.

    Parameters
    ----------
    driver : DriverType
    parent : Element, optional
        Element that it is added to.
    law : {"idm", "krauss", "eidm"}
        SUMO's model.
    **extra : str
        Further attributes, which take precedence.

    Returns
    -------
    Element
    """
    shape = CLASSES[driver.vehicle_class]
    attributes = {
        "id": driver.identifier, "vClass": shape, "guiShape": shape,
        "length": number(driver.length), "width": number(driver.width),
        "accel": number(driver.a), "decel": number(driver.b), "apparentDecel": number(driver.b),
        "tau": number(driver.T), "minGap": number(driver.d0), "maxSpeed": number(driver.maximum_speed),
        **AS_CALIBRATED, **LAW_ATTRIBUTES[law], **extra,
    }  # fmt: skip
    known = {name: value for name, value in attributes.items() if value is not None}
    return Element("vType", known) if parent is None else SubElement(parent, "vType", known)


def number(value: float) -> str:
    """Return the shortest text that reads back equal.

    Parameters
    ----------
    value : float

    Returns
    -------
    str
    """
    return repr(float(value)).removesuffix(".0")
