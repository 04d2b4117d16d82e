"""The last minutes of ground truth, from which tests find the time of standstill of the wheels. Pure."""

from __future__ import annotations

from collections import deque

from canbase_sim.world.bench import Bench

RATE_HZ = 100.0
"""Samples per second."""
KEPT_S = 120.0
"""How far the trace reaches back."""

Row = tuple[float, float, float, float, float, float]
"""Time, x, y, yaw, rim speed left, rim speed right [s, m, m, rad, m/s, m/s]."""


class Trace:
    """A ring of samples of one bench, on a fixed grid of time."""

    def __init__(self, bench: Bench, now_s: float) -> None:
        self._bench = bench
        self._start, self._taken = now_s, 0
        self._rows: deque[Row] = deque(maxlen=int(RATE_HZ * KEPT_S))

    def tick(self, now_s: float) -> None:
        """Take the samples that are due; `now_s` may be late, the samples are not."""
        while (due := self._start + self._taken / RATE_HZ) <= now_s:
            t = self._bench.truth(due)
            self._rows.append((t.time_s, t.x_m, t.y_m, t.yaw_rad, t.v_left_mps, t.v_right_mps))
            self._taken += 1

    def since(self, time_s: float) -> list[Row]:
        """The samples from `time_s` on."""
        return [row for row in self._rows if row[0] >= time_s]
