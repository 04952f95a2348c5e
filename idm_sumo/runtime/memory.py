"""Reuse of freed memory, which saves time, and large values that are passed on and not kept."""

from __future__ import annotations

import ctypes
import sys
from typing import Generic, TypeVar

T = TypeVar("T")

# Options of glibc's `mallopt`: never trim, no separate mapping of large arrays, one heap for all threads.
KEEP = {-1: -1, -4: 0, -8: 1}


def keep_freed_memory() -> bool:
    """Let the C library keep freed memory for reuse.

    Large arrays that come and go are otherwise returned to the system, which must clear every new page. A
    diagnosis of two thousand drivers runs about an eighth faster this way. Call it in whole programs,
    before they start threads.

    Returns
    -------
    bool
        Whether it worked; only glibc supports it.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    return mallopt is not None and all(mallopt(option, value) == 1 for option, value in KEEP.items())


class Handed(Generic[T]):
    """A large value that a caller passes on without keeping it.

    An argument lives as long as its caller's own name for it; what is taken out of this lives no longer than the
    function that took it needs it.

    Examples
    --------
    >>> held = Handed([1, 2])
    >>> held.take()
    [1, 2]
    """

    def __init__(self, value: T) -> None:
        self._values = [value]

    def take(self) -> T:
        """Return the value, once."""
        return self._values.pop()
