"""The folder of results that later runs reuse."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path

from idm_sumo.runtime.environment import is_writable, temporary_cache


def cache_folder() -> Path:
    """Return the folder of reusable results.

    Returns
    -------
    Path
        The one named by the environment variable ``IDM_SUMO_CACHE``, else the user's cache folder,
        else one among the temporary files.
    """
    if folder := os.environ.get("IDM_SUMO_CACHE"):
        return Path(folder)
    users = user_cache_path("idm-sumo")
    return users if is_writable(users) else temporary_cache()
