"""All effects by name."""

from __future__ import annotations

from idm_sumo.models.effects import (
    acceleration_asymmetry,
    adjacent_lane_friction,
    correlated_noise,
    courtesy_yielding,
    desired_speed,
    follower_pressure,
    hysteresis,
    lane_change_relaxation,
    leader_class,
    location,
    measurement_artefact,
    memory,
    multi_leader_anticipation,
    perception_threshold,
    pre_insertion,
    reaction_delay,
    speed_dependent_headway,
    time_of_day,
    vehicle_class,
)
from idm_sumo.models.effects.record import Effect

CATALOGUE: tuple[Effect, ...] = (
    reaction_delay.EFFECT,
    multi_leader_anticipation.EFFECT,
    lane_change_relaxation.EFFECT,
    acceleration_asymmetry.EFFECT,
    leader_class.EFFECT,
    speed_dependent_headway.EFFECT,
    perception_threshold.EFFECT,
    hysteresis.EFFECT,
    adjacent_lane_friction.EFFECT,
    location.EFFECT,
    time_of_day.EFFECT,
    desired_speed.EFFECT,
    vehicle_class.EFFECT,
    memory.EFFECT,
    follower_pressure.EFFECT,
    courtesy_yielding.EFFECT,
    pre_insertion.EFFECT,
    measurement_artefact.EFFECT,
    correlated_noise.EFFECT,
)
BY_NAME: dict[str, Effect] = {effect.name: effect for effect in CATALOGUE}
