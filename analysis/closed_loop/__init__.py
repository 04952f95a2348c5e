"""Runs, tables and page of a closed loop."""
