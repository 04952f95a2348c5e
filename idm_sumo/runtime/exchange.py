"""Put a finished folder in the place of another in one step."""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from pathlib import Path

from idm_sumo.runtime.siblings import old_name, remove

AT_FDCWD, RENAME_EXCHANGE = -100, 2  # of Linux's renameat2
NOT_THERE = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP, errno.EPERM)  # kernel, file system or container lacks it


def put_in_place(part: Path, target: Path) -> None:
    """Give a finished folder its name; what had that name is at ``part`` afterwards.

    At every moment ``target`` is the old folder or the new one, whole. Where the system cannot
    exchange two names in one step, the old folder steps aside and comes back if anything
    happens; if the program is killed in that moment, :func:`bring_back` puts it right.
    """
    if not os.path.lexists(target):
        os.rename(part, target)
        return
    if exchange(part, target):
        return
    aside = old_name(part)
    try:
        os.rename(target, aside)
        os.rename(part, target)
    except BaseException:
        if os.path.lexists(aside) and not os.path.lexists(target):
            os.rename(aside, target)
        raise
    remove(aside)


def exchange(one: Path, other: Path) -> bool:
    """Exchange two names atomically; return False where the system cannot.

    Raises
    ------
    OSError
        If it can, but not these two.
    """
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None) if sys.platform == "linux" else None
    if renameat2 is None:
        return False
    if renameat2(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in NOT_THERE:
        return False
    raise OSError(code, os.strerror(code), str(other))
