"""`errors` of the VDA 5050 state message, 2.1.0 and 3.0.0: everything that keeps the robot from driving, or will. Pure.

FATAL: not in running condition, somebody has to act. WARNING: it can drive. Each error names where it was seen in its
references, and what ends it in its hint. A topic that is silent is an error, and says nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from canbase_config.robot import Robot
from canbase_driver.causes import DriverCause
from canbase_driver.supervision.bus_health import ControllerState
from canbase_fleet.robot_view import DRIVER, MUX, SAFETY, RobotView
from canbase_fleet.safety_state import has_field
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.foreign_text import NAME_LENGTH, SENTENCE_LENGTH, printable
from canbase_runtime.stop_cause import SCAN_LOST, StopCause, because, stop_cause
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

MOST: Final = 50
"""Errors in one message."""
FATAL, WARNING = "FATAL", "WARNING"
PROCESSES: Final = {DRIVER: "canbase serve driver", SAFETY: "canbase serve velocity", MUX: "canbase serve velocity"}
STARTING: Final = (DriverState.BOOTING, DriverState.DISARMED, DriverState.ENABLING)
PASSING: Final = (
    *(DriverCause.NONE, DriverCause.BOOTING, DriverCause.PREPARING, DriverCause.NO_RECORD, DriverCause.ENABLING),
    *(DriverCause.COMMAND_NOT_ZERO, DriverCause.NOT_STANDING, DriverCause.RESETTING),
)
"""They end without anybody who repairs something."""
BROKEN: Final = SCAN_LOST | {
    StopCause.SCAN_BLIND,
    StopCause.ESTOP_STALE,
    StopCause.COMMAND_STALE,
    StopCause.COMMAND_INVALID,
    StopCause.UNKNOWN,
}
"""What the filter lacks."""
_CAUSES: Final = {cause.value: cause for cause in DriverCause}


@dataclass(frozen=True, slots=True)
class Error:
    """One error of VDA 5050."""

    type: str
    level: str
    description: str
    hint: str = ""
    references: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> tuple[object, ...]:
        """What makes two errors differ: not their sentences, whose numbers change all the time."""
        return self.type, self.level, self.references

    def as_json(self) -> dict[str, Any]:
        """With the names of the schema; a hint only where there is one."""
        references = [
            {"referenceKey": key, "referenceValue": printable(value, NAME_LENGTH)} for key, value in self.references
        ]
        whole: dict[str, Any] = {"errorType": self.type, "errorLevel": self.level, "errorReferences": references}
        whole["errorDescription"] = printable(self.description, SENTENCE_LENGTH)
        return whole | ({"errorHint": printable(self.hint, SENTENCE_LENGTH)} if self.hint else {})


def errors(view: RobotView, robot: Robot) -> list[Error]:
    """The most severe first, MOST of them; in a stable order."""
    found = [*_silent(view)]
    if view.driver.fresh:
        found += _driver(view.driver.message)
        found += _drives(view.driver.message, robot)
    if view.safety.fresh:
        found += _filter(view.safety.message)
    if view.mux.fresh:
        found += _mux(view.mux.message)
    return sorted(found, key=lambda error: error.level != FATAL)[:MOST]


def _silent(view: RobotView) -> Iterator[Error]:
    for topic, last in view.topics.items():
        if not last.fresh:
            hint = f"is {PROCESSES[topic]} running, in this namespace and ROS domain?"
            yield Error("state_unknown", FATAL, f"{topic}: {last.silence}", hint, (("topic", topic),))


def _driver(message: Any) -> Iterator[Error]:
    state = driver_state(message.state)
    if state is not DriverState.ENABLED:
        passes = state in STARTING and _CAUSES.get(message.cause) in PASSING
        text = f"{state.word}: {message.cause}{f', {message.detail}' if message.detail else ''}"
        cause = (("cause", message.cause),)
        yield Error("driver_not_enabled", WARNING if passes else FATAL, text, message.clears_on, cause)
    view = watchdog_view(message.watchdog)
    if view is not WatchdogView.OK:
        text = f"the watchdog is {view.value}{because(message.watchdog_cause)}"
        yield Error("watchdog", FATAL, text, "remove the cause, then reset" if view is WatchdogView.TRIPPED else "")
    if message.bus_problem:
        yield Error("can_bus", FATAL, message.bus_problem)
    elif message.controller != ControllerState.ERROR_ACTIVE.value:
        yield Error("can_bus", WARNING, f"the CAN controller is {message.controller}", "check the cable")


def _drives(message: Any, robot: Robot) -> Iterator[Error]:
    known = {drive.joint for drive in robot.drives}
    enabled = driver_state(message.state) is DriverState.ENABLED
    if missing := sorted(known - {drive.joint for drive in message.drives}):
        yield Error("drive_unknown", FATAL, f"motor_driver does not report {', '.join(missing)}")
    for drive in message.drives:
        where = ("joint", drive.joint), ("node", str(drive.node_id))
        if drive.error_code:
            text = f"error {drive.error_code:04X}h: {drive.error_text or drive.state}"
            yield Error("drive_fault", FATAL, text, "remove the cause, then reset", where)
        if drive.boot_problem:
            yield Error("drive_boot_failed", FATAL, drive.boot_problem, "", where)
        if drive.health:
            yield Error("drive_health", WARNING, drive.health, "", where)
        if enabled and not drive.stops_by_itself:
            text = "it would not stop by itself if this computer failed (1016h)"
            yield Error("drive_not_guarded", WARNING, text, "canbase setup commission", where)


def _filter(message: Any) -> Iterator[Error]:
    cause = stop_cause(message.cause)
    if cause in BROKEN:
        yield Error("safety_filter", FATAL, f"{message.cause}: {message.detail}", message.clears_on)
    if message.estop:
        yield Error("emergency_stop", FATAL, message.detail or "it holds, or waits for its reset", message.clears_on)
    if not has_field(message):
        text = "no scanner is required, and none has sent a usable scan: no protective field is monitored"
        yield Error("no_protective_field", WARNING, text, "safety.scan in robot.yaml")
    for scanner in message.scanners:
        known = scanner.required or scanner.problem or not math.isnan(scanner.age_s)
        if known and not scanner.fresh:
            level = FATAL if scanner.required else WARNING
            yield Error("scanner", level, scanner.problem or "its scans are too old", "", (("topic", scanner.topic),))


def _mux(message: Any) -> Iterator[Error]:
    for foreign in message.foreign:
        where = ("topic", foreign.topic), ("node", foreign.node)
        text = f"{foreign.node} publishes on {foreign.topic}: {foreign.problem}"
        yield Error("unexpected_publisher", FATAL if foreign.locks else WARNING, text, "", where)
    for lock in message.locks:
        if lock.holds:
            yield Error("lock", WARNING, f"lock {lock.name}: {lock.reason}", "", (("lock", lock.name),))
