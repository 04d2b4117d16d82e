"""ROS messages in, plain inputs out, and back. The only module here that knows the fields of messages."""

from __future__ import annotations

from canbase.action import DriveDistance
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry as OdometryMessage

from canbase_action_server.along_track import Pose, yaw_of_quaternion
from canbase_action_server.goal import Feedback
from canbase_action_server.inputs import Driver, Mux, Odometry, Safety
from canbase_action_server.motion import Twist
from canbase_action_server.outcome import Outcome

DRIVER_STATES = {
    DriverStatus.OFFLINE: "offline",
    DriverStatus.BOOTING: "booting",
    DriverStatus.DISARMED: "disarmed",
    DriverStatus.ENABLING: "enabling",
    DriverStatus.ENABLED: "enabled",
    DriverStatus.STOPPING: "stopping",
    DriverStatus.LATCHED: "latched",
}


def odometry_in(message: OdometryMessage, received: float) -> Odometry | None:
    """From odom; None when a field that counts is NaN or infinite."""
    at, turn, speed = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
    yaw_rad = yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w)
    odometry = Odometry(received, Pose(at.x, at.y, yaw_rad), speed.linear.x, speed.angular.z)
    return odometry if odometry.finite() else None


def safety_in(message: SafetyState, received: float) -> Safety:
    """From safety_filter/state."""
    stops = message.action == SafetyState.STOP
    return Safety(received, stops, message.cause, message.detail, message.estop)


def driver_in(message: DriverStatus, received: float) -> Driver:
    """From motor_driver/status; a state that is not in the interface counts as offline."""
    return Driver(
        received=received,
        state=DRIVER_STATES.get(message.state, "offline"),
        cause=message.cause,
        detail=message.detail,
        watchdog=message.watchdog,
        watchdog_cause=message.watchdog_cause,
        standstill=message.standstill,
    )


def mux_in(message: MuxState, received: float) -> Mux:
    """From velocity_mux/state."""
    return Mux(received, message.active)


def twist_out(twist: Twist, frame: str) -> TwistStamped:
    """For cmd_vel_action, not stamped yet."""
    message = TwistStamped()
    message.header.frame_id = frame
    message.twist.linear.x, message.twist.angular.z = twist.linear_mps, twist.angular_radps
    return message


def feedback_out(feedback: Feedback) -> DriveDistance.Feedback:
    """For the client on the way."""
    return DriveDistance.Feedback(traveled_m=feedback.traveled_m, remaining_m=feedback.remaining_m)


def result_out(outcome: Outcome) -> DriveDistance.Result:
    """For the client at the end."""
    return DriveDistance.Result(
        error_code=int(outcome.code),
        traveled_m=outcome.traveled_m,
        overshoot_m=outcome.overshoot_m,
        message=outcome.message,
    )
