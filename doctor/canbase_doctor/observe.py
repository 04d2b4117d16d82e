"""The shell of `canbase doctor`: listens to a running robot for a while, and returns what it saw. Orders nothing."""

from __future__ import annotations

import json
import math
import time
from dataclasses import replace
from functools import partial
from typing import Any, Final

import rclpy
from action_msgs.msg import GoalStatusArray
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import LaserScan

from canbase_action_server import messages
from canbase_action_server.goal_step import goal_step
from canbase_action_server.inputs import Inputs
from canbase_config.load import Loaded
from canbase_config.mux import MEASURED
from canbase_config.robot import Robot
from canbase_doctor.evidence import DOCTOR, Endpoint, Evidence, Goal, Heard, LoggedStep, VelocityTopic
from canbase_doctor.metrics_check import enabled_unit
from canbase_doctor.nav2_probe import Nav2Prober
from canbase_doctor.overload import Overload, load_per_core
from canbase_doctor.probes import SERVER, Prober, action_types
from canbase_doctor.server_processes import server_processes, talks_by
from canbase_runtime.foreign_text import clean
from canbase_runtime.received import NEVER, Received

try:
    from tf2_msgs.msg import TFMessage as TFMessage
except ModuleNotFoundError:  # not every ROS 2 has it, and canbase builds it along only where ROS 2 does not
    TFMessage = None

LATCHED: Final = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT: Final = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Understands every publisher, reliable or not."""
SLICE_S: Final = 0.1
STATES: Final = ("motor_driver/status", "safety_filter/state", "velocity_mux/state", "odom")
"""A healthy robot publishes all of them."""
DISCOVERY_S: Final = 5.0
"""The time for discovery: first messages and the first answer of the action server take this long [s]."""
STATUS: Final = "/_action/status"
VELOCITY_TYPES: Final = frozenset({"geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"})


def topics(robot: Robot) -> dict[str, tuple[type, QoSProfile]]:
    """What doctor listens to."""
    found: dict[str, tuple[type, QoSProfile]] = {
        "motor_driver/status": (DriverStatus, BEST_EFFORT),
        "safety_filter/state": (SafetyState, LATCHED),
        "velocity_mux/state": (MuxState, LATCHED),
        "odom": (Odometry, BEST_EFFORT),
        "cmd_vel_action": (TwistStamped, BEST_EFFORT),
        "cmd_vel": (TwistStamped, BEST_EFFORT),
        robot.safety.scan.topic: (LaserScan, BEST_EFFORT),
        "/rosout": (Log, LATCHED),
    }
    for action, kind in action_types(robot).items():
        found[f"{action}{STATUS}"] = (GoalStatusArray, LATCHED)
        found[f"{action}/_action/feedback"] = (kind.Impl.FeedbackMessage, BEST_EFFORT)
    return found if TFMessage is None else found | {"tf": (TFMessage, BEST_EFFORT)}


class Listener:
    """Keeps what comes on the topics."""

    def __init__(self, node: Node, robot: Robot) -> None:
        self._actions = tuple(action_types(robot))
        self._kept: dict[str, list[tuple[float, Any]]] = {}
        for topic, (kind, qos) in topics(robot).items():
            self._kept[topic] = []
            node.create_subscription(kind, topic, self._keeper(self._kept[topic]), qos)

    def heard(self) -> dict[str, Heard]:
        """By topic."""
        return {
            topic: Heard(tuple(message for _, message in kept), tuple(at_s for at_s, _ in kept))
            for topic, kept in self._kept.items()
        }

    @property
    def found_s(self) -> float:
        """When each of STATES had come once; infinite before."""
        return max(self._kept[topic][0][0] if self._kept[topic] else math.inf for topic in STATES)

    def goals(self) -> tuple[Goal, ...]:
        """As each action reported them last."""
        last = {action: self._kept[f"{action}{STATUS}"][-1:] for action in self._actions}
        return tuple(
            Goal(action, bytes(each.goal_info.goal_id.uuid).hex(), each.status)
            for action, kept in last.items()
            for _, message in kept
            for each in message.status_list
        )

    def _keeper(self, kept: list[tuple[float, Any]]) -> Any:
        return lambda message: kept.append((time.monotonic(), clean(message)))


def observe(loaded: Loaded, ros_args: list[str], seconds: float) -> Evidence:
    """What a robot publishes within `seconds` [s] after it was found, or was not."""
    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node(DOCTOR, enable_rosout=False)
        listener, nav2 = Listener(node, loaded.robot), Nav2Prober(node)
        prober = Prober(node, action_types(loaded.robot))
        until, late_s = time.monotonic() + DISCOVERY_S + seconds, 0.0
        while (left_s := until - time.monotonic()) > 0.0:
            began_s = time.monotonic()
            rclpy.spin_once(node, timeout_sec=min(SLICE_S, left_s))
            late_s = max(late_s, time.monotonic() - began_s - SLICE_S)
            until = min(until, max(listener.found_s, prober.first_answer_s) + seconds)
            prober.step(listener.goals())
            nav2.step()
        evidence = replace(_evidence(loaded, node, listener, prober), nav2_values=nav2.values())
        return replace(evidence, overload=Overload(late_s, load_per_core()))
    finally:
        rclpy.try_shutdown()


def _evidence(loaded: Loaded, node: Node, listener: Listener, prober: Prober) -> Evidence:
    heard = listener.heard()
    sources = {source.topic for source in loaded.robot.mux.sources.values()}
    names = {*topics(loaded.robot), *sources, "cmd_vel_mux", MEASURED}
    return Evidence(
        robot=loaded.robot,
        source=str(loaded.path),
        now_s=time.monotonic(),
        namespace=node.get_namespace(),
        wall_s=time.time(),
        heard=heard,
        inputs=_inputs(heard, loaded.robot.mux.action_source),
        steps=_steps(heard["/rosout"], node.get_namespace()),
        servers=_servers(node),
        publishers={name: _endpoints(node.get_publishers_info_by_topic(name)) for name in names},
        subscribers={name: _endpoints(node.get_subscriptions_info_by_topic(name)) for name in names},
        velocities=_velocities(node),
        goals=listener.goals(),
        processes=server_processes(),
        environment=talks_by("self"),
        answers=prober.answers(),
        metrics_unit=enabled_unit(loaded.path, loaded.robot.name),
    )


def _inputs(heard: dict[str, Heard], own_source: str) -> Inputs:
    def last(topic: str, read: Any) -> Received[Any]:
        value = read(heard[topic].last) if heard[topic].messages else None
        return NEVER if value is None else Received(value, heard[topic].times_s[-1])

    odom_at_s = heard["odom"].times_s[-1] if heard["odom"].messages else -math.inf
    return Inputs(
        odometry=last("odom", partial(messages.odometry_in, received=odom_at_s)),
        safety=last("safety_filter/state", messages.safety_in),
        driver=last("motor_driver/status", messages.driver_in),
        mux=last("velocity_mux/state", partial(messages.mux_in, own_source=own_source)),
    )


def _steps(log: Heard, namespace: str) -> tuple[LoggedStep, ...]:
    name = ".".join([*filter(None, namespace.split("/")), SERVER])
    lines = [line for line in log.messages if line.name == name and line.msg.startswith('{"uuid"')]
    return tuple(_step(json.loads(line.msg), _seconds(line.stamp)) for line in lines)


def _step(values: dict[str, Any], at_s: float) -> LoggedStep:
    return LoggedStep(goal_step(values.get("step")), values["uuid"], at_s, values)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def _servers(node: Node) -> dict[str, tuple[Endpoint, ...]]:
    names = [name for name, _ in node.get_topic_names_and_types() if name.endswith(STATUS)]
    found = {name.removesuffix(STATUS): _endpoints(node.get_publishers_info_by_topic(name)) for name in names}
    return {name: endpoints for name, endpoints in found.items() if endpoints}


def _velocities(node: Node) -> dict[str, VelocityTopic]:
    names = [name for name, types in node.get_topic_names_and_types() if not VELOCITY_TYPES.isdisjoint(types)]
    return {
        name: VelocityTopic(
            _endpoints(node.get_publishers_info_by_topic(name)), _endpoints(node.get_subscriptions_info_by_topic(name))
        )
        for name in names
    }


def _endpoints(infos: Any) -> tuple[Endpoint, ...]:
    found = (Endpoint(f"{info.node_namespace.rstrip('/')}/{info.node_name}", info.topic_type) for info in infos)
    return tuple(endpoint for endpoint in found if not endpoint.node.endswith(f"/{DOCTOR}"))
