"""Independent calls, computed here, by several processes, or by the workers of a dask cluster: one way for all."""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import closing, contextmanager
from typing import Any, Protocol, TypeVar

from idm_sumo.runtime.attempts import Failed, attempted, with_threads
from idm_sumo.runtime.cluster import KILLED, Cluster, client_of, refuse_others
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.workers import end_with

T = TypeVar("T")

ATTEMPTS = 3  # that a call has if its worker is killed; a dask scheduler grants as many
LOOK = 5.0  # s, after which workers that have joined since get work too


class Crew(Protocol):
    """Those who compute calls."""

    def width(self) -> int:
        """Return how many calls they compute at once."""

    def submit(self, function: Callable[..., Any], *call: Any) -> Future[Any]:
        """Have one call computed."""

    def once(self, function: Callable[[], object]) -> None:
        """Call a function on every machine, and wait for it."""


def spread(
    function: Callable[..., T],
    calls: Iterable[tuple[Any, ...]],
    *,
    jobs: int = 1,
    cluster: str | None = None,
    warm: Callable[[], object] | None = None,
) -> Generator[tuple[int, T | Failed], None, None]:
    """Yield the number and the result of each call as they are done.

    A call whose worker is killed is computed again by another, :data:`ATTEMPTS` times in all. It gets its
    worker's share of the cores, and one thread of BLAS.

    Parameters
    ----------
    function : callable
        Of a module, so that workers find it.
    calls : iterable of tuple
        Its arguments. They and the results travel between machines: paths and tables, not recordings.
    jobs : int
        Processes on this machine; one is this process itself.
    cluster : str, optional
        Address of a dask scheduler, whose workers compute instead.
    warm : callable, optional
        Compiles kernels; called once on every machine before the others begin.

    Raises
    ------
    InputError
        If there is no scheduler at the address, it has no workers, or one has another version of this program.
    """
    waiting = deque((number, call, 1) for number, call in enumerate(calls))
    running: dict[Future[Any], tuple[int, tuple[Any, ...], int]] = {}
    if not waiting:
        return
    with _crew(min(jobs, len(waiting)), cluster) as crew:
        if warm is not None:
            crew.once(warm)
        while waiting or running:
            while waiting and len(running) < crew.width():
                task = waiting.popleft()
                running[crew.submit(function, *task[1])] = task
            for future in wait(running, timeout=LOOK, return_when=FIRST_COMPLETED).done:
                number, call, attempt = running.pop(future)
                try:
                    yield number, future.result()
                except BrokenExecutor:
                    if attempt < ATTEMPTS:
                        waiting.appendleft((number, call, attempt + 1))
                    else:
                        yield number, Failed(KILLED)


def gathered(
    function: Callable[..., T],
    calls: Iterable[tuple[Any, ...]],
    *,
    jobs: int = 1,
    cluster: str | None = None,
    done: Callable[[int], object] = lambda _: None,
) -> list[T]:
    """Return the results of calls that belong together, in their order.

    Parameters
    ----------
    function, calls, jobs, cluster
        As of :func:`spread`.
    done : callable
        Called with the number of results whenever one more is there.

    Raises
    ------
    InputError
        If a call fails, at once: the others are given up. And as :func:`spread` does.
    """
    found: dict[int, T] = {}
    with closing(spread(function, calls, jobs=jobs, cluster=cluster)) as results:
        for number, result in results:
            if isinstance(result, Failed):
                raise InputError(result.reason)
            found[number] = result
            done(len(found))
    return [found[number] for number in sorted(found)]


@contextmanager
def _crew(jobs: int, cluster: str | None) -> Iterator[Crew]:
    """Yield those who compute, ready, and dismiss them in the end."""
    if cluster is None:
        team = _Processes(jobs) if jobs > 1 else _Here()
        try:
            yield team
        finally:
            team.dismiss()
    else:
        with client_of(cluster) as client:
            refuse_others(client, cluster)
            yield Cluster(client, cluster)


class _Here:
    """Our own process, one call at a time."""

    def width(self) -> int:
        return 1

    def submit(self, function: Callable[..., Any], *call: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(attempted(function, *call))
        return done

    def once(self, function: Callable[[], object]) -> None:
        """Nothing is gained by compiling before the first call."""

    def dismiss(self) -> None:
        pass


class _Processes:
    """Processes of this machine, each a pool of its own, so that one that is killed takes no other call with it."""

    def __init__(self, jobs: int) -> None:
        self.jobs, self.threads = jobs, max(1, (os.cpu_count() or 1) // jobs)
        self.idle: list[Any] = []
        self.busy: dict[Future[Any], Any] = {}

    def width(self) -> int:
        return self.jobs

    def submit(self, function: Callable[..., Any], *call: Any) -> Future[Any]:
        self.idle += [self.busy.pop(done) for done in list(self.busy) if done.done() and not _broken(done)]
        pool = self.idle.pop() if self.idle else _process()
        future: Future[Any] = pool.submit(with_threads, self.threads, function, *call)
        self.busy[future] = pool
        return future

    def once(self, function: Callable[[], object]) -> None:
        if not _broken(warming := self.submit(function)):
            warming.result()

    def dismiss(self) -> None:
        """End all processes, those that still compute what nobody waits for at once."""
        for future, pool in self.busy.items():
            for process in () if future.done() else list(pool._processes.values()):
                process.kill()
        for pool in (*self.idle, *self.busy.values()):
            pool.shutdown(wait=False, cancel_futures=True)


def _broken(future: Future[Any]) -> bool:
    return isinstance(future.exception(), BrokenExecutor)


def _process() -> Any:
    spawn = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(1, spawn, initializer=end_with, initargs=(os.getpid(),))
