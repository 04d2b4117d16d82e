"""How the watchdog's log lines look: with a time on a terminal, with a priority for the journal (sd-daemon(3))."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping


class JournalFormatter(logging.Formatter):
    """`<4>name: text`: the journal takes the priority out of it and adds the time itself."""

    def format(self, record: logging.LogRecord) -> str:
        """One line, whatever the message has."""
        steps = ((logging.ERROR, 3), (logging.WARNING, 4), (logging.INFO, 6))
        priority = next((number for level, number in steps if record.levelno >= level), 7)
        return f"<{priority}>{' '.join(super().format(record).splitlines())}"


def formatter(environment: Mapping[str, str], stderr: os.stat_result) -> logging.Formatter:
    """The one that fits to where stderr goes: a terminal may have inherited JOURNAL_STREAM (systemd.exec(5))."""
    if environment.get("JOURNAL_STREAM") == f"{stderr.st_dev}:{stderr.st_ino}":
        return JournalFormatter("%(name)s: %(message)s")
    return logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s")
