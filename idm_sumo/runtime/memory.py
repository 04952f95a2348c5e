"""Memory of arrays that come and go: kept by the process, for whatever is given back the kernel must zero anew."""

from __future__ import annotations

import ctypes
import sys

# Of glibc's `mallopt`: never trim, no memory of its own for large arrays, one heap for all threads.
KEEP = {-1: -1, -4: 0, -8: 1}


def keep_freed_memory() -> bool:
    """Let the C library reuse what arrays leave in place of giving it back to the system, if it can; return whether it does.

    Null twins of two thousand drivers are as many copies of a third of a gigabyte: with this a diagnosis of them takes an eighth less
    time. It is for whole programs, before they start threads; elsewhere than with glibc nothing happens.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    return mallopt is not None and all(mallopt(option, value) == 1 for option, value in KEEP.items())
