"""The population's fit copes with drivers whose rollouts are unstable."""

from __future__ import annotations

import numpy as np
import pytest

from idm_sumo.calibration.posterior import limited


def test_curvature_of_an_unstable_rollout_leaves_room_for_the_prior():
    direction = np.array([[1.0, 1.8, -0.4, 0.2, 1.5]])
    wild = 1e21 * np.einsum("ni,nj->nij", direction, direction)
    calm = np.eye(5)[None] * 3.0
    both = limited(np.concatenate([wild, calm]))
    np.testing.assert_array_equal(both[1], calm[0])
    spread = np.linalg.inv(both + np.eye(5))
    assert np.linalg.eigvalsh(spread).min() > 0.0
    across = np.array([1.8, -1.0, 0.0, 0.0, 0.0])
    assert across @ spread[0] @ across == pytest.approx(across @ across, rel=1e-3)
