"""A GPIO line that keeps a safety relay closed as long as it is toggled: the last rung, where there is such a relay.

The relay must need the toggling (a charge pump, a retriggerable timer), so that it opens too when this process hangs or
ends. Needs the package gpiod 2, which nothing else does.
"""

from __future__ import annotations

import importlib
from typing import Any

from canbase_config.watchdog import RelayLine


class RelayError(Exception):
    """The line cannot be had, or no longer be set."""


class Relay:
    """One output line. Use it in a `with` statement; at its end the line is inactive."""

    def __init__(self, line: RelayLine) -> None:
        """Requests the line as an output, inactive. Raises RelayError with what to do."""
        try:
            self._gpiod: Any = importlib.import_module("gpiod")
        except ImportError as error:
            raise RelayError(
                "watchdog.relay needs the Python package gpiod: pip install 'canbase[gpio]' or 'gpiod>=2.1'"
            ) from error
        self._line, self._active = line, False
        direction = self._gpiod.line.Direction.OUTPUT
        try:
            settings = self._gpiod.LineSettings(direction=direction)
            self._request = self._gpiod.request_lines(
                line.chip, consumer="canbase serve watchdog", config={line.offset: settings}
            )
        except (OSError, ValueError) as error:
            raise RelayError(
                f"line {line.offset} of {line.chip} cannot be had: {error}. Check watchdog.relay (gpioinfo lists all "
                "lines), and that this user may open the chip."
            ) from error

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *error: object) -> None:
        try:
            self._set(False)
        finally:
            self._request.release()

    def toggle(self) -> None:
        """Once more, the relay stays closed. Raises RelayError when the line is gone."""
        self._set(not self._active)

    def _set(self, active: bool) -> None:
        value = self._gpiod.line.Value
        try:
            self._request.set_value(self._line.offset, value.ACTIVE if active else value.INACTIVE)
        except OSError as error:
            raise RelayError(f"line {self._line.offset} of {self._line.chip} cannot be set: {error}") from error
        self._active = active
