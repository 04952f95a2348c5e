"""Recorded demand as vehicles that react."""
