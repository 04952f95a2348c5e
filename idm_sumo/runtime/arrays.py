"""Arrays from a ``.npz`` file of strangers, within bounds."""

from __future__ import annotations

import io
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import UNPACKED, existing_file

DAMAGE = (EOFError, OSError, ValueError, KeyError, TypeError, NotImplementedError, RuntimeError, MemoryError,
          SyntaxError, RecursionError, OverflowError, zipfile.BadZipFile, zlib.error)  # fmt: skip


def read_arrays(path: Path, advice: str) -> dict[str, npt.NDArray[Any]]:
    """Return all arrays of a ``.npz`` file by name.

    Parameters
    ----------
    path : Path
    advice : str
        What to do with a file that is none.

    Raises
    ------
    InputError
        If it is no such file, is damaged, or unpacks to more than :data:`idm_sumo.runtime.inputs.UNPACKED` bytes.
    """
    existing_file(path, advice)
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if sum(member.file_size for member in members) > UNPACKED:
                raise InputError(f"{path}: unpacks to more than {UNPACKED >> 20} MB; {advice}")
            return {member.filename.removesuffix(".npy"): _array(archive.read(member)) for member in members}
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(f"{path}: not a file of arrays ({error}); {advice}") from None


def _array(content: bytes) -> npt.NDArray[Any]:
    """Return the array of one member; one that claims to be larger than its bytes is damaged."""
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream)
    size = dtype.itemsize
    for extent in shape:
        size *= int(extent)
    if dtype.hasobject or not 0 <= size <= len(content):
        raise ValueError(f"an array of {shape} {dtype} in {len(content)} bytes")
    return np.asarray(np.lib.format.read_array(io.BytesIO(content), allow_pickle=False))
