"""Recorded traffic replayed in SUMO, one vehicle at a time driven by a model."""

__version__ = "0.2.0"
