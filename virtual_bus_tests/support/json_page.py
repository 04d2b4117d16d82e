"""Another program that runs a command with `--json`, as the page in the browser does."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import time
from collections.abc import Callable
from typing import Any

from support.bus_tool import ENVIRONMENT, argv


class Page:
    """The other program."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            argv(*words), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=ENVIRONMENT
        )
        self.told: list[dict[str, Any]] = []
        self._rest = b""

    def say(self, **line: object) -> None:
        assert self.process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it is ending
            self.process.stdin.write(json.dumps(line).encode() + b"\n")
            self.process.stdin.flush()

    def live_until(self, holds: Callable[[], bool], timeout_s: float = 40.0) -> None:
        """It says that it is alive, and takes in what it is told."""
        assert self.process.stdout is not None
        end_s = time.monotonic() + timeout_s
        while not holds():
            assert time.monotonic() < end_s, self.told
            if self.process.poll() is None:
                self.say(alive=True)
            if select.select([self.process.stdout], [], [], 0.05)[0]:
                data = os.read(self.process.stdout.fileno(), 4096)
                *lines, self._rest = (self._rest + data).split(b"\n")
                self.told += map(json.loads, lines)

    @property
    def questions(self) -> list[dict[str, Any]]:
        """Those that were asked until now."""
        return [line for line in self.told if "ask" in line]

    def ends(self) -> str:
        """What it wrote on stderr."""
        self.live_until(lambda: self.process.poll() is not None)
        assert self.process.stderr is not None
        return self.process.stderr.read().decode()
