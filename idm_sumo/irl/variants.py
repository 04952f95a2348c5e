"""Ways to learn the reward: ours and the paper's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from idm_sumo.irl import features
from idm_sumo.irl.inverse_control import LearnedReward, learn, learn_wanted
from idm_sumo.irl.learning import Lessons, expansion_of
from idm_sumo.irl.reward import PENALTY, Reward
from idm_sumo.irl.trajectory import step_features
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.threads import one_blas_thread

PAPERS_FEATURES = features.NAMES[: features.STATE_FEATURES]
PAPERS_DEMONSTRATIONS = 1992
STEPS = 50  # of a demonstration, 0.1 s


@dataclass(frozen=True)
class Variant:
    """One way to learn a reward.

    Attributes
    ----------
    name : str
    demonstrations : int
        Largest number of drivers to learn from.
    use : tuple of str
        Features with a weight.
    any_sign : bool
        Whether a weight may be negative.
    penalty : float
        Of a collision or of leaving the road, in training.
    """

    name: str
    demonstrations: int = 200
    use: tuple[str, ...] = features.NAMES
    any_sign: bool = False
    penalty: float = PENALTY


VARIANTS = (
    Variant("as here"),
    Variant("1,992 demonstrations", demonstrations=PAPERS_DEMONSTRATIONS),
    Variant("weights of any sign", any_sign=True),
    Variant("the paper's five features", use=PAPERS_FEATURES),
    Variant("no penalty", penalty=0.0),
    Variant("five features, any sign", use=PAPERS_FEATURES, any_sign=True),
    Variant("five features, any sign, no penalty", use=PAPERS_FEATURES, any_sign=True, penalty=0.0),
)


@one_blas_thread
def learn_variant(
    lessons: Lessons, variant: Variant, *, seed: int = 1, progress: Progress = silent
) -> tuple[LearnedReward, Reward]:
    """Learn a reward one of several ways.

    Parameters
    ----------
    lessons : Lessons
        Drivers to learn from.
    variant : Variant
    seed : int
        For the draw of demonstrations.
    progress : Progress
        Called as the work proceeds.

    Returns
    -------
    LearnedReward
        Weights, and whether the search ended at a maximum.
    Reward
        Of a step, brought to the scale of all recorded drivers.

    Raises
    ------
    InputError
        If no driver keeps moving.
    """
    moving = np.flatnonzero(lessons.demonstrations.moving)
    if not len(moving):
        raise InputError("no driver keeps moving over the whole horizon; a reward cannot be learned from them")
    drawn = lessons.rows(np.random.default_rng(seed).permutation(moving)[: variant.demonstrations])
    expansion = expansion_of(drawn, STEPS)
    learned = learn(expansion, use=variant.use, progress=progress)
    if not variant.any_sign:
        learned = learn_wanted(expansion, learned, progress)
    recorded = step_features(lessons.demonstrations, lessons.episodes, lessons.around)
    return learned, Reward.brought_to_scale(learned.weights, recorded)._replace(penalty=variant.penalty)
