"""How the watchdog's log lines look: with a time on a terminal, with a priority for the journal (sd-daemon(3)).

And that its loop never waits for their reader: a held terminal (Ctrl-S), a full pipe, a journal that hangs.
"""

from __future__ import annotations

import contextlib
import logging
import os
import stat
from collections.abc import Mapping

STDERR = 2


class JournalFormatter(logging.Formatter):
    """`<4>name: text`: the journal takes the priority out of it and adds the time itself."""

    def format(self, record: logging.LogRecord) -> str:
        """One line, whatever the message has."""
        steps = ((logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6))
        priority = next((number for level, number in steps if record.levelno >= level), 7)
        return f"<{priority}>{' '.join(super().format(record).splitlines())}"


def formatter(environment: Mapping[str, str], stderr: os.stat_result) -> logging.Formatter:
    """The one that fits to where stderr goes: a terminal may have inherited JOURNAL_STREAM (systemd.exec(5))."""
    if _is_journal(environment, stderr):
        return JournalFormatter("%(name)s: %(message)s")
    return logging.Formatter("%(created).6f %(levelname)s %(name)s: %(message)s")  # seconds since 1970, as ROS has it


class Lines(logging.Handler):
    """Writes each line at once or not at all; the first one that can be written again has the number of lost ones."""

    def __init__(self, descriptor: int = STDERR) -> None:
        """`descriptor`: an open one, for which `never_wait` was called."""
        super().__init__()
        self._descriptor = descriptor
        self.lost = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Never raises and never waits."""
        lost = f"({self.lost} lines before this one were lost: the log did not accept them) " if self.lost else ""
        line = f"{lost}{record.getMessage()}"
        try:
            text = self.format(logging.makeLogRecord({**record.__dict__, "msg": line, "args": None}))
            os.write(self._descriptor, f"{text}\n".encode(errors="backslashreplace"))
        except OSError:
            self.lost += 1
        else:
            self.lost = 0


def never_wait(environment: Mapping[str, str], descriptor: int = STDERR) -> None:
    """A second copy, on purpose, of canbase_runtime.output: from now on a write that would wait raises BlockingIOError.

    A terminal and a pipe are opened again, so that other processes that share them still wait. A socket cannot be: only
    the one to the journal, which is this process's own, is changed. Files stay as they are.
    """
    with contextlib.suppress(OSError):  # a closed descriptor; a terminal of another user
        status = os.fstat(descriptor)
        if stat.S_ISSOCK(status.st_mode) and _is_journal(environment, status):
            os.set_blocking(descriptor, False)
        if stat.S_ISFIFO(status.st_mode) or os.isatty(descriptor):
            own = os.open(f"/proc/self/fd/{descriptor}", os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
            os.dup2(own, descriptor)
            os.close(own)


def _is_journal(environment: Mapping[str, str], stream: os.stat_result) -> bool:
    return environment.get("JOURNAL_STREAM") == f"{stream.st_dev}:{stream.st_ino}"
