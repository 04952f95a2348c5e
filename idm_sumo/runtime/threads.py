"""Compiled loops over many vehicles, shared among threads: a thread a core, pieces in turn."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

import numba
from threadpoolctl import threadpool_limits

T = TypeVar("T")
U = TypeVar("U")
P = ParamSpec("P")

PIECES = 8  # a thread: some vehicles take longer than others


def one_blas_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Let BLAS use one thread while a function runs.

    Its matrices are small: threads of the linear algebra would wait for each other, and beside
    other work they take a hundred times as long. The command line limits BLAS once for the whole
    program (:func:`idm_sumo.runtime.environment.one_blas_thread`); this is for programs that
    import us.
    """

    @functools.wraps(function)
    def limited(*args: P.args, **kwargs: P.kwargs) -> T:
        with threadpool_limits(1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def in_threads(kernel: Callable[..., Any], count: int, *arguments: Any) -> None:
    """Call ``kernel(first, last, *arguments)`` for pieces of ``range(count)`` that cover it.

    The kernel is compiled with ``nogil=True`` and writes into its own rows of the arguments,
    so the result does not depend on the pieces. Numba's ``parallel=True`` would do the same and
    takes several times longer to compile. The number of threads is numba's.
    """
    threads = numba.get_num_threads()
    if threads == 1 or count < 2 * threads:
        kernel(0, count, *arguments)
        return
    size = -(-count // (threads * PIECES))
    pool = _pool(threads, os.getpid())
    pieces = [pool.submit(kernel, first, min(first + size, count), *arguments) for first in range(0, count, size)]
    for piece in pieces:
        piece.result()


@functools.cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Return threads for kernels, made once in a ``process``: a fit of few vehicles calls kernels ten thousand times.

    Kernels call no Python, so never this: nothing in the pool waits for the pool.
    """
    return ThreadPoolExecutor(threads)


def each_in_threads(work: Callable[[T], U], items: Iterable[T]) -> list[U]:
    """Return ``work`` of each item, in their order, as many at once as numba has threads; one alone has all of them."""
    items = list(items)
    if len(items) == 1:
        return [work(items[0])]
    with ThreadPoolExecutor(numba.get_num_threads(), initializer=numba.set_num_threads, initargs=(1,)) as pool:
        return list(pool.map(work, items))
