"""Work in several processes, which end when the one they work for is gone."""

from __future__ import annotations

import functools
import multiprocessing
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any, Generic, ParamSpec, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")

LOOK = 0.5  # s, between two looks whether the parent lives


class _Owned(Generic[P, T]):
    """A function that, called in a worker process, first lets that process end with ours."""

    def __init__(self, function: Callable[P, T]) -> None:
        self.function, self.parent, self.host = function, os.getpid(), socket.gethostname()

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        if self.host == socket.gethostname() and self.parent != os.getpid():
            end_with(self.parent)
        return self.function(*args, **kwargs)


def in_processes(
    jobs: int, calls: Iterable[tuple[Any, ...]], function: Callable[..., T], **options: Any
) -> Iterator[T]:
    """Yield ``function(*call)`` of each call, in order, computed by ``jobs`` processes.

    Parameters
    ----------
    jobs : int
    calls : iterable of tuple
        Arguments; keyword arguments go into ``function`` by :func:`functools.partial`.
    function : callable
    options
        Of :class:`joblib.Parallel`. Without ``backend`` joblib's current one counts, so that
        ``joblib.parallel_config(backend="dask")`` spreads the calls over machines.
    """
    import joblib

    parallel = joblib.Parallel(n_jobs=jobs, return_as="generator", **options)
    owned = joblib.delayed(_Owned(function))
    return cast("Iterator[T]", parallel(owned(*call) for call in calls))


def beside(function: Callable[[], T]) -> Future[T]:
    """Call a function in another process; wait with ``.result()``."""
    pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=end_with, initargs=(os.getpid(),))
    future = pool.submit(function)
    pool.shutdown(wait=False)  # ends once it is done
    return future


@functools.cache
def end_with(parent: int) -> None:
    """End this process when ``parent``, whose child it is, has gone, however that ended.

    A worker of a killed program would finish its task and then wait for the next one: joblib's
    for minutes, those of :mod:`concurrent.futures` for ever. A worker that was not started by
    ``parent``, as dask's, stays. An interrupt from the keyboard is the parent's to handle.
    """
    started_by = multiprocessing.parent_process()
    if started_by is None or started_by.pid != parent:
        return
    if os.getppid() != parent:  # killed before our first task; until somebody asks for its end its number exists
        os._exit(1)
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_watch, args=(parent,), daemon=True, name="end with the parent").start()


def stop_workers() -> None:
    """End every worker process now: after an interrupt nobody waits for its result."""
    for process in multiprocessing.active_children():
        process.kill()
    if "joblib.externals.loky" in sys.modules:
        from joblib.externals.loky import reusable_executor

        executor = reusable_executor._executor
        if executor is not None:
            executor.shutdown(wait=False, kill_workers=True)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)
