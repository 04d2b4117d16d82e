"""ROS messages from and to this package's plain values; the mux's own are in mux_messages.py. No node, no clock."""

from __future__ import annotations

import math
from typing import Any

from builtin_interfaces.msg import Time
from canbase.msg import SafetyState, StopEvent
from geometry_msgs.msg import Twist as TwistMessage
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import LaserScan

from canbase_velocity.clearance import Scan
from canbase_velocity.decision import Cause, Decision
from canbase_velocity.safety_filter import Inputs
from canbase_velocity.twist import Twist

NAN = math.nan


def twist_of(message: TwistMessage) -> Twist:
    """x and yaw of a command. NaN or infinity on an axis that a two-wheeled base does not have spoils the whole too."""
    unused = (message.linear.y, message.linear.z, message.angular.x, message.angular.y)
    if not all(map(math.isfinite, unused)):
        return Twist(NAN, NAN)
    return Twist(message.linear.x, message.angular.z)


def twist_message(twist: Twist, stamp: Time, frame_id: str) -> TwistStamped:
    """A command in `frame_id` (REP 105: base_link)."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame_id
    message.twist.linear.x = twist.linear_mps
    message.twist.angular.z = twist.angular_radps
    return message


def scan_of(message: LaserScan) -> Scan:
    """The part of a scan that clearances need."""
    return Scan(message.ranges, message.angle_min, message.angle_increment, message.range_min, message.range_max)


def safety_state(decision: Decision, inputs: Inputs, scan_is_fresh: bool, stamp: Time) -> SafetyState:
    """safety_filter/state, without what the node knows of its leases."""
    return SafetyState(
        stamp=stamp,
        action=int(decision.action),
        cause=decision.cause.value,
        detail=decision.detail,
        clears_on=decision.clears_on,
        estop=stopped_by_estop(decision),
        clearance_ahead_m=inputs.clearances.ahead_m if scan_is_fresh else NAN,
        clearance_behind_m=inputs.clearances.behind_m if scan_is_fresh else NAN,
        command_age_s=_or_nan(inputs.command_age_s),
        scan_age_s=_or_nan(inputs.scan_age_s),
        ordered_linear_mps=decision.twist.linear_mps,
        ordered_angular_radps=decision.twist.angular_radps,
    )


def stop_event(decision: Decision, stamp: Time) -> StopEvent:
    """One message on stop_events: the filter's stops clear by themselves, none is latched."""
    values: dict[str, Any] = {"cause": decision.cause.value, "detail": decision.detail, "clears_on": decision.clears_on}
    return StopEvent(stamp=stamp, stopped_by="safety_filter", latched=False, **values)


def stopped_by_estop(decision: Decision) -> bool:
    """Whether the emergency stop, or its silence, holds the base."""
    return decision.cause in (Cause.ESTOP, Cause.ESTOP_STALE)


def _or_nan(value: float | None) -> float:
    return NAN if value is None else value
