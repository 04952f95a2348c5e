"""Recordings with a hidden effect: traffic simulated by code that shares nothing with the finder's.

    chosen = plan(seed=3, effect="hysteresis", size="mid")   # everything not given is drawn from the seed
    planted = simulate(chosen)                               # true paths, apart from what is measured
    write(planted, path)                                     # NGSIM's official layout; nothing reveals the plan

    truth = achievable(simulate(chosen, remember=True))      # what the true model is better by, with and without it

Own car-following (an IDM stepped by 0.05 s, ballistic, a full-velocity-difference model and Gipps's), own lane changes,
own driver and measurement noise, and for each effect a usual, another and for some a third form
(:mod:`tests.simulators.first.behaviour`). Or SUMO drives (``underlying="SUMO EIDM"``), with effects on the headway
alone (:mod:`tests.simulators.first.in_sumo`).
"""

from tests.simulators.first.files import write
from tests.simulators.first.in_sumo import IN_SUMO, SUMO_MODELS
from tests.simulators.first.plans import CATALOGUE, FORMS, MODELS, OUTSIDE, SIZES, Plan, plan
from tests.simulators.first.simulation import Planted, simulate
from tests.simulators.first.truth import NOT_BEHAVIOUR, Achievable, achievable

__all__ = [
    "CATALOGUE",
    "FORMS",
    "IN_SUMO",
    "MODELS",
    "NOT_BEHAVIOUR",
    "OUTSIDE",
    "SIZES",
    "SUMO_MODELS",
    "Achievable",
    "Plan",
    "Planted",
    "achievable",
    "plan",
    "simulate",
    "write",
]
