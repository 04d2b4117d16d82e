"""Why nothing gets power, and what stops it: two tables, the most informative row first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from canbase_driver.causes import DriverCause
from canbase_driver.supervision.phases import Phase
from canbase_driver.supervision.situation import Situation
from canbase_runtime.watchdog_view import WatchdogView

Detect = Callable[[Situation], str]
"""A sentence when it is so, else empty."""


@dataclass(frozen=True, slots=True)
class Blocker:
    """One reason why nothing gets power, and where the driver is meanwhile."""

    cause: DriverCause
    detect: Detect
    phase: Phase
    clears_on: str


@dataclass(frozen=True, slots=True)
class Hazard:
    """One reason to stop what has power. `quick`: the drives' quick stop at once; otherwise the driver's ramp first."""

    cause: DriverCause
    detect: Detect
    quick: bool
    latched: bool
    clears_on: str


Reason = TypeVar("Reason", Blocker, Hazard)


def first(reasons: tuple[Reason, ...], situation: Situation) -> Reason | None:
    """The first row that holds."""
    return next((reason for reason in reasons if reason.detect(situation)), None)


def _watchdog(view: WatchdogView) -> Detect:
    return lambda s: f"watchdog: {s.watchdog_detail}" if s.watchdog is view else ""


def _stop_requested(s: Situation) -> str:
    return "service motor_driver/stop" if s.stop_requested else ""


_MISSING, _TRIPPED = _watchdog(WatchdogView.MISSING), _watchdog(WatchdogView.TRIPPED)

BLOCKERS: tuple[Blocker, ...] = (
    Blocker(DriverCause.STOP_REQUESTED, _stop_requested, Phase.LATCHED, "reset"),
    Blocker(DriverCause.BUS_FAILED, lambda s: s.bus, Phase.OFFLINE, "the bus working"),
    Blocker(DriverCause.WATCHDOG_TRIPPED, _TRIPPED, Phase.LATCHED, "reset"),
    Blocker(DriverCause.NOT_CONFIGURED, lambda s: s.unconfigured, Phase.OFFLINE, "lifecycle transition configure"),
    Blocker(DriverCause.DRIVE_MISSING, lambda s: s.missing, Phase.BOOTING, "the drive answering"),
    Blocker(DriverCause.BOOTING, lambda s: s.booting or s.absent, Phase.BOOTING, "drives booted"),
    Blocker(
        DriverCause.STOP_UNPROVEN, lambda s: s.unproven, Phase.DISARMED, "canbase setup commission, and a new start"
    ),
    Blocker(DriverCause.DRIVE_FAULT, lambda s: s.fault, Phase.LATCHED, "reset, with the drive's cause gone"),
    Blocker(DriverCause.DRIVE_SILENT, lambda s: s.silent, Phase.DISARMED, "the drive answering"),
    Blocker(DriverCause.WATCHDOG_MISSING, _MISSING, Phase.DISARMED, "the watchdog alive"),
    Blocker(DriverCause.INACTIVE, lambda s: s.inactive, Phase.DISARMED, "lifecycle transition activate"),
    Blocker(DriverCause.RESETTING, lambda s: "a reset is under way" if s.resetting else "", Phase.DISARMED, "its end"),
    Blocker(DriverCause.COMMAND_NOT_ZERO, lambda s: s.commanded, Phase.DISARMED, "a zero command"),
    Blocker(DriverCause.NOT_STANDING, lambda s: "" if s.standstill else s.turning, Phase.DISARMED, "standstill"),
)
"""What keeps the power off while nothing is latched, the most informative first. Most end by themselves."""

HAZARDS: tuple[Hazard, ...] = (
    Hazard(DriverCause.BUS_FAILED, lambda s: s.bus, True, True, "reset, with the bus working"),
    Hazard(DriverCause.WATCHDOG_TRIPPED, lambda s: "" if s.watchdog_about_drive else _TRIPPED(s), True, True, "reset"),
    Hazard(DriverCause.DRIVE_FAULT, lambda s: s.fault, True, True, "reset, with the drive's cause gone"),
    Hazard(DriverCause.DRIVE_RESTARTED, lambda s: s.absent, True, True, "reset"),
    Hazard(DriverCause.DRIVE_SILENT, lambda s: s.silent, True, True, "reset, with the drive answering"),
    Hazard(DriverCause.WATCHDOG_TRIPPED, _TRIPPED, True, True, "reset"),
    Hazard(DriverCause.WATCHDOG_MISSING, _MISSING, False, True, "reset, with the watchdog alive"),
    Hazard(DriverCause.DRIVE_DISABLED, lambda s: s.disabled, True, True, "reset"),
    Hazard(DriverCause.STALLED, lambda s: s.stalled, True, True, "reset, with the wheel free to turn"),
    Hazard(DriverCause.FEEDBACK_IMPLAUSIBLE, lambda s: s.wrapping, False, True, "reset"),
    Hazard(DriverCause.DID_NOT_STOP, lambda s: s.overdue, True, True, "reset"),
    Hazard(DriverCause.STOP_REQUESTED, _stop_requested, False, True, "reset"),
    Hazard(DriverCause.INACTIVE, lambda s: s.inactive, False, False, "lifecycle transition activate"),
    Hazard(
        DriverCause.SHUTDOWN,
        lambda s: "motor_driver is shutting down" if s.shutdown_requested else "",
        False,
        False,
        "a new start",
    ),
)
"""All reasons to stop, the most informative first: when several hold, the first one is the cause that is reported.

A tripped watchdog stops the drives itself. Where both are seen in the same cycle (this process was stopped for a
while), drives that left NMT operational, are in fault or send nothing are its consequence, unless it tripped about a
drive.
"""
