"""One look of all log lines: time, severity, part, sentence. ROS gets it by its variable; the user's own one stays."""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Final

_VARIABLE: Final = "RCUTILS_CONSOLE_OUTPUT_FORMAT"
_FORMAT: Final = "{time} {severity} {name}: {message}"
"""Seconds since 1970: rcutils' {date_time_with_ms} loses the zeros of milliseconds below 100."""


def log_times(environment: MutableMapping[str, str]) -> None:
    """Changes the environment of this process, before ROS starts."""
    environment.setdefault(_VARIABLE, _FORMAT)
