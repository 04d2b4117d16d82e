"""The process drive_distance_server: ROS up, signals, the loop, and a way out that always stops the base."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from types import FrameType

import rclpy
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from canbase_action_server.drive_messages import drive_binding
from canbase_action_server.node import DriveDistanceServer
from canbase_action_server.rotate_messages import rotate_binding
from canbase_base.output import never_wait
from canbase_base.sd_notify import Service
from canbase_config.robot import Robot
from canbase_config.stopping import standstill_s
from canbase_runtime.private_process import guard_keys
from canbase_runtime.ros_end import end_ros

DELIVERY_S = 0.2
"""After the last result, for the middleware to hand it over."""
SLICE_S = 0.1


def run(robot: Robot, ros_args: list[str], when_ready: Callable[[], None] = lambda: None) -> int:
    """Serve until SIGINT or SIGTERM; 0 after an orderly end, 1 after a defect. `ros_args` as for rclpy.init;
    `when_ready`: called when all is made and nothing runs yet."""
    bindings = [drive_binding(), rotate_binding(robot)]
    if robot.action.nav2_behaviors:
        from canbase_action_server.nav2_messages import nav2_bindings  # nav2_msgs may be missing

        bindings += nav2_bindings(robot)
    guard_keys(os.environ)
    never_wait(os.environ)
    rclpy.init(args=ros_args, signal_handler_options=SignalHandlerOptions.NO)
    executor = EventsExecutor()
    node = DriveDistanceServer(robot, bindings)
    executor.add_node(node)
    asked_to_end = _catch_signals()
    when_ready()
    try:
        _serve(executor, node, asked_to_end)
        _end(executor, node, standstill_s(robot))
    finally:
        node.order_stop()
        executor.shutdown()
        end_ros(node)
    return 0 if node.failure is None else 1


def _catch_signals() -> list[int]:
    """A list that receives the number of each SIGINT and SIGTERM."""
    received: list[int] = []

    def remember(number: int, _frame: FrameType | None) -> None:
        received.append(number)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, remember)
    return received


def _serve(executor: Executor, node: DriveDistanceServer, asked_to_end: list[int]) -> None:
    service = Service()
    while not asked_to_end and node.failure is None:
        _spin(executor, node)
        service.alive("a goal runs or waits" if node.busy else "waits for goals", time.monotonic())
    service.stopping()


def _spin(executor: Executor, node: DriveDistanceServer) -> None:
    try:
        executor.spin_once(timeout_sec=SLICE_S)
        node.look_at_the_clock(time.monotonic())
    except Exception as error:  # noqa: BLE001  a defect in the action's callbacks ends here; the base must stop
        node.fail(error)


def _end(executor: Executor, node: DriveDistanceServer, stop_s: float) -> None:
    """`stop_s`: the base has this long to stand; then the goal ends without it."""
    node.shut_down()
    give_up = time.monotonic() + stop_s
    while node.busy and time.monotonic() < give_up:
        _spin(executor, node)
    node.give_up("the process ends; standstill was not confirmed in time")
    node.order_stop()
    deliver_until = time.monotonic() + DELIVERY_S
    while time.monotonic() < deliver_until:
        _spin(executor, node)
