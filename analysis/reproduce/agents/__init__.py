"""Learned agents in the study."""
