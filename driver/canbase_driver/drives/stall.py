"""Whether a drive stalls: much torque, no speed, though motion is ordered. It measures; `hazards.py` decides. Pure.

Rules, for each sample of a wheel (docs/decisions/0041)
1. It adds to the time if the torque is at least health.stall_torque_share of the rated one, the wheel is slower than
   base.standstill_mps, and the drive is enabled and ordered at least ORDERED times that speed. Any other sample takes
   its time off again: one bad sample in ten hides nothing.
2. A sign of life of the encoder, or a drive without torque, ends it: a wheel that creeps over a kerb is no stall, and a
   stationary wheel that a drive holds on a slope is not ordered to move.
3. Torque that the drive does not report, or that was always zero, is unknown: the watchdog's evidence of motion stands
   instead (watchdog/motion_evidence.py).
"""

from __future__ import annotations

from dataclasses import dataclass

from canbase_config.robot import Robot

ORDERED = 2.0
"""An order of this many times base.standstill_mps shows in 606Ch, noise apart."""
LONGEST_SAMPLE_GAP_S = 0.1
"""Time between two samples counts for at most this long [s]."""


@dataclass(frozen=True, slots=True)
class StallLimits:
    """Numbers of robot.yaml."""

    torque_share: float
    time_s: float
    standstill_mps: float

    @classmethod
    def of(cls, robot: Robot) -> StallLimits:
        """All wheels have the same."""
        return cls(robot.health.stall_torque_share, stall_time_s(robot), robot.base.standstill_mps)


def stall_time_s(robot: Robot) -> float:
    """health.stall_time_s; without it a little less than the watchdog waits for motion, so that the stall is named."""
    given = robot.health.stall_time_s
    return STALL_PART * robot.watchdog.motion_missing_s if given is None else given


STALL_PART = 0.88
"""Of watchdog.motion_missing_s: 0.22 s of 0.25 s. A threshold holds a wheel for up to 0.2 s."""


class Stall:
    """Follows one axis. Speeds at the rim, torque as a share of the rated one."""

    def __init__(self, limits: StallLimits) -> None:
        self._limits = limits
        self._at = float("inf")
        self._share = self._velocity_mps = self._ordered_mps = 0.0
        self.time_s = 0.0
        """How long it has stalled [s]; 0: it does not."""

    @property
    def is_over(self) -> bool:
        """It has stalled for as long as it may."""
        return self.time_s >= self._limits.time_s

    @property
    def sentence(self) -> str:
        """What was measured last, and the limits. Meaningless unless `time_s` is above 0."""
        limits = self._limits
        return (
            f"stalls: {self._share:.0%} of the rated torque for {self.time_s:.2f} s at {self._velocity_mps:.3f} m/s, "
            f"ordered {self._ordered_mps:.3f} m/s (health.stall_torque_share {limits.torque_share:g}, "
            f"health.stall_time_s {limits.time_s:g} s): is the wheel blocked, the load too heavy, its encoder dead?"
        )

    def on_sample(
        self, velocity_mps: float, share: float | None, ordered_mps: float, *, moves: bool, now_s: float
    ) -> None:
        """One SYNC. `share`: None: unknown. `ordered_mps`: of an enabled drive, else 0.

        `moves`: a sign of life of its encoder, or no torque.
        """
        elapsed_s, self._at = min(max(now_s - self._at, 0.0), LONGEST_SAMPLE_GAP_S), now_s
        limits = self._limits
        if moves or share is None:
            self.time_s = 0.0
        elif (
            abs(share) >= limits.torque_share
            and abs(velocity_mps) <= limits.standstill_mps
            and abs(ordered_mps) >= ORDERED * limits.standstill_mps
        ):
            self._share, self._velocity_mps, self._ordered_mps = share, velocity_mps, ordered_mps
            self.time_s = min(self.time_s + elapsed_s, limits.time_s)
        else:
            self.time_s = max(self.time_s - elapsed_s, 0.0)
