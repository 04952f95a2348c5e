"""Recordings side by side."""
