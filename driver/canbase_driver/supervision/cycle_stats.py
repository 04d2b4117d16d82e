"""How regular the cycle is: its count, how many cycles began late, and the worst of the last second. No clock."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

WINDOW_S = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleReport:
    """The SYNC loop at one moment."""

    cycles: int
    """Since start."""
    overruns: int
    """Cycles that began more than half a period late, since start."""
    lateness_max_s: float
    """Greatest lateness of a cycle in the last WINDOW_S [s]."""

    @property
    def events(self) -> dict[str, int]:
        """What should not grow, by its name in DriverStatus."""
        return {"overruns": self.overruns}


class CycleStats:
    """Fed once a cycle."""

    def __init__(self, period_s: float) -> None:
        self._late_s = period_s / 2.0
        self._peaks: deque[tuple[float, float]] = deque()
        self.cycles = 0
        self.overruns = 0
        """Cycles that began more than half a period late."""

    def note(self, now_s: float, lateness_s: float) -> None:
        """One cycle began at `now_s`, `lateness_s` after its time."""
        self.cycles += 1
        self.overruns += lateness_s > self._late_s
        while self._peaks and self._peaks[-1][1] <= lateness_s:
            self._peaks.pop()
        self._peaks.append((now_s, lateness_s))
        while self._peaks[0][0] < now_s - WINDOW_S:
            self._peaks.popleft()

    @property
    def worst_s(self) -> float:
        """Greatest lateness in the last WINDOW_S before the last cycle [s]; 0 before the first."""
        return self._peaks[0][1] if self._peaks else 0.0

    def report(self) -> CycleReport:
        """All of it."""
        return CycleReport(cycles=self.cycles, overruns=self.overruns, lateness_max_s=self.worst_s)
