"""Recorded demand driven by SUMO, with every vehicle reacting."""
