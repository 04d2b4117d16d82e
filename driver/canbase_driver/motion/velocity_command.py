"""The velocity command as the driver takes it: finite or refused, fresh or none, and never before a zero was seen."""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.received import NEVER, Received


@dataclass(frozen=True, slots=True)
class CommandReport:
    """The velocity command at one moment."""

    age_s: float
    """Age of cmd_vel by local receive time [s]; NaN: none yet."""
    fresh: bool
    """It is within timeouts.command_s."""
    refused: int
    """Commands that were not finite, since start."""

    @property
    def events(self) -> dict[str, int]:
        """What should not grow, by its name in DriverStatus."""
        return {"commands_refused": self.refused}


class VelocityCommand:
    """The last velocity command, with its local receive time [s, monotonic]."""

    def __init__(self, timeout_s: float) -> None:
        """`timeout_s`: a command that is older is none (timeouts.command_s)."""
        self._timeout_s = timeout_s
        self._command: Received[Twist2D] = NEVER
        self._seen_zero = False
        self.refused = 0
        """Commands that were not finite."""

    def accept(self, twist: Twist2D, received_at: float) -> bool:
        """Take a command. False, and counted: it was not finite."""
        if not twist.is_finite:
            self.refused += 1
            return False
        self._command = Received(twist, received_at)
        self._seen_zero = self._seen_zero or twist == Twist2D.ZERO
        return True

    def await_zero(self) -> None:
        """From now on nothing is followed until a zero has come: the operator must release the joystick once."""
        self._seen_zero = False

    def report(self, now_s: float) -> CommandReport:
        """All of it at the time `now_s` [s, monotonic]."""
        age_s = math.nan if self._command.never else self._command.age_s(now_s)
        return CommandReport(age_s=age_s, fresh=self._fresh(now_s) is not None, refused=self.refused)

    def motion(self, now_s: float) -> str:
        """A sentence when a fresh command orders motion, followed or not."""
        twist = self._fresh(now_s)
        if twist is None or twist == Twist2D.ZERO:
            return ""
        return f"cmd_vel orders {twist.linear_mps:.3f} m/s, {twist.angular_radps:.3f} rad/s"

    def target(self, now_s: float) -> Twist2D:
        """What to follow: the command, zero when it is too old or no zero was seen yet."""
        return (self._fresh(now_s) if self._seen_zero else None) or Twist2D.ZERO

    def _fresh(self, now_s: float) -> Twist2D | None:
        return self._command.within(self._timeout_s, now_s)
