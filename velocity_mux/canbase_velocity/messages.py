"""ROS messages from and to this package's plain values; the mux's own are in mux_messages.py. No node, no clock."""

from __future__ import annotations

import math

from builtin_interfaces.msg import Time
from canbase.msg import SafetyState, ScannerState
from geometry_msgs.msg import Twist as TwistMessage
from sensor_msgs.msg import LaserScan

from canbase_velocity.clearance import Clearances
from canbase_velocity.decision import Decision
from canbase_velocity.delay import Sent
from canbase_velocity.placement import Transform
from canbase_velocity.safety_filter import Inputs, ScanState
from canbase_velocity.scan import Scan
from canbase_velocity.twist import Twist

try:
    from tf2_msgs.msg import TFMessage as TFMessage
except ModuleNotFoundError:  # a ROS 2 without it: its scanners have their pose in robot.yaml
    TFMessage = None

NAN = math.nan


def twist_of(message: TwistMessage) -> Twist:
    """x and yaw of a command. NaN or infinity on an axis that a two-wheeled base does not have spoils the whole too."""
    unused = (message.linear.y, message.linear.z, message.angular.x, message.angular.y)
    if not all(map(math.isfinite, unused)):
        return Twist(NAN, NAN)
    return Twist(message.linear.x, message.angular.z)


def sent_at(stamp: Time, wall_s: float, now_s: float) -> Sent | None:
    """The times of a command that was taken in at `wall_s` by this computer's clock and at `now_s`, monotonic [s].
    None: its stamp is zero, which carries no time.
    """
    stamp_s = stamp.sec + stamp.nanosec * 1e-9
    return Sent(stamp_s, wall_s, now_s) if stamp_s > 0.0 else None


def scan_of(message: LaserScan) -> Scan:
    """The part of a scan that the filter needs. A scan time that is none counts as 0."""
    scan_time_s = message.scan_time if math.isfinite(message.scan_time) else 0.0
    return Scan(
        message.ranges,
        message.angle_min,
        message.angle_increment,
        message.range_min,
        message.range_max,
        scan_time_s,
        message.angle_max,
        message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec,
        message.header.frame_id,
    )


def transforms_of(message: TFMessage) -> dict[str, Transform]:
    """The transforms of a message on tf_static, by their child frame. A leading / is of the old tf, and left out."""
    placed = {}
    for each in message.transforms:
        at, turn = each.transform.translation, each.transform.rotation
        parent = each.header.frame_id.lstrip("/")
        placed[each.child_frame_id.lstrip("/")] = Transform(parent, at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w)
    return placed


def safety_state(decision: Decision, inputs: Inputs, free: Clearances | None, stamp: Time) -> SafetyState:
    """safety_filter/state, without what the node knows of its leases. `free` None: no fresh scan."""
    return SafetyState(
        stamp=stamp,
        action=int(decision.action),
        cause=decision.cause.value,
        detail=decision.detail,
        clears_on=decision.clears_on,
        estop=decision.cause.is_estop,
        emergency=decision.emergency,
        clearance_ahead_m=free.ahead_m if free else NAN,
        clearance_behind_m=free.behind_m if free else NAN,
        command_age_s=or_nan(inputs.command_age_s),
        scan_age_s=or_nan(oldest_scan_s(inputs.scans)),
        ordered_linear_mps=decision.twist.linear_mps,
        ordered_angular_radps=decision.twist.angular_radps,
        scanners=[_scanner_state(scan) for scan in inputs.scans],
    )


def _scanner_state(scan: ScanState) -> ScannerState:
    return ScannerState(
        topic=scan.topic,
        required=scan.required,
        fresh=scan.is_fresh,
        age_s=or_nan(scan.age_s),
        usable_share=or_nan(scan.usable_share),
        dropped=scan.dropped,
        problem=scan.problem or scan.why_dropped,
    )


def oldest_scan_s(scans: tuple[ScanState, ...]) -> float | None:
    """Age of the oldest scan among those that are required, or among all where none is [s], infinite where one is
    missing; None: there is no scanner."""
    counting = [scan.age_s for scan in scans if scan.required] or [scan.age_s for scan in scans]
    return max(counting, default=None)


def or_nan(value: float | None) -> float:
    """What a message has for a value that is not known, or for the age of what was never received."""
    return NAN if value is None or math.isinf(value) else value
