"""SUMO options under which exported types drive as calibrated."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

from idm_sumo.recordings.columns import FRAME_STEP
from idm_sumo.runtime.errors import InputError

EULER, BALLISTIC = "euler", "ballistic"


def check_integration(integration: str) -> None:
    """Refuse an integration that SUMO does not have.

    Parameters
    ----------
    integration : str

    Raises
    ------
    InputError
        Names those it has.
    """
    if integration not in (EULER, BALLISTIC):
        raise InputError(f"integration: SUMO has no {integration!r}; use {EULER} (its default) or {BALLISTIC}")


def options(integration: str) -> dict[str, str]:
    """Return the options that decide how a type drives.

    Parameters
    ----------
    integration : {"euler", "ballistic"}

    Returns
    -------
    dict of str to str
        Values by SUMO's long names.

    Raises
    ------
    InputError
        For an integration that SUMO does not have.
    """
    check_integration(integration)
    return {
        "step-length": f"{FRAME_STEP:g}",
        "step-method.ballistic": "true" if integration == BALLISTIC else "false",
        "default.action-step-length": f"{FRAME_STEP:g}",
        "collision.action": "warn",  # reported, not repaired by teleporting
        "collision.mingap-factor": "0",
        "time-to-teleport": "-1",
        "max-depart-delay": "-1",  # a vehicle that finds no gap waits; it is not dropped
        "eager-insert": "true",  # nor does it delay those that enter by another lane of its edge
    }


def in_words(integration: str) -> str:
    """Say with which options a type drives as calibrated.

    Parameters
    ----------
    integration : {"euler", "ballistic"}

    Returns
    -------
    str
    """
    ballistic = " and --step-method.ballistic true" if integration == BALLISTIC else ""
    return f"the types drive as calibrated with --step-length {FRAME_STEP:g}{ballistic}"


SECTION = {"step-length": "time"}  # of sumo's configuration; all others are "processing"


def configuration(net: str, routes: str, integration: str) -> Element:
    """Return the ``<sumoConfiguration>`` of routes on a network.

    Parameters
    ----------
    net, routes : str
        File names, relative to the configuration.
    integration : {"euler", "ballistic"}

    Returns
    -------
    Element

    Raises
    ------
    InputError
        For an integration that SUMO does not have.
    """
    root = Element("sumoConfiguration")
    inputs = SubElement(root, "input")
    SubElement(inputs, "net-file", value=net)
    SubElement(inputs, "route-files", value=routes)
    sections = {"input": inputs}
    for name, value in options(integration).items():
        section = SECTION.get(name, "processing")
        if section not in sections:
            sections[section] = SubElement(root, section)
        SubElement(sections[section], name, value=value)
    report = SubElement(root, "report")
    SubElement(report, "no-step-log", value="true")
    SubElement(report, "duration-log.disable", value="true")
    return root
