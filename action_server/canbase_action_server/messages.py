"""Topics in, plain inputs out. The actions' own messages: `drive_messages.py`."""

from __future__ import annotations

from collections.abc import Mapping

from canbase.msg import DriverStatus, MuxState, SafetyState
from nav_msgs.msg import Odometry as OdometryMessage

from canbase_action_server.along_track import BasePose, yaw_of_quaternion
from canbase_action_server.inputs import Driver, Mux, Odometry, Safety
from canbase_runtime.chain_topics import ChainTopic
from canbase_runtime.driver_state import driver_state
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable
from canbase_runtime.stop_cause import stop_cause
from canbase_runtime.watchdog_view import watchdog_view


def odometry_in(message: OdometryMessage, received: float) -> Odometry | None:
    """From odom; None when a field that counts is NaN or infinite."""
    at, turn, speed = message.pose.pose.position, message.pose.pose.orientation, message.twist.twist
    yaw_rad = yaw_of_quaternion(turn.x, turn.y, turn.z, turn.w)
    odometry = Odometry(received, BasePose(at.x, at.y, yaw_rad), speed.linear.x, speed.angular.z)
    return odometry if odometry.finite() else None


def safety_in(message: SafetyState) -> Safety:
    """From safety_filter/state."""
    stops = message.action == SafetyState.STOP
    detail = printable(message.detail, SENTENCE_LENGTH)
    return Safety(stops, stop_cause(message.cause), detail, message.estop)


def driver_in(message: DriverStatus) -> Driver:
    """From motor_driver/status; a state that is not in the interface counts as offline."""
    return Driver(
        state=driver_state(message.state),
        cause=printable(message.cause),
        detail=printable(message.detail, SENTENCE_LENGTH),
        watchdog=watchdog_view(message.watchdog),
        watchdog_cause=printable(message.watchdog_cause, SENTENCE_LENGTH),
        standstill=message.standstill,
        hears_command=message.command_fresh,
        pose_resets=message.pose_resets,
    )


def mux_in(message: MuxState, own_source: str) -> Mux:
    """From velocity_mux/state. `own_source`: name of the source that the goals' orders go to."""
    locked = (source.reason for source in message.sources if source.name == own_source and source.locked)
    return Mux(printable(message.active), printable(next(locked, "")))


def contested_in(message: MuxState, states: Mapping[str, ChainTopic]) -> dict[str, str]:
    """From velocity_mux/state: which of `states` (by full name) have a second publisher, and who that is.

    A publisher of a different type is not received.
    """
    received = (found for found in message.foreign if found.topic in states and found.type == states[found.topic].type)
    sentences = ((found.topic, f"{found.node} publishes on {found.topic}: {found.problem}") for found in received)
    return {states[topic].topic: printable(sentence, SENTENCE_LENGTH) for topic, sentence in sentences}
