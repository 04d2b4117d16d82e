"""The parent's end of a process that carries out batches: `carry_out.py`.

That process has one thread, so a run can be forked in it; whoever has threads starts one. Requests
and answers are pickled values on its standard input and output: the same canbase at both ends.
"""

from __future__ import annotations

import os
import pickle
import subprocess
from dataclasses import dataclass
from typing import Any

from canbase_qualification.job import Batch, Job
from canbase_runtime.own_modules import module_command


class WorkerDiedError(RuntimeError):
    """The process ended in the middle of its work: it was killed, or the computer has no memory left."""


class WorkError(RuntimeError):
    """What was requested raised, with its traceback."""


@dataclass(frozen=True, slots=True)
class TrialRequest:
    """What does the base drive at full speed, with the body of this number?"""

    job: Job
    body: int


@dataclass(frozen=True, slots=True)
class BatchRequest:
    """Carry it out."""

    job: Job
    batch: Batch


class Worker:
    """The parent's end. One thread at a time may use it."""

    def __init__(self) -> None:
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}  # each fork would end numpy's threads
        self._process = subprocess.Popen(
            module_command("canbase_qualification.carry_out"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
        )

    def trial(self, job: Job, body: int) -> tuple[float, str]:
        """As runs.trial. WorkError: the drives cannot be enabled. WorkerDiedError."""
        speed_mps, why = self._ask(TrialRequest(job, body))
        return float(speed_mps), str(why)

    def run(self, job: Job, batch: Batch) -> list[str]:
        """The lines of the outcomes. WorkError: something raised outside of the runs. WorkerDiedError."""
        return [str(line) for line in self._ask(BatchRequest(job, batch))]

    def close(self) -> None:
        """End it, also in the middle of its work."""
        self._process.kill()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()
        self._process.wait()

    def _ask(self, request: object) -> Any:
        reader, writer = self._process.stdout, self._process.stdin
        assert reader is not None
        assert writer is not None
        try:
            pickle.dump(request, writer)
            writer.flush()
            done, answer = pickle.load(reader)
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            code = self._process.wait()
            how = f"by signal {-code}" if code < 0 else f"with exit code {code}"
            raise WorkerDiedError(f"a worker process ended {how}") from error
        if not done:
            raise WorkError(str(answer))
        return answer
