"""Stand-ins of Nav2's velocity nodes, wired as Nav2's launch file wires them: `python nav2_stand_ins.py '{…}'`.

They have the names, topics, parameters and remappings of the real nodes, and pass velocities on as those do; they plan
nothing. Each node gets the arguments that launch_ros gives it: the remappings of a group (SetRemap), then its own.
"""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from canbase_config.nav2_chain import NODES, SMOOTHED, TELEOP, VELOCITY, Nav2Node

PERIOD_S = 0.05
TF = ("-r", "/tf:=tf", "-r", "/tf_static:=tf_static")
SPEED_MPS = 0.9
"""What the controller orders: more than velocity_smoother lets through in the tests."""


@dataclass(frozen=True)
class Wired:
    """What a launch file gives to all of them. `stamped`: default of enable_stamped_cmd_vel, false in Jazzy."""

    remappings: Sequence[tuple[str, str]] = ()
    params_file: str = ""
    stamped: bool = True

    def arguments(self, kind: Nav2Node) -> list[str]:
        """Of one node."""
        group = [word for source, target in self.remappings for word in ("-r", f"{source}:={target}")]
        own = ["-r", f"{VELOCITY}:={kind.launch_remap}"] if kind.launch_remap else []
        params = ["--params-file", self.params_file] if self.params_file else []
        return ["--ros-args", *group, *TF, *own, *params]


class StandIn:
    """One node: its publisher, what it reads, and the speed that it has read last."""

    def __init__(self, kind: Nav2Node, wired: Wired) -> None:
        self.context = Context()
        rclpy.init(args=[], context=self.context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node(kind.name, context=self.context, cli_args=wired.arguments(kind))
        self.stamped = self.parameter("enable_stamped_cmd_vel", wired.stamped)
        self.type: Any = TwistStamped if self.stamped else Twist
        self.mps = 0.0
        self.publisher = self.node.create_publisher(self.type, self.publishes(kind), 1)
        if (topic := self.receives(kind)) is not None:
            self.node.create_subscription(self.type, topic, self.on_message, 1)
        for name, value in SPEEDS.get(kind.name, {}).items():
            self.parameter(name, value)
        if kind.name == "controller_server":
            self.node.create_timer(PERIOD_S, lambda: self.publish(SPEED_MPS))

    def spin(self) -> None:
        """Until its context ends. Each node has one of its own, as in a process of its own: Fast DDS refuses a second
        message type on a topic within one.
        """
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        with suppress(ExternalShutdownException):
            executor.spin()

    def parameter(self, name: str, default: Any) -> Any:
        """As Nav2 declares it."""
        return self.node.declare_parameter(name, default).value

    def publishes(self, kind: Nav2Node) -> str:
        """Of the monitor alone a parameter."""
        return kind.publishes if kind.name != "collision_monitor" else self.parameter("cmd_vel_out_topic", VELOCITY)

    def receives(self, kind: Nav2Node) -> str | None:
        """Of the monitor and of assisted_teleop a parameter."""
        if kind.name == "collision_monitor":
            return str(self.parameter("cmd_vel_in_topic", SMOOTHED))
        return str(self.parameter("cmd_vel_teleop", TELEOP)) if kind.name == "behavior_server" else kind.receives

    def on_message(self, message: Any) -> None:
        """What the next one gets."""
        self.mps = (message.twist if self.stamped else message).linear.x
        self.pass_on()

    def pass_on(self) -> None:
        """velocity_smoother within max_velocity, collision_monitor as it came; the behaviors pass nothing on."""
        if self.node.get_name() == "velocity_smoother":
            self.publish(min(self.mps, self.node.get_parameter("max_velocity").value[0]))
        elif self.node.get_name() == "collision_monitor":
            self.publish(self.mps)

    def publish(self, mps: float) -> None:
        """Forward."""
        message = self.type()
        (message.twist if self.stamped else message).linear.x = mps
        self.publisher.publish(message)


SPEEDS: dict[str, dict[str, Any]] = {
    "velocity_smoother": {"max_velocity": [0.5, 0.0, 2.5], "min_velocity": [-0.5, 0.0, -2.5]},
    "controller_server": {"FollowPath.vx_max": 0.5, "FollowPath.vx_min": -0.35, "FollowPath.wz_max": 1.9},
    "docking_server": {"controller.v_linear_max": 0.15},
    "following_server": {"controller.v_linear_max": 0.15},
}
"""Parameters with defaults as Nav2 has them."""


def run(wired: Wired) -> None:
    """Until SIGTERM; the nodes leave the graph then."""
    stand_ins = [StandIn(kind, wired) for kind in NODES]
    for each in stand_ins:
        threading.Thread(target=each.spin, daemon=True).start()
    signal.sigwait({signal.SIGTERM, signal.SIGINT})
    for each in stand_ins:
        each.context.try_shutdown()


if __name__ == "__main__":
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
    given = json.loads(sys.argv[1])
    run(Wired(**given))
