"""The processes of one robot, started and ended together. Used by `canbase up` and `canbase demo`.

Each part is a process of its own that gets SIGTERM when this one dies, however it dies. The order of the end: who
commands ends first, who stops the robot last.
"""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Final

START_ORDER: Final = ("sim", "watchdog", "velocity", "driver", "action-server")
END_ORDER: Final = ("action-server", "velocity", "driver", "watchdog", "sim")
GRACE_S: Final = 10.0
"""A part that still runs so long after SIGTERM is killed; the driver needs the time of its ramp."""
POLL_S: Final = 0.02
_PR_SET_PDEATHSIG: Final = 1
_LIBC = ctypes.CDLL(None, use_errno=True)


@dataclass(frozen=True, slots=True)
class Death:
    """A part that ended by itself. `exit_code` is negative when a signal ended it."""

    part: str
    exit_code: int

    def __str__(self) -> str:
        how = f"was ended by {signal.Signals(-self.exit_code).name}" if self.exit_code < 0 else "ended by itself"
        return f"{self.part} {how}" + (f" with exit code {self.exit_code}" if self.exit_code >= 0 else "")


class Stack:
    """Runs the parts. `logs`: a folder for their output, one file each; None: they write to this terminal."""

    def __init__(
        self,
        config: Path,
        *,
        namespace: str = "",
        sim: bool,
        ros_args: Sequence[str] = (),
        logs: Path | None = None,
        env: Mapping[str, str] | None = None,
    ) -> None:
        self._options = ["--config", str(config), *(["--namespace", namespace] if namespace else [])]
        self._ros_args = list(ros_args)
        self._parts = [part for part in START_ORDER if sim or part != "sim"]
        self._logs = logs
        self._env = None if env is None else dict(env)
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of the parts that were started."""
        return {part: process.pid for part, process in self._running.items()}

    def start(self) -> None:
        """Starts all parts; they find each other by themselves, in whatever order they get ready."""
        for part in self._parts:
            self._running[part] = self._spawn(part)

    def death(self) -> Death | None:
        """The first part found that has ended, None while all run."""
        for part, process in self._running.items():
            code = process.poll()
            if code is not None:
                return Death(part, code)
        return None

    def stop(self) -> dict[str, int]:
        """Ends all parts in order, the robot standing; exit codes. A part that does not end in time is killed."""
        codes = {}
        for part in END_ORDER:
            process = self._running.pop(part, None)
            if process is not None:
                codes[part] = _end(process)
        return codes

    def log(self, part: str) -> str:
        """What a part has written, where output goes to files."""
        return "" if self._logs is None else (self._logs / f"{part}.log").read_text(errors="replace")

    def _spawn(self, part: str) -> subprocess.Popen[bytes]:
        argv = [sys.executable, "-m", "canbase_cli", part, *self._options]
        if self._ros_args and part not in ("sim", "watchdog"):
            argv += self._ros_args
        if self._logs is None:
            return self._popen(argv, None)
        with (self._logs / f"{part}.log").open("wb") as log:
            return self._popen(argv, log)

    def _popen(self, argv: list[str], log: IO[bytes] | None) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            argv,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=None if log is None else subprocess.STDOUT,
            preexec_fn=_as_child,
            env=self._env,
        )


def _as_child() -> None:
    """In the child: a session of its own, so that Ctrl-C reaches the parent alone; SIGTERM when the parent dies."""
    os.setsid()
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)


def _end(process: subprocess.Popen[bytes]) -> int:
    deadline = time.monotonic() + GRACE_S
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.terminate()
    while process.poll() is None and time.monotonic() < deadline:
        time.sleep(POLL_S)
    if process.poll() is None:
        process.kill()
    return process.wait()
