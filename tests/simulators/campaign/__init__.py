"""Blind trials: recordings with a hidden effect, and a table of what was found."""
