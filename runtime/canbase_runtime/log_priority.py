"""The severity of a log line. Apart from journal.py, which opens sockets, so that pure modules may use it."""

from __future__ import annotations

from enum import IntEnum


class Priority(IntEnum):
    """As syslog has them."""

    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
