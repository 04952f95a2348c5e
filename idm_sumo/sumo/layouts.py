"""Edges of the SUMO networks of roads."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Layout:
    """How the edges of a network make up a road.

    Attributes
    ----------
    mainline : tuple of str
        Edges of the main lanes in driving order; they reach beyond the section on both sides.
    weave : str
        The edge of the main road that has the auxiliary lane.
    downstream : str
        The edge that begins where the section ends.
    on_ramp, off_ramp : str
        Edges whose lane continues the auxiliary lane.
    """

    mainline: tuple[str, ...]
    weave: str
    downstream: str
    on_ramp: str
    off_ramp: str


LAYOUTS = {
    "us-101": Layout(
        mainline=("upstream", "entry", "weave", "exit", "downstream", "outflow"),
        weave="weave", downstream="downstream", on_ramp="on_ramp", off_ramp="off_ramp",
    ),
}  # fmt: skip
