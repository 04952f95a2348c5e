"""The workers of a dask scheduler: reached, held against this program, given calls."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from typing import Any, TypeVar

from idm_sumo.runtime.attempts import Failed, program, with_threads
from idm_sumo.runtime.errors import InputError, one_line

T = TypeVar("T")

KILLED = "its worker was killed each time, most often for want of memory; give its worker more, or cut the recording"
SEEN = "all machines of a cluster must see the folder of results under this path"
PATIENCE = 10  # s, in which a scheduler answers

_one_at_a_time = threading.Lock()  # a worker's threads serve one recording, as its memory does


class Cluster:
    """The workers of a dask scheduler, one call each at a time."""

    def __init__(self, client: Any, address: str) -> None:
        self.client, self.address = client, address
        self.executor = client.get_executor(pure=False)

    def width(self) -> int:
        """Return how many workers there are now."""
        return max(1, len(self.client.nthreads()))

    def submit(self, function: Callable[..., Any], *call: Any) -> Future[Any]:
        """Have a call computed by whichever worker is free, and by another one if that is killed."""
        submitted: Future[Any] = self.executor.submit(_on_worker, program(), function, *call)
        ended: Future[Any] = Future()
        submitted.add_done_callback(lambda done: self._pass_on(done, ended))
        return ended

    def _pass_on(self, done: Future[Any], ended: Future[Any]) -> None:
        """Say in our words how a call ended."""
        try:
            ended.set_result(done.result())
        except CancelledError:
            gone = f"--cluster {self.address}: the scheduler has gone; what is done is kept, run the same command again"
            ended.set_exception(InputError(gone))
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                ended.set_result(Failed(KILLED))
            else:
                ended.set_exception(error)

    def once(self, function: Callable[[], object]) -> None:
        """Call a function on one worker of every machine: workers of a machine share what they compile."""
        hosts = {worker.rpartition(":")[0]: worker for worker in self.client.nthreads()}
        self.client.run(function, workers=list(hosts.values()))


@contextmanager
def client_of(address: str) -> Iterator[Any]:
    """Yield a client of a scheduler."""
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError:
        raise InputError("--cluster needs dask.distributed; `pip install 'idm-sumo[cluster]'` brings it") from None
    try:
        with socket.create_connection(get_address_host_port(address), PATIENCE):
            pass  # somebody listens; a client that finds nobody would complain in many lines
        client: Any = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:  # a time that is over is an OSError
        why = one_line(str(error))[:150] or type(error).__name__
        raise InputError(
            f"--cluster {address}: no dask scheduler answers there ({why}); start `dask scheduler`, and workers"
        ) from None
    with client:
        yield client


def check_cluster(address: str) -> None:
    """Raise unless calls can be computed there, before other work that would be in vain.

    Parameters
    ----------
    address : str
        Of a dask scheduler.

    Raises
    ------
    InputError
        As :func:`client_of` and :func:`refuse_others` do.
    """
    with client_of(address) as client:
        refuse_others(client, address)


def refuse_others(client: Any, address: str) -> None:
    """Raise unless there are workers, and all have this program in this version."""
    programs = client.run(program, on_error="return")
    if not programs:
        raise InputError(f"--cluster {address}: it has no workers; start some with `dask worker {address}`")
    for worker, theirs in programs.items():
        if theirs != program():
            what = theirs if isinstance(theirs, str) else "no idm-sumo, or another one"
            raise _other_program(worker, what, program())


def _other_program(worker: str, theirs: str, ours: str) -> InputError:
    return InputError(f"worker {worker} has {theirs} where this is {ours}; install the same there, and start it again")


def _on_worker(expected: str, function: Callable[..., T], *call: Any) -> T | Failed:
    """Compute a call on a dask worker, which may have joined after all others were asked for their version."""
    from distributed import get_worker

    worker = get_worker()
    if expected != program():
        raise _other_program(f"{worker.address} on {socket.gethostname()}", program(), expected)
    with _one_at_a_time:
        return with_threads(worker.state.nthreads, function, *call)
