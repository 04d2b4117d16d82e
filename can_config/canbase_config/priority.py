"""How grave a sentence of a log is. Apart from journal.py, which opens sockets: what decides may know it."""

from __future__ import annotations

from enum import IntEnum


class Priority(IntEnum):
    """As syslog has them."""

    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6
