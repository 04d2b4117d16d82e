"""Whether 6064h and 606Ch of a wheel contradict each other by a factor, or count against each other. Pure.

Since its boot, each step of the encoder is compared with what the velocity gives for the same time. A straight line
through zero of another slope than 1 is a wrong scale or sign, in robot.yaml or in the drive. Points beside any line are
noise or a sensor that died on the way, and show no scale. Evidence for a message: nothing is stopped by it.
"""

from __future__ import annotations

import math

from canbase_config.drive import Drive
from canbase_config.object_map import POSITION_ACTUAL, VELOCITY_ACTUAL, place
from canbase_driver.boot.advice import ELSE_UNUSABLE
from canbase_driver.motion.odometry import unwrap

LONGEST_STEP_S = 0.1
"""Over a longer pause the velocity is no measure of the way [s]."""
LEAST_M, ENOUGH_M = 0.001, 0.5
"""Travel by 606Ch before anything is said, and after which the scale counts as right until the next boot [m]."""
ROLLED_M = 0.005
"""Travel by 6064h, on balance, that no jitter at a standstill makes [m]."""
AGREES = 0.2
"""Slopes between 1 - this and 1 + this: delays of the drive's filter are as much in the first moments."""
LINE = 0.9
"""Least squared correlation of the points, of a line."""
FEW = 0.1
"""So small a share of the increments that are due has no line, whatever the reason."""


class FeedbackFactor:
    """Follows one axis from a boot to the next."""

    def __init__(self, drive: Drive, metres_per_count: float) -> None:
        self._drive, self._metres_per_count = drive, metres_per_count
        self.forget()

    def forget(self) -> None:
        """Its scale may be another one after a boot."""
        self._at = -math.inf
        self._raw = self._counts = self._steps = 0
        self._velocity_mps = self._way_m = self._shown_m = 0.0
        self._xx = self._xy = self._yy = 0.0

    def on_sample(self, raw: int, velocity_mps: float, now_s: float) -> None:
        """6064h as it came, and 606Ch [m/s] of the same SYNC."""
        if self._way_m > ENOUGH_M:
            return
        elapsed_s, counts = now_s - self._at, unwrap(self._raw, raw)
        x = (self._velocity_mps + velocity_mps) / 2.0 * elapsed_s
        self._at, self._raw, self._velocity_mps = now_s, raw, velocity_mps
        if elapsed_s > LONGEST_STEP_S or (counts == 0 and x == 0.0):
            return
        y = counts * self._metres_per_count
        self._steps += 1
        self._counts += counts
        self._way_m += abs(x)
        self._shown_m += x
        self._xx, self._xy, self._yy = self._xx + x * x, self._xy + x * y, self._yy + y * y

    @property
    def sentence(self) -> str:
        """What contradicts what, and what to do about it; empty: they agree, or it cannot be told."""
        if self._way_m == 0.0 and abs(self._counts * self._metres_per_count) > ROLLED_M:
            return f"{self._named(VELOCITY_ACTUAL)} stays 0 while {self._named(POSITION_ACTUAL)} counts"
        if not LEAST_M < self._way_m <= ENOUGH_M or self._xx == 0.0:
            return ""
        slope = self._xy / self._xx
        if not self._is_line():
            share = self._counts * self._metres_per_count / self._shown_m if self._shown_m else 0.0
            return self._scaled(share) + ", or its encoder is dead" if 0.0 < share < FEW else ""
        if slope < 0.0:
            return self._reversed()
        return "" if abs(slope - 1.0) <= AGREES else self._scaled(slope)

    def _is_line(self) -> bool:
        """Through zero, and the steps vary together, as from standstill on: two that are constant show nothing."""
        n, x, y = self._steps, self._shown_m, self._counts * self._metres_per_count
        xx, xy, yy = self._xx - x * x / n, self._xy - x * y / n, self._yy - y * y / n
        vary = xx > 0.0 and yy > 0.0 and xy * self._xy > 0.0 and xy * xy >= LINE * xx * yy
        return vary and self._xy * self._xy >= LINE * self._xx * self._yy

    def _reversed(self) -> str:
        return (
            f"{self._named(VELOCITY_ACTUAL)} counts against {self._named(POSITION_ACTUAL)}: one of them is reversed. "
            "Set 607Eh (polarity) or the direction of its encoder with the manufacturer's tool; `direction` in "
            f"robot.yaml turns both; {ELSE_UNUSABLE}"
        )

    def _scaled(self, factor: float) -> str:
        drive = self._drive
        keys = "`velocity_unit`"
        if "counts" not in drive.actual_unit:
            counts = float(f"{drive.counts_per_motor_rev * factor:.2g}")
            keys = (
                f"`counts_per_motor_rev` (by the velocity about {counts:.0f}; of an encoder behind the gear: its "
                f"increments divided by gear_ratio) and {keys}"
            )
        return (
            f"{self._named(POSITION_ACTUAL)} counts {float(f'{factor:.2g}'):g} times as far as "
            f"{self._named(VELOCITY_ACTUAL)} shows: check {keys} in robot.yaml, and 608Fh to 6096h in the drive; where "
            "the wheel goes as far as it shall, `units.actual_velocity` of its drive profile"
        )

    def _named(self, index: int) -> str:
        at = place(self._drive.kind, index, self._drive.axis)
        return f"{at.index:04X}h"
