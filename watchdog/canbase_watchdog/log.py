"""How the watchdog's log lines look: with a time on a terminal, with a priority for the journal (sd-daemon(3)).

Its loop never waits for their reader: output.py.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping

from canbase_base.output import is_journal

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
    if is_journal(environment, stderr):
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
