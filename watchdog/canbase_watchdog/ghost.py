"""A ghost: the velocity shows that a wheel turns, one way, and its encoder does not move. Cause 12 in policy.py.

Its drive works against a motion that does not exist, also with nothing ordered: the velocity loop integrates what
606Ch shows, and the wheel accelerates behind an encoder that is frozen. The rule holds at two scales (decision 41):

| | the encoder moves | travel by 606Ch without that |
|---|---|---|
| frozen: no increment, except one at an edge, to and fro | 2 increments | 0.1 mm, or 4 increments |
| jitters | a sign of life, 1 mm | two signs of life |

LEAST_S after the encoder last moved it begins to count, and it must last for LEAST_S more: 606Ch may be filtered, and a
wheel may meet something hard. A register that shows a few bits at standstill is no ghost, nor is a velocity that falls
or changes its sign.
"""

from __future__ import annotations

from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig, WatchedDrive
from canbase_watchdog.counts import LIFE_COUNTS, Life, life_m

LIVES = 2.0
FROZEN_M, FROZEN_COUNTS = 0.0001, 4.0
RESIDUE_BITS, FALLS_SHARE = 4.0, 0.99
"""A register that shows a few bits at standstill is no ghost, nor is a filter's tail: a velocity that stays is."""
LEAST_S = 0.1


@dataclass(frozen=True, slots=True)
class Ghost:
    """What the velocity showed alone. `is_one`: it is beyond what is allowed."""

    travel_m: float = 0.0
    is_one: bool = False


NO_GHOST = Ghost()


class _Scale:
    """One row of the table."""

    def __init__(self, moves_m: float, least_m: float, now_s: float) -> None:
        self._life, self._least_m = Life(moves_m), least_m
        self._moved_at, self._time_s, self.travel_m = now_s, 0.0, 0.0

    @property
    def is_one(self) -> bool:
        return abs(self.travel_m) >= self._least_m and self._time_s >= LEAST_S

    def begin(self) -> None:
        self._time_s = self.travel_m = 0.0

    def on_sample(self, step_m: float | None, velocity_mps: float, elapsed_s: float, now_s: float) -> None:
        if step_m is None or self._life.on_step(step_m):
            self._moved_at = now_s
        if now_s < self._moved_at + LEAST_S or velocity_mps == 0.0 or velocity_mps * self.travel_m < 0.0:
            self.begin()
            return
        self._time_s += elapsed_s
        self.travel_m += velocity_mps * elapsed_s


class GhostWatch:
    """Follows one axis. Speeds at the rim, forward positive [m/s]."""

    def __init__(self, drive: WatchedDrive, config: WatchdogConfig, now_s: float) -> None:
        """Before the monotonic time `now_s` [s] nothing is held against it."""
        count_m, lives_m = abs(drive.m_per_count), life_m(drive, config)
        frozen_m = max(FROZEN_M, FROZEN_COUNTS * count_m)
        self._frozen = _Scale(LIFE_COUNTS * count_m, frozen_m, now_s)
        self._jitters = _Scale(lives_m, LIVES * lives_m, now_s)
        self._residue_mps = RESIDUE_BITS * abs(drive.velocity_mps_per_bit)
        self._velocity_mps = 0.0

    def trust(self) -> None:
        """A reset was accepted: everything starts again."""
        self._frozen.begin()
        self._jitters.begin()

    def on_sample(
        self, velocity_mps: float, step_m: float | None, powered: bool, elapsed_s: float, now_s: float
    ) -> Ghost:
        """606Ch, and the travel of the encoder since the last sample; None: not known, or a jump.

        What counted with power outlives a time without.
        """
        falls = abs(velocity_mps) < FALLS_SHARE * abs(self._velocity_mps)
        self._velocity_mps = velocity_mps
        shown_mps = velocity_mps if abs(velocity_mps) > self._residue_mps else 0.0
        counted_s = elapsed_s if powered and not falls else 0.0
        for scale in (self._frozen, self._jitters):
            scale.on_sample(step_m, shown_mps, counted_s, now_s)
        return Ghost(
            max(self._frozen.travel_m, self._jitters.travel_m, key=abs), self._frozen.is_one or self._jitters.is_one
        )
