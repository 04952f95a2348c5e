"""Recorded vehicles in SUMO, some of them modelled.

:mod:`~idm_sumo.sumo.replay.one_vehicle`
    Each modelled vehicle in a replay of its own, present in SUMO; perceives through SUMO.
:mod:`~idm_sumo.sumo.replay.ghosts`
    All modelled vehicles beside one pass of the recording. Same results, one pass instead of many.
:mod:`~idm_sumo.sumo.replay.actions`
    Vehicles driven by given controls.
:mod:`~idm_sumo.sumo.replay.playback`
    The recording alone.

In each of them every vehicle is moved to its place at every step. SUMO holds the vehicles and names leaders; it drives
no vehicle, neither by its car-following nor by its lane-changing models. Modelled vehicles are driven by the functions
of :mod:`idm_sumo.simulation.rollout` (IDM, pure pursuit, kinematic bicycle), by Euler steps with the
old speed.
"""
