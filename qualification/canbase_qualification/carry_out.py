"""`python -m canbase_qualification.carry_out`: carries out what `worker.py` requests, until its input ends.

A process with one thread: each run is forked in it.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import tempfile
import traceback
from dataclasses import replace
from pathlib import Path
from typing import IO

from canbase_config.profile_file import load_profile
from canbase_qualification import runs
from canbase_qualification.job import Job
from canbase_qualification.worker import BatchRequest, TrialRequest


def main() -> None:
    """Carry out requests until there are no more. Ctrl-C of a terminal is for the parent alone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    reader, writer = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what prints does not disturb the answers
    with tempfile.TemporaryDirectory(prefix="canbase-qualify-") as folder:
        while (request := _next(reader)) is not None:
            pickle.dump(_answer(request, Path(folder)), writer)
            writer.flush()


def _next(reader: IO[bytes]) -> object:
    try:
        return pickle.load(reader)
    except EOFError:
        return None


def _answer(request: object, folder: Path) -> tuple[bool, object]:
    try:
        return True, _do(request, folder)
    except Exception:  # noqa: BLE001 - it is the parent's to report
        return False, traceback.format_exc()


def _do(request: object, folder: Path) -> object:
    if isinstance(request, TrialRequest):
        return runs.trial(with_profiles(request.job, folder), request.body)
    if isinstance(request, BatchRequest):
        return [outcome.line() for outcome in runs.run(with_profiles(request.job, folder), request.batch)]
    raise TypeError(f"no request: {request!r}")


def with_profiles(job: Job, folder: Path) -> Job:
    """The same job on another computer: the user's own drive profiles are written into `folder`."""
    if not job.profiles:
        return job
    places: dict[str, str] = {}
    for number, (path, text) in enumerate(job.profiles):
        place = folder / f"{number}_{Path(path).name}"
        if not place.exists():
            place.write_text(text, encoding="utf-8")
        load_profile(str(place))
        places[path] = str(place)
    drives = tuple(
        drive.model_copy(update={"profile": places.get(drive.profile, drive.profile)}) for drive in job.robot.drives
    )
    return replace(job, robot=job.robot.model_copy(update={"drives": drives}))


if __name__ == "__main__":
    main()
