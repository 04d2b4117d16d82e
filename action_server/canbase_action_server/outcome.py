"""How a goal can end: the status of the ROS 2 action protocol, and the error code of the result."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum


class Status(IntEnum):
    """Final states of a goal, numbered as in action_msgs/GoalStatus."""

    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6


class ErrorCode(IntEnum):
    """Error codes, numbered as in DriveDistance.action; a test compares both."""

    OK = 0
    BLOCKED = 1
    ODOMETRY_LOST = 2
    ESTOP = 3
    NO_PROGRESS = 4
    TIMEOUT = 5
    DRIVE_FAULT = 6
    WATCHDOG = 7
    TAKEN_OVER = 8
    PREEMPTED = 9
    CLIENT_LOST = 10
    SCAN_LOST = 11
    SHUTDOWN = 12
    CANCELED = 13
    INTERNAL = 14
    OVERSHOOT = 15
    INVALID_GOAL = 16

    @property
    def status(self) -> Status:
        """The final status that belongs to this code."""
        return {ErrorCode.OK: Status.SUCCEEDED, ErrorCode.CANCELED: Status.CANCELED}.get(self, Status.ABORTED)

    @property
    def leaves_the_base_standing(self) -> bool:
        """After an end with this code the base was measured at standstill at its target: another goal may follow."""
        return self in (ErrorCode.OK, ErrorCode.CANCELED, ErrorCode.PREEMPTED)


@dataclass(frozen=True, slots=True)
class GoalOutcome:
    """The end of a goal, as the client will read it."""

    code: ErrorCode
    traveled_m: float
    """Along the way, signed; of a turn, the way of the wheels on their circle."""
    overshoot_m: float
    message: str
    stands: bool = field(default=False, compare=False)
    """The base was seen standing at the end; for the log."""
    duration_s: float = field(default=0.0, compare=False)
    """From the start of the motion; 0: it never started."""

    @property
    def status(self) -> Status:
        """SUCCEEDED, CANCELED or ABORTED, by the code."""
        return self.code.status
