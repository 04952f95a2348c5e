"""A reward learned from recorded drivers, and an agent.

Features and likelihood of demonstrations need nothing beyond the package's own requirements;
the environments :class:`ReplayEnv` (one vehicle, gymnasium) and :class:`ReplayVecEnv` (many side
by side, stable-baselines3) need the extra ``rl``, as training does.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from idm_sumo.irl.environment import ReplayEnv
    from idm_sumo.irl.vec_environment import ReplayVecEnv

__all__ = ["ReplayEnv", "ReplayVecEnv"]

_ROOMS = {"ReplayEnv": "idm_sumo.irl.environment", "ReplayVecEnv": "idm_sumo.irl.vec_environment"}


def __getattr__(name: str) -> Any:
    """Import an environment on first use.

    Its libraries are an extra.
    """
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_ROOMS[name]), name)
