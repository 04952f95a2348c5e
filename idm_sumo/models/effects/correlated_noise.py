r"""Correlated noise: the acceleration varies at random.

.. math:: d\eta = -\eta\,dt/\tau + \sigma\sqrt{2/\tau}\,dW

The noise explains no bias. So a diagnosis models it (as the covariance of the residuals and the
noise of the null replicates) and does not name it as a cause.
"""

from __future__ import annotations

from idm_sumo.models.effects.record import Effect

EFFECT = Effect(
    name="correlated_noise",
    summary="acceleration varies at random, without any bias",
    parameters=(),
    required_stimuli=(),
    confusable_with=(),
    source="Treiber, Kesting and Helbing (2006), Physica A 360",
    sumo="EIDM's sigmaerror, sigmagap, sigmaleader",
    untestable="modelled in the residuals' covariance and the null replicates; it makes no bias",
)
