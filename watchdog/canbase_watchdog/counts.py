"""Counts of an encoder, 6064h: how far it went on, and what is a sign of life."""

from __future__ import annotations

from canbase_config.watchdog import WatchdogConfig, WatchedDrive

LIFE_M, LIFE_SHARE, LIFE_COUNTS = 0.001, 0.2, 2
"""An encoder that is nearer than this to the place of its last sign of life may jitter. Less where watchdog.
motion_missing_m is: a share of it. More where the encoder is coarse: this many increments."""
_WRAP = 2**32


def difference(counts: int, before: int) -> int:
    """Increments from `before` to `counts`, 32 bits that wrap around: the short way, -2³¹ to 2³¹ - 1."""
    return (counts - before + _WRAP // 2) % _WRAP - _WRAP // 2


def life_m(drive: WatchedDrive, config: WatchdogConfig) -> float:
    """Net travel of the rim that shows that its encoder lives [m]."""
    return max(min(LIFE_M, LIFE_SHARE * config.motion_missing_m), LIFE_COUNTS * abs(drive.m_per_count))


class Life:
    """Signs of life of an encoder: places further apart than jitter is. Net travel alone counts, to and fro is none."""

    def __init__(self, least_m: float) -> None:
        """`least_m`: of `life_m`."""
        self._least_m = least_m
        self._at_m = self._low_m = self._high_m = 0.0

    def begin(self) -> None:
        """From where it is now."""
        self._at_m = self._low_m = self._high_m = 0.0

    def on_step(self, step_m: float) -> bool:
        """Its travel since the last sample; True, and a new beginning, where that is a sign of life."""
        self._at_m += step_m
        self._low_m, self._high_m = min(self._low_m, self._at_m), max(self._high_m, self._at_m)
        moved = self._high_m - self._low_m >= self._least_m
        if moved:
            self.begin()
        return moved
