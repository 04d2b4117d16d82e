"""Worker processes on this computer: each has a thread here, which hands it one batch after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from queue import Empty, Queue
from threading import Event, Lock, Thread
from typing import Final

from canbase_qualification.job import Batch, Job
from canbase_qualification.outcome import Outcome
from canbase_qualification.worker import Worker, WorkerDiedError

TRIES: Final = 3
"""A batch whose process dies is tried so often, each time in a new one."""


class CrewError(RuntimeError):
    """A batch cannot be carried out: a sentence."""


@dataclass(frozen=True, slots=True)
class Done:
    """A batch with its outcomes."""

    batch: Batch
    outcomes: tuple[Outcome, ...]


class LocalCrew:
    """As a context: its processes end with it, also in the middle of a batch."""

    def __init__(self, workers: int) -> None:
        self._count = workers
        self._stopped, self._lock = Event(), Lock()
        self._workers: list[Worker] = []

    def __enter__(self) -> LocalCrew:
        return self

    def __exit__(self, *error: object) -> None:
        self._stopped.set()
        with self._lock:
            for worker in self._workers:
                worker.close()

    def results(self, job: Job, batches: Iterable[Batch]) -> Iterator[Done]:
        """As they are ready, in any order. CrewError; WorkError: something raised outside of the runs."""
        todo: Queue[Batch] = Queue()
        done: Queue[Done | Exception] = Queue()
        for batch in batches:
            todo.put(batch)
        count = todo.qsize()
        threads = [Thread(target=self._work, args=(job, todo, done), daemon=True) for _ in range(self._count)]
        for thread in threads:
            thread.start()
        for _ in range(count):
            found = done.get()
            if isinstance(found, Exception):
                raise found
            yield found

    def _work(self, job: Job, todo: Queue[Batch], done: Queue[Done | Exception]) -> None:
        try:
            self._take(job, todo, done)
        except Exception as error:  # noqa: BLE001 - the caller's thread raises it
            done.put(error)

    def _take(self, job: Job, todo: Queue[Batch], done: Queue[Done | Exception]) -> None:
        worker = self._new()
        while not self._stopped.is_set():
            try:
                batch = todo.get_nowait()
            except Empty:
                return
            for attempt in range(TRIES):
                try:
                    lines = worker.run(job, batch)
                    break
                except WorkerDiedError as error:
                    if self._stopped.is_set():
                        return
                    if attempt == TRIES - 1:
                        raise CrewError(_dies(batch, error)) from error
                    worker = self._new()
            done.put(Done(batch, tuple(Outcome.of_line(line) for line in lines)))

    def _new(self) -> Worker:
        with self._lock:
            worker = Worker()
            self._workers.append(worker)
        return worker


def _dies(batch: Batch, error: WorkerDiedError) -> str:
    return (
        f"{error}, {TRIES} times with the {batch.kind}s {batch.seeds[0]} to {batch.seeds[-1]}. Is there memory left "
        "(about 200 MB a worker)? --workers 1 needs the least"
    )


def trial(job: Job, body: int) -> tuple[float, str]:
    """As runs.trial, in a process of its own."""
    with closing(Worker()) as worker:
        return worker.trial(job, body)
