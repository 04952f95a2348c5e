"""Runs that are killed, interrupted or repeated elsewhere: what is left must be the same."""
