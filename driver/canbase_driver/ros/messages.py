"""From a `DriverSnapshot` to ROS messages: odom, tf, joint_states, status, battery_state, stop_events. No node.

Frames and units are those of REP 103 and REP 105. A stamp is a builtin_interfaces/Time that the caller gives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus, DriveStatus, StopEvent
from geometry_msgs.msg import Pose, Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState
from std_msgs.msg import Header

from canbase_config.health import Battery
from canbase_driver.drives.drive_snapshot import DriveSnapshot
from canbase_driver.drives.health import Excess, supply_v
from canbase_driver.motion.odometry import Pose2D, wrap_angle
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.stop_history import StopReport

try:
    from tf2_msgs.msg import TFMessage as TFMessage
except ModuleNotFoundError:  # The ROS wheels on PyPI do not have tf2_msgs; ROS 2 from apt does.
    TFMessage = None


def odometry_message(snapshot: DriverSnapshot, stamp: Time) -> Odometry:
    """The pose in odom_frame and the velocity in base_frame, each with its covariance."""
    message = Odometry()
    message.header.stamp = stamp
    message.header.frame_id = snapshot.odometry.odom_frame
    message.child_frame_id = snapshot.odometry.base_frame
    message.pose.pose.position.x = snapshot.odometry.pose.x_m
    message.pose.pose.position.y = snapshot.odometry.pose.y_m
    message.pose.pose.orientation = _quaternion(snapshot.odometry.pose.yaw_rad)
    message.pose.covariance = snapshot.odometry.pose_covariance
    message.twist.twist.linear.x = snapshot.odometry.twist.linear_mps
    message.twist.twist.angular.z = snapshot.odometry.twist.angular_radps
    message.twist.covariance = snapshot.odometry.twist_covariance
    return message


def transform_message(snapshot: DriverSnapshot, stamp: Time) -> TransformStamped:
    """The transform odom_frame → base_frame: the pose of `odometry_message`."""
    message = TransformStamped()
    message.header.stamp = stamp
    message.header.frame_id = snapshot.odometry.odom_frame
    message.child_frame_id = snapshot.odometry.base_frame
    message.transform.translation.x = snapshot.odometry.pose.x_m
    message.transform.translation.y = snapshot.odometry.pose.y_m
    message.transform.rotation = _quaternion(snapshot.odometry.pose.yaw_rad)
    return message


def tf_message(snapshot: DriverSnapshot, stamp: Time) -> TFMessage | None:
    """For the topic tf. None where this machine's ROS has no tf2_msgs: there is no type to publish it with."""
    return None if TFMessage is None else TFMessage(transforms=[transform_message(snapshot, stamp)])


def joint_state_message(snapshot: DriverSnapshot, stamp: Time) -> JointState:
    """Angle and speed of each wheel that has given feedback; one that has not is left out, as its angle is unknown.

    Effort at the wheel [N·m] where a drive's torque is known; NaN for the others; empty where none is known.
    """
    drives = reporting_drives(snapshot)
    message = JointState()
    message.header.stamp = stamp
    message.name = [drive.joint for drive in drives]
    message.position = [drive.position_rad for drive in drives]
    message.velocity = [drive.velocity_radps for drive in drives]
    message.effort = efforts_nm(drives)
    return message


def efforts_nm(drives: list[DriveSnapshot]) -> list[float]:
    """At the wheels [N·m], NaN for a drive that is not known; empty where none is."""
    efforts = [drive.effort_nm for drive in drives]
    return [] if all(map(math.isnan, efforts)) else efforts


def battery_message(snapshot: DriverSnapshot, stamp: Time, battery: Battery) -> BatteryState:
    """The battery behind the drives' supply. `percentage` is linear from empty_v to full_v; NaN is unknown.

    The voltage falls under load, and the state of charge with it: it is a hint. sensor_msgs/BatteryState.
    """
    voltage_v = supply_v(snapshot.drives)
    share = (voltage_v - battery.empty_v) / (battery.full_v - battery.empty_v)
    unknown = math.nan
    return BatteryState(
        header=Header(stamp=stamp),
        voltage=voltage_v,
        temperature=unknown,
        current=unknown,
        charge=unknown,
        capacity=unknown,
        design_capacity=battery.design_capacity_ah or unknown,
        percentage=share if math.isnan(share) else min(max(share, 0.0), 1.0),
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        present=not math.isnan(voltage_v),
    )


def reporting_drives(snapshot: DriverSnapshot) -> list[DriveSnapshot]:
    """The drives that have given feedback."""
    return [drive for drive in snapshot.drives if not math.isnan(drive.feedback_age_s)]


def status_message(
    snapshot: DriverSnapshot, stamp: Time, warnings: Sequence[Excess] = (), bus_load: float = math.nan
) -> DriverStatus:
    """Everything that DriverStatus has a field for. Counters go round at 2³² as their type does.

    `warnings`: of `health`. `bus_load`: the share of the bus's time that frames took; NaN: unknown.
    """
    watchdog, command, cycle, bus = snapshot.watchdog, snapshot.command, snapshot.cycle, snapshot.bus
    events = command.events | cycle.events | bus.events
    return DriverStatus(
        stamp=stamp,
        state=int(snapshot.state),
        cause=snapshot.finding.cause.value,
        detail=snapshot.finding.detail,
        clears_on=snapshot.finding.clears_on,
        watchdog=watchdog.view.value,
        watchdog_cause=watchdog.cause,
        watchdog_age_s=watchdog.age_s,
        watchdog_rung=watchdog.rung,
        watchdog_lease_age_s=watchdog.lease_age_s,
        watchdog_pause_max_s=watchdog.pause_max_s,
        **{f"watchdog_{name}": count for name, count in watchdog.counters.events.items()},
        pose_resets=_u32(snapshot.odometry.pose_resets),
        standstill=snapshot.standstill,
        command_age_s=command.age_s,
        command_fresh=command.fresh,
        cycles=_u32(cycle.cycles),
        cycle_lateness_max_s=cycle.lateness_max_s,
        bus_problem=bus.problem,
        bus_load=bus_load,
        controller=bus.controller.value,
        **{name: _u32(count) for name, count in events.items()},
        drives=[_drive_status(drive, warnings) for drive in snapshot.drives],
    )


def stop_event_message(stop: StopReport, stamp: Time, black_box: str) -> StopEvent:
    """One stop for the topic stop_events. `stamp`: of its cause; `black_box`: path of its recording, empty: none."""
    record = stop.record
    return StopEvent(
        stamp=stamp,
        stopped_by=record.stopped_by,
        cause=record.cause,
        detail=record.detail,
        latched=record.latched,
        clears_on=record.clears_on,
        standstill=stop.standstill,
        standstill_s=stop.standstill_s,
        distance_m=stop.distance_m,
        turned_rad=stop.turned_rad,
        black_box=black_box,
    )


def pose_of(message: Pose) -> Pose2D:
    """The part of a pose that a base on the ground has. No rotation (all 0, or not finite) becomes NaN: refused."""
    turn = message.orientation
    is_rotation = math.isfinite(turn.z + turn.w) and math.hypot(turn.x, turn.y, turn.z, turn.w) > 0.5
    yaw_rad = wrap_angle(2.0 * math.atan2(turn.z, turn.w)) if is_rotation else math.nan
    return Pose2D(message.position.x, message.position.y, yaw_rad)


def half_turn(yaw_rad: float) -> float:
    """Half of the angle, which its quaternion is made of [rad]. An angle and the same with whole turns have one."""
    return wrap_angle(yaw_rad) / 2.0


def _quaternion(yaw_rad: float) -> Quaternion:
    half_rad = half_turn(yaw_rad)
    return Quaternion(x=0.0, y=0.0, z=math.sin(half_rad), w=math.cos(half_rad))


def _u32(counter: int) -> int:
    return counter & 0xFFFF_FFFF


def _drive_status(drive: DriveSnapshot, warnings: Sequence[Excess]) -> DriveStatus:
    return DriveStatus(
        joint=drive.joint,
        node_id=drive.node_id,
        axis=drive.axis,
        nmt_state=drive.nmt_text,
        state=drive.state_text,
        statusword=drive.statusword,
        error_code=drive.error_code,
        error_text=drive.error_text,
        target_radps=drive.target_radps,
        velocity_radps=drive.velocity_radps,
        position_rad=drive.position_rad,
        feedback_age_s=drive.feedback_age_s,
        heartbeat_age_s=drive.heartbeat_age_s,
        stops_by_itself=drive.stops_by_itself,
        voltage_v=drive.voltage_v,
        current_a=drive.current_a,
        temperature_c=drive.temperature_c,
        torque_share=drive.torque_share,
        health="; ".join(warning.text for warning in warnings if warning.joint == drive.joint),
        boot_problem=drive.boot_problem,
    )
