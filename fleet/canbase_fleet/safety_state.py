"""`safetyState` of the VDA 5050 state message, versions 2.1.0 and 3.0.0, from what is known of the robot. Pure.

eStop is the way in which a stop is acknowledged: MANUAL at the vehicle, AUTOACK by itself, NONE: no stop is active.
The first rule that applies decides; NONE is what is left when every part has reported that nothing stops the base.
What is not known is MANUAL, and its protective field is violated: the schema has no third answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Any, Final

from canbase_config.robot import Robot
from canbase_fleet.robot_view import RobotView
from canbase_runtime.driver_state import DriverState, driver_state
from canbase_runtime.stop_cause import SCAN_LOST, StopCause, stop_cause
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view


class EStop(Enum):
    """Of VDA 5050: eStop (2.1.0), activeEmergencyStop (3.0.0). REMOTE, of the facility, is unknown to canbase."""

    AUTOACK = "AUTOACK"
    MANUAL = "MANUAL"
    NONE = "NONE"


Rule = Callable[[RobotView, Robot], bool]
STOP: Final = 3
"""Of SafetyState.msg. Greater numbers do not exist; they would be no better."""
FIELD: Final = SCAN_LOST | {StopCause.OBSTACLE, StopCause.SCAN_BLIND, StopCause.UNKNOWN}
"""Causes of the protective field: something is in it, or it is not known whether."""
ORDINARY: Final = (DriverState.BOOTING, DriverState.DISARMED, DriverState.ENABLING, DriverState.ENABLED)
"""Nothing is being stopped. Without power the base does not move; why it has none is in `errors`."""


def estop(view: RobotView, robot: Robot) -> EStop:
    """By the first of RULES that applies."""
    return next((answer for applies, answer in RULES if applies(view, robot)), EStop.NONE)


def active_emergency_stop(view: RobotView, robot: Robot) -> EStop:
    """Of version 3.0.0, which has no AUTOACK: NONE while only the protective field stops the base, otherwise MANUAL."""
    answer = estop(view, robot)
    if answer is not EStop.AUTOACK:
        return answer
    is_field = stop_cause(view.safety.message.cause) in FIELD and not view.safety.message.estop
    other = any(rule(view, robot) for rule in (_watchdog_is_missing, _driver_stops))
    return EStop.NONE if is_field and not other else EStop.MANUAL


def field_violation(view: RobotView, robot: Robot) -> bool:
    """Something is in the stop zone, ahead or behind, whatever the direction of travel; or it is not known.

    A robot without a scanner has no protective field that could be violated; `errors` says so.
    """
    if not view.safety.fresh:
        return True
    message = view.safety.message
    if stop_cause(message.cause) in FIELD:
        return True
    if any(scanner.required and not scanner.fresh for scanner in message.scanners):
        return True
    free_m = min(_or_nothing(message.clearance_ahead_m), _or_nothing(message.clearance_behind_m))
    return has_field(message) and free_m < robot.safety.stop_distance_m


def has_field(message: Any) -> bool:
    """Of a SafetyState: a scanner is required, or one has sent a usable scan since the filter began."""
    return any(scanner.required or not math.isnan(scanner.age_s) for scanner in message.scanners)


def driving(view: RobotView) -> bool:
    """Not shown to be at standstill."""
    return not (view.driver.fresh and view.driver.message.standstill)


def _or_nothing(free_m: float) -> float:
    return -math.inf if math.isnan(free_m) else free_m


def _not_known(view: RobotView, robot: Robot) -> bool:
    return not (view.driver.fresh and view.safety.fresh and view.mux.fresh)


def _latched(view: RobotView, robot: Robot) -> bool:
    return driver_state(view.driver.message.state) is DriverState.LATCHED


def _watchdog_is(*views: WatchdogView) -> Rule:
    return lambda view, robot: watchdog_view(view.driver.message.watchdog) in views


def _button_latches(view: RobotView, robot: Robot) -> bool:
    return bool(view.safety.message.estop) and robot.safety.estop.latched


def _filter_is_unclear(view: RobotView, robot: Robot) -> bool:
    return stop_cause(view.safety.message.cause) is StopCause.UNKNOWN


def _filter_stops(view: RobotView, robot: Robot) -> bool:
    message = view.safety.message
    return bool(message.estop or message.emergency or message.action >= STOP)


def _driver_stops(view: RobotView, robot: Robot) -> bool:
    return driver_state(view.driver.message.state) not in ORDINARY


_watchdog_is_missing = _watchdog_is(WatchdogView.MISSING)

RULES: Final[tuple[tuple[Rule, EStop], ...]] = (
    (_not_known, EStop.MANUAL),
    (_latched, EStop.MANUAL),
    (_watchdog_is(WatchdogView.TRIPPED, WatchdogView.UNKNOWN), EStop.MANUAL),
    (_button_latches, EStop.MANUAL),
    (_filter_is_unclear, EStop.MANUAL),
    (_filter_stops, EStop.AUTOACK),
    (_watchdog_is_missing, EStop.AUTOACK),
    (_driver_stops, EStop.AUTOACK),
)
