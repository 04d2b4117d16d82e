"""One look of all log lines: time, severity, part, sentence. ROS gets it by its variable; the user's own one stays."""

from __future__ import annotations

from collections.abc import MutableMapping
from typing import Final

_VARIABLE: Final = "RCUTILS_CONSOLE_OUTPUT_FORMAT"
_FORMAT: Final = "{date_time_with_ms} {severity} {name}: {message}"


def readable_times(environment: MutableMapping[str, str]) -> None:
    """Changes the environment of this process, before ROS starts."""
    environment.setdefault(_VARIABLE, _FORMAT)
