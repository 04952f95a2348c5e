"""The folder of results that later runs reuse."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable
from pathlib import Path

from platformdirs import user_cache_path

from idm_sumo.runtime.environment import is_writable, temporary_cache
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file

VARIABLE = "IDM_SUMO_CACHE"


def cache_folder() -> Path:
    """Return the folder of reusable results.

    Returns
    -------
    Path
        The one named by the environment variable ``IDM_SUMO_CACHE``, else the user's cache folder,
        else one among the temporary files.

    Raises
    ------
    InputError
        If the variable names a file.
    """
    if named := os.environ.get(VARIABLE):
        folder = Path(named)
        above = next(parent for parent in (folder, *folder.absolute().parents) if os.path.lexists(parent))
        if not above.is_dir():
            raise InputError(f"{VARIABLE}: {above} is not a folder; name a folder, or unset it")
        return folder
    users = user_cache_path("idm-sumo")
    return users if is_writable(users) else temporary_cache()


def kept(name: str, ending: str, made_of: object, write: Callable[[Path], None]) -> Path:
    """Return a file of the cache, written if it is not there.

    Parameters
    ----------
    name, ending : str
        What stands before and after the digest of what it is made of; folders may be part of the name.
    made_of : object
        All that the content depends on, as JSON can hold it.
    write : callable
        Writes the file to the path that it is given.

    Returns
    -------
    Path
        Of the whole file.
    """
    digest = hashlib.sha256(json.dumps(made_of).encode()).hexdigest()[:16]
    path = cache_folder() / f"{name}-{digest}{ending}"
    if not path.is_file():
        with new_file(path) as part:
            write(part)
    return path
