"""A canbase command on a terminal of its own, as a person has it before them: keys go in, what it shows comes out."""

from __future__ import annotations

import os
import pty
import select
import subprocess
import time
from collections.abc import Callable

from support.bus_tool import ENVIRONMENT, argv

KEY_PERIOD_S = 0.03
"""As a keyboard repeats a key that is held."""


class Terminal:
    """The process, and both ends of its terminal. Close it."""

    def __init__(self, *words: str) -> None:
        self._keyboard, terminal = pty.openpty()
        self.shown = ""
        self.process = subprocess.Popen(
            argv(*words),
            stdin=terminal,
            stdout=terminal,
            stderr=subprocess.STDOUT,
            env=ENVIRONMENT,
            start_new_session=True,
        )
        os.close(terminal)

    def press(self, keys: str) -> None:
        """These keys, at once."""
        os.write(self._keyboard, keys.encode())

    def read_until(self, text: str, timeout_s: float = 40.0) -> None:
        """Wait until this was shown since the last one that was waited for."""
        end = time.monotonic() + timeout_s
        while text not in self.shown:
            assert time.monotonic() < end, self.shown
            assert self._read(0.1) or self.process.poll() is None, self.shown
        self.shown = self.shown.partition(text)[2]

    def hold(self, key: str, until: Callable[[], bool], timeout_s: float = 20.0) -> None:
        """A key that is held until something is so."""
        end = time.monotonic() + timeout_s
        while not until():
            assert time.monotonic() < end, self.shown
            self.press(key)
            self._read(KEY_PERIOD_S)
            time.sleep(KEY_PERIOD_S)

    def wait(self, timeout_s: float = 10.0) -> int:
        """Its exit code, once it has ended; what it shows is read meanwhile."""
        end = time.monotonic() + timeout_s
        while self.process.poll() is None:
            assert time.monotonic() < end, self.shown
            self._read(0.05)
        while self._keyboard >= 0 and self._read(0.0):
            pass
        return self.process.returncode

    def hang_up(self) -> None:
        """The terminal goes: a window that is closed, a connection that breaks."""
        os.close(self._keyboard)
        self._keyboard = -1

    def close(self) -> None:
        """Ends it, whatever it does."""
        self.process.kill()
        self.process.wait(10.0)
        if self._keyboard >= 0:
            self.hang_up()

    def _read(self, timeout_s: float) -> bool:
        """Take what is shown within this time; False: nothing."""
        if self._keyboard < 0 or not select.select([self._keyboard], [], [], timeout_s)[0]:
            return False
        try:
            self.shown += os.read(self._keyboard, 65536).decode(errors="replace")
        except OSError:  # EIO: the other end is closed
            return False
        return True
