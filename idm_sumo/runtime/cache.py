"""The folder of results that later runs reuse."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path


def cache_folder() -> Path:
    """Return the folder of reusable results.

    Returns
    -------
    Path
        The one named by the environment variable ``IDM_SUMO_CACHE``, else the user's cache folder.
    """
    folder = os.environ.get("IDM_SUMO_CACHE")
    return Path(folder) if folder else user_cache_path("idm-sumo")
