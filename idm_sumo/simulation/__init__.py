"""Modelled vehicles in recorded traffic."""
