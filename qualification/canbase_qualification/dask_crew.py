"""Worker processes on other computers: batches as tasks of a dask cluster (docs/qualify.md).

A dask worker has threads, and a run must be forked in a process that has none: the task starts a worker process as a
crew on this computer does, and keeps it for the next task of the same thread. When the dask worker dies, its process
loses its input and ends; dask hands the batch to another worker. A batch comes out the same wherever it runs.
"""

from __future__ import annotations

import atexit
import logging
import threading
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, Final

from canbase_qualification.crew import CrewError, Done
from canbase_qualification.job import Batch, Job
from canbase_qualification.outcome import Outcome
from canbase_qualification.software import Software, software
from canbase_qualification.worker import Worker, WorkerDiedError

if TYPE_CHECKING:
    from distributed import Client, Future

AHEAD: Final = 3
"""So many tasks for each thread of the cluster are with the scheduler: a worker never waits, and memory is bounded."""
CONNECT_S: Final = 10.0
WORKERS_S: Final = 30.0
"""A cluster without a worker is refused after this time."""
LOGGERS: Final = ("distributed", "asyncio", "tornado")
"""What they log of a cluster that fails is raised here as well, without tracebacks."""
_of_thread = threading.local()


class OtherSoftwareError(RuntimeError):
    """A worker of the cluster has another canbase than this computer."""


def carry_out(wanted: Software, job: Job, batch: Batch) -> list[str]:
    """On a worker of the cluster: the lines of the outcomes. OtherSoftwareError; WorkError; WorkerDiedError."""
    if software() != wanted:
        raise OtherSoftwareError(f"a worker has {software()}, and this computer has {wanted}")
    worker: Worker | None = getattr(_of_thread, "worker", None)
    if worker is None:
        worker = _of_thread.worker = Worker()
        atexit.register(worker.close)
    try:
        return worker.run(job, batch)
    except WorkerDiedError:
        _of_thread.worker = None
        raise


class DaskCrew:
    """As a context. Its tasks are cancelled with it."""

    def __init__(self, address: str) -> None:
        """`address`: of the scheduler, `tcp://host:8786`. CrewError: nobody answers there, or its canbase differs."""
        from distributed import Client

        for name in [*logging.root.manager.loggerDict]:
            if name.partition(".")[0] in LOGGERS:
                logging.getLogger(name).setLevel(logging.CRITICAL)
        try:
            self._client: Client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            raise CrewError(f"--scheduler {address}: no dask scheduler answers there ({error})") from error
        try:
            self._check(address)
        except BaseException:
            self._client.close()
            raise

    def __enter__(self) -> DaskCrew:
        return self

    def __exit__(self, *error: object) -> None:
        self._client.close()

    def results(self, job: Job, batches: Iterable[Batch]) -> Iterator[Done]:
        """As they are ready, in any order. CrewError; OtherSoftwareError; WorkError."""
        from distributed import as_completed

        todo = iter(batches)
        waiting: dict[object, Batch] = {}
        done = as_completed(loop=self._client.loop)
        while True:
            for batch in islice(todo, max(0, self._ahead - len(waiting))):
                future = self._client.submit(carry_out, software(), job, batch, pure=False)
                waiting[future.key] = batch
                done.add(future)
            if not waiting:
                return
            future = next(done)
            yield Done(waiting.pop(future.key), tuple(map(Outcome.of_line, self._result(future))))

    @staticmethod
    def _result(future: Future[list[str]]) -> list[str]:
        from distributed import CancelledError, KilledWorker

        try:
            return list(future.result())
        except KilledWorker as error:
            raise CrewError(f"several workers of the cluster died with the same batch ({error})") from error
        except CancelledError as error:
            raise CrewError("the scheduler of the cluster has ended, or cannot be reached any more") from error
        except OtherSoftwareError as error:
            raise CrewError(f"{error}: results of both do not belong together") from error

    @property
    def _ahead(self) -> int:
        threads: dict[str, int] = self._client.nthreads()
        return AHEAD * max(1, sum(threads.values()))

    def _check(self, address: str) -> None:
        """Every worker has the same canbase. One that comes later is checked with its first task."""
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except TimeoutError as error:
            raise CrewError(f"--scheduler {address}: it has no worker; start one: dask worker {address}") from error
        try:
            found = self._client.run(software)
        except ModuleNotFoundError as error:
            raise CrewError(f"--scheduler {address}: a worker has no canbase ({error}): install it there") from error
        for worker, other in found.items():
            if other != software():
                raise CrewError(
                    f"--scheduler {address}: the worker {worker} has {other}, and this computer has {software()}. "
                    "Results of both do not belong together: install the same version everywhere"
                )
