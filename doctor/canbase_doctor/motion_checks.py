"""Checks of `canbase doctor --symptom` about motion: its sources, mux and filter, and the topics that report it.

Pure: from `Evidence` to one `Check` each. symptoms.py has the symptom that each belongs to.
"""

from __future__ import annotations

from typing import Any

from canbase_action_server.state_topics import MUX
from canbase_config.mux import MEASURED
from canbase_doctor.check import Check, fail, ok, too_slow, warn
from canbase_doctor.evidence import Evidence
from canbase_runtime.watchdog_view import WatchdogView, watchdog_view

CLOCKS_APART_S = 1.0
"""A stamp that is farther from this computer's clock was made with another one."""
BUSY_S = 10.0
"""Older stamps than that no busy computer explains."""
TWICE = 1.4
"""So many times as many transforms as odom messages come from two nodes; one or the other message is lost."""
FEW = 5
SHARED_TOPICS = {
    "odom": "let motor_driver alone publish it: rename the topic of the other node",
    MEASURED: "let motor_driver alone publish it: end joint_state_broadcaster (docs/ros2_control.md)",
}
"""What else publishes there in a robot with ros2_control, and what helps."""
FITTING_KEYS = {
    "geometry_msgs/msg/TwistStamped": "stamped: true",
    "geometry_msgs/msg/Twist": "stamped: false",
    "sensor_msgs/msg/JointState": "type: joint_command",
}
"""The key of a source that is published with this type."""


def zeros_are_ordered(seen: Evidence) -> Check:
    """Does the action's source order zero, or nothing, when no goal runs?"""
    name, last = "zero on cmd_vel_action", seen.on("cmd_vel_action").last
    nodes = [endpoint.node for endpoint in seen.publishers.get("cmd_vel_action", ())]
    if len(nodes) > 1:
        return fail(name, f"published by {', '.join(nodes)}", "end all but drive_distance_server")
    if seen.running:
        return warn(name, f"goal {seen.running[0].uuid} runs: the base moves by right", "cancel it, then call doctor")
    if last is not None and _moves(last):
        return fail(
            name, f"no goal runs, yet {nodes or 'somebody'} orders motion", "a defect of the server: restart it"
        )
    return ok(name, "no message" if last is None else "zero")


def mux_owner(seen: Evidence) -> Check:
    """Does no other node drive, past the mux or through it?"""
    name, mux = "who owns the base", seen.inputs.mux.within(MUX.timeout_s(seen.robot), seen.now_s)
    for topic in ("cmd_vel_mux", "cmd_vel"):
        nodes = [endpoint.node for endpoint in seen.publishers.get(topic, ())]
        if len(nodes) > 1:
            return fail(
                name, f"{topic} is published by {', '.join(nodes)}", "every source goes through a topic of mux.sources"
            )
    if mux is None:
        return fail(name, "velocity_mux publishes nothing", "start canbase serve velocity")
    if mux.active not in ("", seen.robot.mux.action_source):
        return fail(name, f"{mux.active} drives", "release it, or end its node")
    return ok(name, mux.active or "no active source")


def driver_watchdog(seen: Evidence) -> Check:
    """Does the driver turn a missing command and zero into a standstill, and does the watchdog supervise it?"""
    name, status, order = "driver and watchdog", seen.on("motor_driver/status").last, seen.on("cmd_vel").last
    if status is None:
        return fail(name, "motor_driver publishes nothing", "use the emergency stop; then check its log")
    if watchdog_view(status.watchdog) is not WatchdogView.OK:
        return fail(name, f"the watchdog is {status.watchdog}", "use the emergency stop; start it, canbase reset")
    if not status.standstill and (order is None or not _moves(order)):
        return fail(
            name, "zero is commanded, but a wheel turns", "use the emergency stop; then brake, slope, or drive settings"
        )
    return ok(name, "the base is stationary" if status.standstill else "the base moves as cmd_vel orders")


def odometry(seen: Evidence) -> Check:
    """Is it there, from one node, often enough, in the right frames, by this clock?"""
    name, heard, base = "odometry", seen.on("odom"), seen.robot.base
    if heard.last is None:
        return fail(name, "nothing on odom", "is motor_driver running, and do the drives send feedback?")
    frames = (heard.last.header.frame_id, heard.last.child_frame_id)
    if frames != (base.odom_frame, base.base_frame):
        return fail(
            name,
            f"from {frames[0]!r} to {frames[1]!r}",
            f"expected {base.odom_frame} to {base.base_frame}: another publisher?",
        )
    for topic, advice in SHARED_TOPICS.items():
        nodes = [endpoint.node for endpoint in seen.publishers.get(topic, ())]
        if len(nodes) > 1:
            return fail(name, f"{topic} is published by {', '.join(nodes)}", advice)
    apart_s = seen.wall_s - _stamp_s(heard.last)
    if abs(apart_s) > CLOCKS_APART_S:
        advice = "clocks differ: use_sim_time on a real robot, or no chrony"
        return too_slow(_excuse(seen, apart_s), name, f"its stamps are {apart_s:.1f} s old", advice)
    return ok(name, f"at {heard.rate_hz:.0f} Hz, by this clock")


def transform(seen: Evidence) -> Check:
    """Does tf carry odom → base_link, from one node?"""
    name, base, publishes = "tf", seen.robot.base, seen.robot.odometry.publish_tf
    if "tf" not in seen.heard:
        return warn(name, "this ROS 2 has no tf2_msgs: not looked at", "install ros-<distro>-tf2-msgs")
    poses = _poses(seen)
    if not poses:
        found = f"{base.odom_frame} → {base.base_frame} is missing"
        if publishes:
            return fail(name, found, "is motor_driver running? Does a node remap tf?")
        return fail(name, found, "odometry.publish_tf is false: start the filter that publishes it, or set it to true")
    others = [each.node for each in seen.publishers.get("tf", ()) if each.node.split("/")[-1] != "motor_driver"]
    if publishes and others and _alternate(poses, len(seen.on("odom").messages)):
        found = f"{base.odom_frame} → {base.base_frame} comes from motor_driver and from one of {', '.join(others)}"
        return fail(name, found, "let one publish it: odometry.publish_tf: false in robot.yaml, or its own publish_tf")
    return ok(name, f"{base.odom_frame} → {base.base_frame}")


def _poses(seen: Evidence) -> list[Any]:
    """Each odom → base_link that came."""
    wanted = (seen.robot.base.odom_frame, seen.robot.base.base_frame)
    each = [transform for message in seen.on("tf").messages for transform in message.transforms]
    return [one for one in each if (one.header.frame_id, one.child_frame_id) == wanted]


def _alternate(poses: list[Any], odom_messages: int) -> bool:
    """motor_driver publishes one with each odom: more of them, or two poses with one stamp, come from two nodes."""
    first: dict[float, Any] = {}
    differ = any(first.setdefault(_stamp_s(one), one.transform) != one.transform for one in poses)
    return differ or len(poses) > TWICE * max(odom_messages, FEW)


def sensors(seen: Evidence) -> Check:
    """Does the scan that the filter needs come, by this clock?"""
    name, scan = "stamps of the sensors", seen.robot.safety.scan
    last = seen.on(scan.topic).last
    if last is None and not scan.required:
        return ok(name, "no scan is required")
    if last is None:
        return fail(name, f"nothing on {scan.topic}, and it is required", "start the scanner; its QoS is sensor data")
    apart_s = seen.wall_s - _stamp_s(last)
    if abs(apart_s) > CLOCKS_APART_S:
        found = f"{scan.topic} is stamped {apart_s:.1f} s ago"
        advice = "clocks differ: use_sim_time on a real robot, or no chrony"
        return too_slow(_excuse(seen, apart_s), name, found, advice)
    return ok(name, f"{scan.topic} is stamped {apart_s:.2f} s ago")


def command_interface(seen: Evidence) -> Check:
    """Do all senders of velocities use the type that the mux reads, and does the driver receive its output?"""
    name = "command interface"
    for source, described in seen.robot.mux.sources.items():
        for endpoint in seen.publishers.get(described.topic, ()):
            if endpoint.type != described.message_type:
                found = f"{endpoint.node} sends {endpoint.type} on {described.topic}, expected {described.message_type}"
                key = FITTING_KEYS.get(endpoint.type)
                cure = f"set mux.sources.{source}.{key}, or " if key else ""
                return fail(name, found, f"{cure}let it send {described.message_type}")
    if not seen.subscribers.get("cmd_vel"):
        return fail(name, "no subscriber on cmd_vel", "start canbase serve driver, in the same namespace")
    return ok(name, f"{len(seen.robot.mux.sources)} sources with the right type; the driver listens")


def _excuse(seen: Evidence, apart_s: float) -> str:
    """Stamps from the future, or very old ones, are no matter of a busy computer."""
    return seen.overload.sentence if 0.0 < apart_s < BUSY_S else ""


def _moves(order: Any) -> bool:
    return bool(order.twist.linear.x != 0.0 or order.twist.angular.z != 0.0)


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec) + float(message.header.stamp.nanosec) * 1e-9
