"""Measures of how far a simulation is from a recording."""
