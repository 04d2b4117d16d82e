"""From a `DriverSnapshot` to ROS messages: odom, tf, joint_states, motor_driver/status, /diagnostics. No node or clock.

Frames and units are those of REP 103 and REP 105. A stamp is a builtin_interfaces/Time that the caller gives.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus, DriveStatus, StopEvent
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

from canbase_driver.odometry import wrap_angle
from canbase_driver.snapshot import DriverSnapshot, DriverState, DriveSnapshot, StopRecord, WatchdogView

try:
    from tf2_msgs.msg import TFMessage as TFMessage
except ModuleNotFoundError:  # The ROS wheels on PyPI do not have tf2_msgs; ROS 2 from apt does.
    TFMessage = None

_COUNTERS = ("commands_refused", "overruns", "frames_dropped", "send_errors", "travel_losses")
_TRANSIENT = {DriverState.BOOTING, DriverState.DISARMED, DriverState.ENABLING, DriverState.STOPPING}


def odometry_message(snapshot: DriverSnapshot, stamp: Time) -> Odometry:
    """The pose in odom_frame and the velocity in base_frame, each with its covariance."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = snapshot.odom_frame
    message.child_frame_id = snapshot.base_frame
    message.pose.pose.position.x = snapshot.x_m
    message.pose.pose.position.y = snapshot.y_m
    message.pose.pose.orientation = _quaternion(snapshot.yaw_rad)
    message.pose.covariance = snapshot.pose_covariance
    message.twist.twist.linear.x = snapshot.linear_mps
    message.twist.twist.angular.z = snapshot.angular_radps
    message.twist.covariance = snapshot.twist_covariance
    return message


def transform_message(snapshot: DriverSnapshot, stamp: Time) -> TransformStamped:
    """The transform odom_frame → base_frame: the pose of `odometry_message`."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = snapshot.odom_frame
    message.child_frame_id = snapshot.base_frame
    message.transform.translation.x = snapshot.x_m
    message.transform.translation.y = snapshot.y_m
    message.transform.rotation = _quaternion(snapshot.yaw_rad)
    return message


def tf_message(snapshot: DriverSnapshot, stamp: Time) -> TFMessage | None:
    """For the topic tf. None where this machine's ROS has no tf2_msgs: there is no type to publish it with."""
    return None if TFMessage is None else TFMessage(transforms=[transform_message(snapshot, stamp)])


def joint_state_message(snapshot: DriverSnapshot, stamp: Time) -> JointState:
    """Angle and speed of each wheel that has given feedback; one that has not is left out, as its angle is unknown."""
    heard = [drive for drive in snapshot.drives if not math.isnan(drive.feedback_age_s)]
    message = JointState()
    message.header.stamp = stamp
    message.name = [drive.joint for drive in heard]
    message.position = [drive.position_rad for drive in heard]
    message.velocity = [drive.velocity_radps for drive in heard]
    return message


def status_message(snapshot: DriverSnapshot, stamp: Time) -> DriverStatus:
    """Everything that DriverStatus has a field for. Counters go round at 2³² as their type does."""
    return DriverStatus(
        stamp=stamp,
        state=int(snapshot.state),
        cause=snapshot.cause,
        detail=snapshot.detail,
        clears_on=snapshot.clears_on,
        watchdog=snapshot.watchdog.value,
        watchdog_cause=snapshot.watchdog_cause,
        watchdog_age_s=snapshot.watchdog_age_s,
        standstill=snapshot.standstill,
        command_age_s=snapshot.command_age_s,
        command_fresh=snapshot.command_fresh,
        commands_refused=_u32(snapshot.commands_refused),
        cycles=_u32(snapshot.cycles),
        overruns=_u32(snapshot.overruns),
        cycle_lateness_max_s=snapshot.cycle_lateness_max_s,
        frames_dropped=_u32(snapshot.frames_dropped),
        send_errors=_u32(snapshot.send_errors),
        drives=[_drive_status(drive) for drive in snapshot.drives],
    )


def stop_event_message(stop: StopRecord, stamp: Time) -> StopEvent:
    """One stop for the topic stop_events."""
    return StopEvent(
        stamp=stamp,
        stopped_by=stop.stopped_by,
        cause=stop.cause,
        detail=stop.detail,
        latched=stop.latched,
        clears_on=stop.clears_on,
    )


def diagnostics_message(
    snapshot: DriverSnapshot, stamp: Time, *, robot: str = "robot", previous: DriverSnapshot | None = None
) -> DiagnosticArray:
    """One entry for the loop and the bus, one for the watchdog, one per drive; `robot` makes their names unique.

    `previous` is the snapshot of the message before: a counter that grew since then is a warning, an old one is not.
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    message.status = [
        _loop_entry(snapshot, previous or snapshot, robot),
        _watchdog_entry(snapshot, robot),
        *(_drive_entry(drive, snapshot.state, robot) for drive in snapshot.drives),
    ]
    return message


def _quaternion(yaw_rad: float) -> Quaternion:
    half_rad = wrap_angle(yaw_rad) / 2.0
    return Quaternion(x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad))


def _u32(counter: int) -> int:
    return counter & 0xFFFF_FFFF


def _drive_status(drive: DriveSnapshot) -> DriveStatus:
    return DriveStatus(
        joint=drive.joint,
        node_id=drive.node_id,
        axis=drive.axis,
        nmt_state=drive.nmt_state,
        state=drive.state,
        statusword=drive.statusword,
        error_code=drive.error_code,
        error_text=drive.error_text,
        target_radps=drive.target_radps,
        velocity_radps=drive.velocity_radps,
        position_rad=drive.position_rad,
        feedback_age_s=drive.feedback_age_s,
        heartbeat_age_s=drive.heartbeat_age_s,
        stops_by_itself=drive.stops_by_itself,
    )


def _loop_entry(snapshot: DriverSnapshot, previous: DriverSnapshot, robot: str) -> DiagnosticStatus:
    level, sentence = _driver_state(snapshot)
    grown = {name: getattr(snapshot, name) - getattr(previous, name) for name in _COUNTERS}
    news = ", ".join(f"{count} more {name.replace('_', ' ')}" for name, count in grown.items() if count > 0)
    if news:
        level, sentence = max(level, DiagnosticStatus.WARN), f"{sentence} Since the last report: {news}."
    values = {
        "state": snapshot.state.name,
        "cause": snapshot.cause,
        "clears on": snapshot.clears_on,
        "standstill": snapshot.standstill,
        "odometry valid": snapshot.odometry_valid,
        "command age [s]": snapshot.command_age_s,
        "command fresh": snapshot.command_fresh,
        "cycles": snapshot.cycles,
        "greatest lateness [s]": snapshot.cycle_lateness_max_s,
        **{name.replace("_", " "): getattr(snapshot, name) for name in _COUNTERS},
    }
    return _entry(level, f"{robot}: motor_driver", sentence, robot, values)


def _driver_state(snapshot: DriverSnapshot) -> tuple[bytes, str]:
    if snapshot.state is DriverState.ENABLED:
        return DiagnosticStatus.OK, "All drives are enabled."
    level = DiagnosticStatus.WARN if snapshot.state in _TRANSIENT else DiagnosticStatus.ERROR
    detail = f": {snapshot.detail.rstrip('.')}" if snapshot.detail else ""
    clears = f" It ends with: {snapshot.clears_on}." if snapshot.clears_on else ""
    return level, f"{snapshot.state.name.capitalize()} ({snapshot.cause}){detail}.{clears}"


def _watchdog_entry(snapshot: DriverSnapshot, robot: str) -> DiagnosticStatus:
    heard = _heard(snapshot.watchdog_age_s)
    level, sentence = {
        WatchdogView.OK: (DiagnosticStatus.OK, "The watchdog watches."),
        WatchdogView.MISSING: (
            DiagnosticStatus.ERROR,
            f"The watchdog is missing: its state frame was {heard}. Is its process running, and on this bus?",
        ),
        WatchdogView.TRIPPED: (
            DiagnosticStatus.ERROR,
            f"The watchdog has tripped: {snapshot.watchdog_cause}. Remove the cause, then reset.",
        ),
    }[snapshot.watchdog]
    values = {"state": snapshot.watchdog.value, "cause": snapshot.watchdog_cause, "last heard": heard}
    return _entry(level, f"{robot}: watchdog", sentence, robot, values)


def _drive_entry(drive: DriveSnapshot, state: DriverState, robot: str) -> DiagnosticStatus:
    level, sentence = _drive_state(drive, state)
    values = {
        "NMT state": drive.nmt_state,
        "CiA 402 state": drive.state,
        "statusword": f"{drive.statusword:04X}h",
        "error code": f"{drive.error_code:04X}h",
        "target [rad/s]": drive.target_radps,
        "velocity [rad/s]": drive.velocity_radps,
        "position [rad]": drive.position_rad,
        "last status TPDO": _heard(drive.feedback_age_s),
        "last heartbeat": _heard(drive.heartbeat_age_s),
        "stops by itself": drive.stops_by_itself,
    }
    place = f"node {drive.node_id} axis {drive.axis}"
    return _entry(level, f"{robot}: drive {drive.joint}", sentence, f"{robot} {place}", values)


def _drive_state(drive: DriveSnapshot, state: DriverState) -> tuple[bytes, str]:
    if drive.error_code or "fault" in drive.state:
        return DiagnosticStatus.ERROR, f"Error {drive.error_code:04X}h: {drive.error_text or drive.state}."
    if math.isnan(drive.feedback_age_s):
        return DiagnosticStatus.ERROR, f"No feedback yet; its heartbeat was {_heard(drive.heartbeat_age_s)}."
    if state is DriverState.ENABLED and not drive.stops_by_itself:
        return DiagnosticStatus.WARN, f"{drive.state.capitalize()}, but it would not stop by itself without us (1016h)."
    return DiagnosticStatus.OK, f"{drive.state.capitalize()}, {drive.nmt_state}."


def _heard(age_s: float) -> str:
    return "never heard" if math.isnan(age_s) else f"heard {age_s:.3f} s ago"


def _entry(level: bytes, name: str, sentence: str, hardware_id: str, values: Mapping[str, object]) -> DiagnosticStatus:
    entry = DiagnosticStatus(level=level, name=name, message=sentence, hardware_id=hardware_id)
    entry.values = [KeyValue(key=key, value=_text(value)) for key, value in values.items()]
    return entry


def _text(value: object) -> str:
    """A number with as many digits as somebody reads; anything else as Python writes it."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
