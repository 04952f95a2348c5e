"""SUMO: sessions, networks, replay, export, closed loop, surrogate.

No other room imports libsumo or sumolib.
"""
