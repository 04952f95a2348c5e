"""Calibrated drivers as SUMO vehicle types."""
