"""Where results that are made once are kept for later runs."""

from __future__ import annotations

import os
from pathlib import Path

from platformdirs import user_cache_path


def cache_folder() -> Path:
    """Return the folder named by ``IDM_SUMO_CACHE``, else the user's cache folder."""
    folder = os.environ.get("IDM_SUMO_CACHE")
    return Path(folder) if folder else user_cache_path("idm-sumo")
