"""Recorded trajectories: read, checked, cleaned and smoothed."""
