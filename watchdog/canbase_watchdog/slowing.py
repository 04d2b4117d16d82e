"""Whether a wheel that is ordered to stop loses speed, judged from what was measured. Pure, one wheel, one rung.

Rules, with the limits' deceleration d and the noise n of one speed: `base.standstill_mps`, or one bit of 606Ch
1. From the end of the drive's lag on a wheel loses a quarter of d. The bound of the whole stop (ladder.py) demands
   half; the rest is left to ramps that grow slowly, for up to 0.4 s.
2. It does not where its speed is more than n above the lines that fall so steeply from all places where it was
   `window_s` to `window_s` + HELD_S ago. A wheel that keeps its speed is 4 n above them after a window of
   4 n / (d / 4), MIN_WINDOW_S at least: noise of n up and n down does not hide that. The speed does not matter.
3. That must be so for LASTS_S, in SAMPLES_LEAST samples at least: a wheel that something held for HELD_S comes back to
   the ramp of its drive, and may swing beyond it for a moment.
A wheel slower than `motion_tolerance_mps` is left to the bound of the whole stop, ladder.py.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig

SLOPE_SHARE = 0.25
"""Of the limits' deceleration: what is seen to lose less does not brake."""
MIN_WINDOW_S = 0.15
"""A ramp that grows for 0.4 s has become steep enough after this and LASTS_S."""
HELD_S = 0.25
"""A threshold holds a wheel for at most this long, its return to the ramp included [s]."""
LASTS_S = 0.08
SAMPLES_LEAST = 3


@dataclass(frozen=True, slots=True)
class Slope:
    """What a wheel must lose. From robot.yaml; `noise_mps` of one value of 606Ch."""

    lag_s: float
    least_mps2: float
    noise_mps: float
    floor_mps: float

    @classmethod
    def of(cls, config: WatchdogConfig, mps_per_bit: float) -> Slope:
        """The numbers of one wheel of this robot."""
        return cls(
            config.drive_lag_s,
            SLOPE_SHARE * config.deceleration_mps2,
            max(config.standstill_mps, abs(mps_per_bit)),
            config.motion_tolerance_mps,
        )

    @property
    def window_s(self) -> float:
        """How far apart two speeds have to be, to distinguish the slope between them from noise [s]."""
        return max(MIN_WINDOW_S, 4.0 * self.noise_mps / self.least_mps2)


class SlowingWatch:
    """Follows one wheel with power from the order to stop on. Speeds at the rim [m/s], times monotonic [s]."""

    def __init__(self, slope: Slope, since: float) -> None:
        """The order went out at `since`."""
        self._slope, self._since = slope, since
        self._window_s = slope.window_s
        self._past: deque[tuple[float, float]] = deque()
        """When, and how fast it was."""
        self._bad_since, self._bad = math.inf, 0
        self._at = since
        """When the last sample came."""

    @property
    def fails(self) -> bool:
        """It does not lose speed: rule 3 for the last samples."""
        return self._bad >= SAMPLES_LEAST and self._at - self._bad_since >= LASTS_S

    def on_sample(self, speed_mps: float, powered: bool, at: float) -> None:
        """606Ch, or an answer to an SDO that read it; the same one counts once. Without power nothing is judged."""
        if at <= self._at:
            return
        self._at = at
        if not powered:
            self._past.clear()
            self._bad = 0
            return
        mps = abs(speed_mps)
        self._past.append((at, mps))
        while self._past[0][0] < at - self._window_s - HELD_S:
            self._past.popleft()
        bad = mps > self._slope.floor_mps and self._is_above(mps, at)
        if bad and not self._bad:
            self._bad_since = at
        self._bad = self._bad + 1 if bad else 0

    def _is_above(self, mps: float, at: float) -> bool:
        """Rule 2: above all of the lines, and so above the highest."""
        fall = self._slope.least_mps2
        lines = [past - fall * (at - then) for then, past in self._past if then <= at - self._window_s]
        judged = at >= self._since + self._slope.lag_s + self._window_s
        return judged and bool(lines) and mps > max(lines) + self._slope.noise_mps
