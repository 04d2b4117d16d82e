"""Why the driver gives no power, or stops: the causes that canbase/msg/DriverStatus and stop events report."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class DriverCause(Enum):
    """What the state machine found. The value is the word that people and topics see."""

    NONE = "none"
    BOOTING = "booting"
    PREPARING = "preparing"
    NO_RECORD = "stop record"
    """The records on disk are not LIVE yet."""
    ENABLING = "enabling"
    SHUTDOWN = "shutdown"
    NOT_CONFIGURED = "not configured"
    INACTIVE = "inactive"
    RESETTING = "resetting"
    COMMAND_NOT_ZERO = "command not zero"
    NOT_STANDING = "not standing"
    DRIVE_NOT_READY = "drive not ready"
    DRIVE_MISSING = "drive missing"
    STOP_UNPROVEN = "stop unproven"
    """A drive is not proven to stop by itself, and safety.require_self_stop is true."""
    BUS_FAILED = "bus failed"
    WATCHDOG_TRIPPED = "watchdog tripped"
    WATCHDOG_MISSING = "watchdog missing"
    DRIVE_FAULT = "drive fault"
    DRIVE_RESTARTED = "drive restarted"
    DRIVE_SILENT = "drive silent"
    DRIVE_DISABLED = "drive disabled"
    ENABLE_TIMEOUT = "enable timeout"
    STALLED = "stalled"
    """Much torque, no speed: a blocked wheel."""
    DID_NOT_STOP = "did not stop"
    FEEDBACK_IMPLAUSIBLE = "feedback implausible"
    STOP_REQUESTED = "stop requested"
    ENDED_WITH_POWER = "ended with power"
    """The driver before this one died while there was power."""
    RECORD_UNUSABLE = "stop record unusable"

    @property
    def is_usual(self) -> bool:
        """It belongs to every start and end: no warning."""
        return self in _USUAL


_USUAL = (
    DriverCause.NONE,
    DriverCause.BOOTING,
    DriverCause.PREPARING,
    DriverCause.NO_RECORD,
    DriverCause.ENABLING,
    DriverCause.SHUTDOWN,
    DriverCause.NOT_CONFIGURED,
    DriverCause.INACTIVE,
)


@dataclass(frozen=True, slots=True)
class Finding:
    """Why there is no power: the cause, one sentence with the values, and what ends it."""

    cause: DriverCause = DriverCause.NONE
    detail: str = ""
    clears_on: str = ""
