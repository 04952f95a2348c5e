"""How each effect is drawn: size, form, place, time and who has it."""

from tests.simulators.second import effects, outside
from tests.simulators.second.view import Effect

# symbol, small, mid and large size, unit
SIZES = {
    "reaction_delay": ("tau", 0.2, 0.4, 0.6, "s"),  # at 0.8 s congested traffic is no longer stable enough
    "multi_leader_anticipation": ("w", 0.1, 0.2, 0.4, "1"),
    "lane_change_relaxation": ("kappa", 0.3, 0.6, 1.0, "1"),
    "acceleration_asymmetry": ("gamma", 0.15, 0.3, 0.5, "1"),
    "leader_class": ("theta", 0.15, 0.3, 0.5, "1"),
    "speed_dependent_headway": ("gamma", 0.08, 0.15, 0.3, "1 per 10 m/s"),
    "perception_threshold": ("band", 0.3, 0.6, 1.0, "m/s"),
    "hysteresis": ("eta", 0.06, 0.12, 0.25, "1"),
    "adjacent_lane_friction": ("k", 0.02, 0.05, 0.1, "1/s"),
    "location": ("shift", 0.06, 0.12, 0.25, "m/s2"),
    "time_of_day": ("delta", 0.06, 0.12, 0.25, "1"),
    "desired_speed": ("delta", 0.1, 0.2, 0.3, "1"),
    "follower_pressure": ("c", 0.15, 0.3, 0.6, "m/s2"),
    "pre_insertion": ("delta", 0.3, 0.6, 1.0, "1"),
    "courtesy_yielding": ("c", 0.3, 0.6, 1.0, "m/s2"),
}
EITHER_SIGN = ("speed_dependent_headway", "location", "time_of_day")
NAMES = tuple(SIZES)


def draw_size(rng, name, size):
    """Draw the number of the effect, within 10 % of its size, with a sign where both make sense."""
    value = SIZES[name][1 + ("small", "mid", "large").index(size)] * rng.uniform(0.9, 1.1)
    if name in ("location", "desired_speed") and rng.random() < 0.8:
        return -value  # places and limits mostly hold back
    return -value if name in EITHER_SIGN and rng.random() < 0.3 else value


def stretch(rng, whole, least, most):
    """Interval that covers a share of `least` to `most` of (0, whole) and does not touch its ends."""
    share = rng.uniform(least, most)
    start = rng.uniform(0.08, 0.92 - share)
    return round(start * whole, 1), round((start + share) * whole, 1)


def catalogue_effect(rng, name, size, usual, scene):
    """Effect of the catalogue for a scene."""
    value = draw_size(rng, name, size)
    symbol = SIZES[name][0]
    effect = Effect(name, effects.CATALOGUE.index(name), 0 if usual else 1, value, size=size)
    effect.symbols = {symbol: round(value, 4)}
    if name == "reaction_delay":
        effect.lag, effect.lag_spread = value, 0.0 if usual else 0.3
    elif name == "lane_change_relaxation":
        effect.q = rng.uniform(8.0, 20.0)
        effect.symbols["tau_r"] = round(effect.q, 2)
    elif name == "speed_dependent_headway":
        effect.q = scene["expected_speed"]
        effect.symbols["v_mean"] = round(effect.q, 2)
    elif name == "location":
        effect.position = stretch(rng, scene["section_m"], 0.18, 0.4)
    elif name == "time_of_day":
        effect.time = stretch(rng, scene["seconds"], 0.25, 0.5)
    elif name == "desired_speed":
        effect.lane, effect.q = int(rng.integers(1, scene["lanes"] + 1)) if usual else 0, scene["lanes"]
    return effect


def outside_effect(rng, name, scene, strength=1.0):
    """Effect outside the catalogue; `strength` multiplies the number it begins with."""
    number = outside.NAMES.index(name)
    effect = Effect(name, outside.FIRST + number, 1, min(outside.IDEAS[number][3] * strength, 6.0), size="outside")
    effect.symbols = {"strength": round(effect.p, 4)}
    if name == "late_beside_accident":
        effect.position, effect.share = stretch(rng, scene["section_m"], 0.3, 0.45), rng.uniform(0.5, 0.7)
        effect.lag = min(1.4, 0.9 * strength)
        effect.symbols = {"lag_s": round(effect.lag, 3)}
    elif name == "shower":
        ends = (0.1 * scene["section_m"], 0.9 * scene["section_m"])
        effect.position, effect.time = ends[:: int(rng.choice((-1, 1)))], stretch(rng, scene["seconds"], 0.5, 0.75)
    elif name == "glare":
        effect.position = stretch(rng, scene["section_m"], 0.4, 0.6)
        effect.time = stretch(rng, scene["seconds"], 0.35, 0.5)
    elif name == "slow_start":
        effect.p = min(0.9, effect.p)
    elif name == "closes_the_door":
        effect.p = min(0.6, effect.p)
    return effect
