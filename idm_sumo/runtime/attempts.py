"""A call that fails in one line, with its share of the machine, in a program that is known."""

from __future__ import annotations

import functools
import hashlib
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from idm_sumo.runtime.environment import fingerprint
from idm_sumo.runtime.errors import InputError, one_line

T = TypeVar("T")

STUDY = "analysis"  # below the package in a wheel, beside it in a clone


@dataclass(frozen=True)
class Failed:
    """The result of a call that failed: why, in one line."""

    reason: str


@functools.cache
def program() -> str:
    """Return which program this is: its version and a fingerprint of its sources."""
    ours = sys.modules[__name__.partition(".")[0]]
    package = Path(str(ours.__file__)).parent
    study = next((at for at in (package / STUDY, package.parent / STUDY) if at.is_dir()), None)
    sources = fingerprint(package) + (fingerprint(study) if study is not None else "")
    return f"idm-sumo {ours.__version__} (sources {hashlib.sha256(sources.encode()).hexdigest()[:12]})"


def with_threads(threads: int, function: Callable[..., T], *call: Any) -> T | Failed:
    """Compute a call with some of the machine's cores."""
    import numba

    numba.set_num_threads(min(threads, int(vars(numba.config)["NUMBA_NUM_THREADS"])))
    return attempted(function, *call)


def attempted(function: Callable[..., T], *call: Any) -> T | Failed:
    """Return the result of a call, or why it failed.

    Parameters
    ----------
    function : callable
    *call
        Its arguments.
    """
    from threadpoolctl import threadpool_limits

    try:
        with threadpool_limits(1, user_api="blas"):
            return function(*call)
    except InputError as error:
        return Failed(str(error))
    except MemoryError as error:
        return Failed(one_line(f"not enough memory ({error}); cut the recording, or give its worker more"))
    except OSError as error:
        return Failed(one_line(f"{error.filename or ''} {error.strerror or error}"))
    except Exception as error:
        return Failed(one_line(f"a defect of {program()}, please report it: {type(error).__name__}: {error}"))
