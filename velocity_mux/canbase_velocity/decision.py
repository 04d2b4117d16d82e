"""What the safety filter decides, and its actions by severity, as interfaces/msg/SafetyState.msg numbers them."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.twist import Twist


class Action(enum.IntEnum):
    """What is done with a command. The greater number is the more severe, and the most severe wins."""

    PASS = 0
    LIMIT = 1
    SLOW = 2
    STOP = 3


@dataclass(frozen=True, slots=True)
class Finding:
    """One reason to do something. `factor`: the share of the commanded speed that it leaves, 0 to 1."""

    action: Action
    cause: StopCause
    detail: str
    clears_on: str
    factor: float


@dataclass(frozen=True, slots=True)
class Decision:
    """The order, what was done to the command, why, and what ends it. `twist` is always finite.

    `emergency`: the base has to brake with limits.emergency_deceleration_mps2 now.
    """

    action: Action
    cause: StopCause
    detail: str
    clears_on: str
    twist: Twist
    emergency: bool = False

    @property
    def essence(self) -> tuple[Action, StopCause, bool]:
        """What makes two decisions differ for a reader: not their numbers."""
        return self.action, self.cause, self.emergency


PASSED = Finding(Action.PASS, StopCause.NONE, "", "", 1.0)


def stop(cause: StopCause, detail: str, clears_on: str) -> Finding:
    """A reason to stand still."""
    return Finding(Action.STOP, cause, detail, clears_on, 0.0)
