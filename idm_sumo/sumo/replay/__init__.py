"""Recorded vehicles on the road of SUMO, some of them modelled."""
