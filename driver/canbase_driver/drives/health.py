"""Which measured values of the drives are beyond the limits of `health` in robot.yaml. Pure: time is an argument.

A warning begins with the first value beyond its limit. It ends when the value has been inside for CALM_S, so a value
at its limit is one warning and not many.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from canbase_config.health import Health
from canbase_driver.drives.drive_snapshot import DriveSnapshot

CALM_S = 10.0
"""For this long a value must be inside of its limit until the warning ends [s]."""


@dataclass(frozen=True, slots=True)
class Excess:
    """One value beyond its limit. `key`: of `health` in robot.yaml."""

    joint: str
    key: str
    text: str
    """For people: the value, the limit and the key."""


class HealthWatch:
    """Of all drives."""

    def __init__(self, limits: Health) -> None:
        self._limits = limits
        self._warned: dict[tuple[str, str], tuple[Excess, float]] = {}

    def check_drives(self, drives: Sequence[DriveSnapshot], now_s: float) -> tuple[Excess, ...]:
        """All warnings at `now_s` [s, monotonic], each with its last value beyond the limit."""
        for drive in drives:
            for excess in _beyond(drive, self._limits):
                self._warned[excess.joint, excess.key] = (excess, now_s)
        self._warned = {key: (excess, at_s) for key, (excess, at_s) in self._warned.items() if now_s - at_s < CALM_S}
        return tuple(excess for excess, _ in self._warned.values())


def supply_v(drives: Sequence[DriveSnapshot]) -> float:
    """The supply of the base [V]: the middle one of what the drives measure; NaN: none measures it."""
    known = sorted(drive.voltage_v for drive in drives if not math.isnan(drive.voltage_v))
    return known[len(known) // 2] if known else math.nan


def _beyond(drive: DriveSnapshot, limits: Health) -> Iterator[Excess]:
    """NaN, not measured, is beyond nothing."""
    rows = (
        ("voltage_low_v", limits.voltage_low_v, -1.0, drive.voltage_v, "supply", "V"),
        ("voltage_high_v", limits.voltage_high_v, 1.0, drive.voltage_v, "supply", "V"),
        ("current_high_a", limits.current_high_a, 1.0, abs(drive.current_a), "current", "A"),
        ("temperature_high_c", limits.temperature_high_c, 1.0, drive.temperature_c, "temperature", "°C"),
    )
    for key, limit, sign, value, what, unit in rows:
        if limit is not None and sign * (value - limit) > 0.0:
            word = "above" if sign > 0.0 else "below"
            text = f"{drive.joint}: {what} {value:.4g} {unit} is {word} health.{key} ({limit:g} {unit})"
            yield Excess(drive.joint, key, text)
