"""Entries of the systemd journal with priority and fields, beside the plain text that ROS writes; nothing without it.

Standard library only. The protocol is systemd's native one (systemd.io/JOURNAL_NATIVE_PROTOCOL): one datagram an entry.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Mapping
from typing import Final, Protocol

from canbase_runtime.foreign_text import LINE_LENGTH, printable
from canbase_runtime.log_budget import LogBudget
from canbase_runtime.log_priority import Priority

SOCKET: Final = "/run/systemd/journal/socket"
UNDER_SYSTEMD: Final = "JOURNAL_STREAM"
"""systemd sets it for a service whose output goes to the journal."""


class Journal:
    """One part's way into the journal. Nothing here blocks or raises: a full journal must not stop a loop."""

    def __init__(self, part: str, environment: Mapping[str, str] = os.environ, path: str = SOCKET) -> None:
        """`part`: the field CANBASE_PART of all its entries."""
        self._path = path if environment.get(UNDER_SYSTEMD) else ""
        self._part = part

    def write(self, message: str, priority: Priority, **fields: object) -> None:
        """One entry; a field `cause` is CANBASE_CAUSE there."""
        if not self._path:
            return
        own = {
            "MESSAGE": message,
            "PRIORITY": int(priority),
            "SYSLOG_IDENTIFIER": "canbase",
            "CANBASE_PART": self._part,
        }
        entry = {**own, **{f"CANBASE_{name.upper()}": value for name, value in fields.items()}}
        text = "".join(f"{name}={printable(value, LINE_LENGTH)}\n" for name, value in entry.items())
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.setblocking(False)
            try:
                sender.sendto(text.encode(), self._path)
            except OSError:
                return  # the journal is full or restarts; the plain text is there too


class Logger(Protocol):
    """What of ROS's logger is used here."""

    def error(self, message: str) -> object:
        """A line of severity ERROR."""

    def warning(self, message: str) -> object:
        """A line of severity WARN."""

    def info(self, message: str) -> object:
        """A line of severity INFO."""


EVENT_LOG_BURST, EVENT_LOG_PER_S = 200.0, 20.0
"""Lines of one part, far more than any operation writes."""


class EventLog:
    """The log of one part: each sentence is a line of ROS's log and a journal entry with priority and fields."""

    def __init__(self, logger: Logger, journal: Journal) -> None:
        self._logger, self._journal = logger, journal
        self._budget = LogBudget(EVENT_LOG_BURST, EVENT_LOG_PER_S)

    def write(self, sentence: str, priority: Priority, **fields: object) -> None:
        """One sentence, which is one line whatever is in it. ROS knows no notice: it is an INFO there. A flood of them
        (a lock that is set and released by each message) is cut off, and counted; an error is always written."""
        omitted = 0 if priority is Priority.ERROR else self._budget.take(time.monotonic())
        if omitted is None:
            return
        if omitted:
            self._logger.warning(f"{omitted} lines omitted: more than {EVENT_LOG_PER_S:g} each second")
        sentence = printable(sentence, LINE_LENGTH)
        self._journal.write(sentence, priority, **fields)
        if priority is Priority.ERROR:  # a call for each severity: rclpy holds a line of source to one
            self._logger.error(sentence)
        elif priority is Priority.WARNING:
            self._logger.warning(sentence)
        else:
            self._logger.info(sentence)
