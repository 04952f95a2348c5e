r"""How probable it is that a cause is the one that is named, and neither another one nor nothing.

With an estimate of variance :math:`V`, :math:`z^2 = \hat\beta^2/V` and a magnitude :math:`\beta \sim N(0, W)`, :math:`W` the squared
typical size, the logarithm of the Bayes factor against nothing is

.. math:: \tfrac12 \ln\frac{V}{V+W} + \tfrac12 z^2 \frac{W}{V+W}

References
----------
Wakefield (2009), Bayes factors for genome-wide association studies.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.special import logsumexp

from idm_sumo.diagnosis import hypotheses as hy
from idm_sumo.diagnosis.choice import Accepted
from idm_sumo.diagnosis.hypotheses import Candidate

NOTHING = 0.5  # prior probability that there is nothing; all effects together have the rest


def probability(cause: Accepted, others: Iterable[Candidate]) -> float:
    """Return the probability of a cause beside other effects.

    Parameters
    ----------
    cause : Accepted
        Its evidence is what it is likelier by at its size, or its score near zero if that says more.
    others : iterable of Candidate
        Effects, each in its best form, that are in no model yet.

    Returns
    -------
    float
        Shared with the effects that cannot be told from it.
    """
    rivals = [c for c in others if c.name != cause.candidate.name]
    own = log_bayes_factor(cause.candidate, max(cause.candidate.z**2, cause.tried.support))
    each = np.array([own, *(log_bayes_factor(c, c.z**2 if c.is_possible else 0.0) for c in rivals)])
    prior = np.log((1.0 - NOTHING) / len(each))
    whole = logsumexp([*(each + prior), np.log(NOTHING)])
    return float(np.exp(own + prior - whole)) / (1 + len(cause.rivals))


def log_bayes_factor(candidate: Candidate, z2: float) -> float:
    """Return the logarithm of an effect's Bayes factor against nothing, for so large a squared z."""
    slab = hy.acting_of(candidate)[0].typical ** 2
    keep = slab / (candidate.error**2 + slab)
    return float(0.5 * np.log1p(-keep) + 0.5 * z2 * keep)
