"""What drivers do beyond the IDM: one file an effect, one compiled acceleration for all of them.

How to drive with an extended model, step by step (0.1 s):

1. ``model = ExtendedModel.read(path)``; ``m = model.magnitudes_by_lane()[lane]`` (row 0: no lane limits). Where only some drivers
   have a cause (``model.share`` is below 1), those without it drive by ``model.of_others()``; ``model.who_has`` says who, where no table does.
2. Per vehicle keep ``past``, float64 of shape ``(rows, 3)``: gap (m, infinite without a leader), speed, approach
   rate (m/s), one row a step, the first rows from the recorded twin's observed frames, so that a delay has something to recall
   (:data:`reaction_delay.LONGEST` seconds are enough). A rollout may keep all its steps.
3. Per step write row ``now`` and act on the gap, own speed and approach rate of
   ``acted_on(past, now, m, 0.1)``: without a delay those of row ``now``. Where the leader is another
   one than at row ``now - 1`` and ``knows_new_leader(m)``, first ``follow_another(past[:, 0], past[:, 1], past[:, 2], now, 0.1)``.
4. Fill a :class:`Sight` (unknown fields NaN: the effect that needs them is then silent; ``BLIND`` is all NaN) and call
   ``extended_acceleration(speed, approach_rate, gap, see, a, b, T, d0, d1, desired_speed, m)``: a plain njit function,
   callable from compiled loops and, slower, from Python.

``Sight.t`` is the time since the first frame of the recording's period. What each cause must see is in its
:class:`Effect` record (``must_see``), as is how plain SUMO can express it (``sumo``, None if only the Python-driven loop can).
Events that lie ahead (``until_cut_in``, ``until_own_change``) are known in replay only: in a closed loop they are NaN.
``jump`` is the old gap minus the new one (m) at the last change of leader, both at the moment of the change, ``accepted_headway`` what
:func:`~idm_sumo.models.effects.lane_change_relaxation.headway_after` makes of the new one and the speed;
``adjacent_speed`` the mean speed of the vehicles within :data:`~idm_sumo.models.effects.adjacent_lane_friction.BESIDE` m in the slower of the adjacent lanes,
``next_beside_speed`` that of the slower of the next vehicles there, up to :data:`~idm_sumo.models.effects.adjacent_lane_friction.AHEAD` m ahead;
``leader_acceleration_of_late`` the leader's mean acceleration over the last :data:`~idm_sumo.models.effects.hysteresis.OF_LATE` s, or since it came.
"""

from idm_sumo.models.effects.acceleration import BLIND, Sight, extended_acceleration
from idm_sumo.models.effects.catalogue import BY_NAME, CATALOGUE
from idm_sumo.models.effects.extended_model import Cause, ExtendedModel
from idm_sumo.models.effects.record import Effect, Parameter, in_words

__all__ = [
    "BLIND",
    "BY_NAME",
    "CATALOGUE",
    "Cause",
    "Effect",
    "ExtendedModel",
    "Parameter",
    "Sight",
    "extended_acceleration",
    "in_words",
]
