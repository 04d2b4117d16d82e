"""The ROS side of `canbase setup calibrate`: drives the squares by the actions, and records wheels and scans."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, Final

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState, LaserScan

from canbase_action_server.client import DriveClient
from canbase_action_server.goal_client import SentGoal
from canbase_action_server.outcome import Status
from canbase_action_server.rotate_client import RotateClient
from canbase_cli.goal import CANCELED, exit_code
from canbase_commissioning.umbmark.planar import Array
from canbase_commissioning.umbmark.room_scan import Beams, room_points
from canbase_commissioning.umbmark.squares import Course, Move, Stop
from canbase_config.mux import MEASURED
from canbase_config.robot import Robot
from canbase_runtime.terminal import FAILED

SETTLE_S: Final = 0.4
"""A base that has just stopped rocks on its tyres: scans from before do not count [s]."""
SCANS: Final = 10
SCANS_S: Final = 15.0
"""So long may they take [s]."""
CANCEL_S: Final = 10.0
"""After a cancel the base has this long to come to a stand [s]."""


class CalibrationStopped(Exception):  # noqa: N818 - an interrupt is no error
    """A person, a goal that did not succeed, or a missing topic has ended it."""

    def __init__(self, text: str, exit_code: int) -> None:
        super().__init__(text)
        self.exit_code = exit_code


class CalibrationDrive:
    """One node that drives, and listens to scan and joint_states. `interrupted`: a person wants it to end."""

    def __init__(self, node: Node, robot: Robot, interrupted: Callable[[], bool]) -> None:
        self._robot, self._interrupted = robot, interrupted
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._drives, self._turns = DriveClient(node, self._executor), RotateClient(node, self._executor)
        self._sides = [[drive.joint for drive in robot.drives if drive.side == side] for side in ("left", "right")]
        self._angles: list[tuple[float, float]] = []
        self._scans: list[LaserScan] = []
        node.create_subscription(JointState, MEASURED, self._on_joints, 50)
        node.create_subscription(LaserScan, robot.safety.scan.topic, self._on_scan, qos_profile_sensor_data)

    def drive(self, course: Course, linear_mps: float, angular_radps: float) -> Iterator[Move]:
        """Each move of the course, before it is driven. Raises CalibrationStopped, DriveError, RoomError.

        However it ends, no goal is left open.
        """
        while (move := course.take(self._look())) is not None:
            yield move
            self._go(move, linear_mps, angular_radps)

    def _go(self, move: Move, linear_mps: float, angular_radps: float) -> None:
        goal: SentGoal[Any]
        if move.kind == "drive":
            goal = self._drives.send(move.amount, linear_mps, interrupted=self._interrupted)
        else:
            goal = self._turns.send(move.amount, angular_radps, interrupted=self._interrupted)
        try:
            result = goal.wait(until=self._interrupted)
        except BaseException:
            goal.cancel()
            raise
        if result is None:
            goal.cancel()
            result = goal.wait(CANCEL_S)
            stands = "the base is at standstill" if result else "no result within 10 s: the base may still move"
            raise CalibrationStopped(f"interrupted; {stands}", CANCELED)
        if result.status is not Status.SUCCEEDED:
            raise CalibrationStopped(f"{move}: {result.code.name}: {result.message}", exit_code(result.status))

    def _look(self) -> Stop:
        """Waits for scans of a base that stands. Raises CalibrationStopped where none come."""
        self._spin(SETTLE_S, lambda: False)
        self._scans.clear()
        if not self._spin(SCANS_S, lambda: len(self._scans) >= SCANS and bool(self._angles)):
            topics = f"{len(self._scans)} scans on {self._robot.safety.scan.topic}, {len(self._angles)} {MEASURED}"
            raise CalibrationStopped(f"{topics} within {SCANS_S:g} s: expected {SCANS} and more; do both come?", FAILED)
        points = room_points([_beams(scan) for scan in self._scans[:SCANS]], self._robot.safety.scan.upside_down)
        angles: Array = np.array(self._angles)
        del self._angles[:-1]
        return Stop(angles, points)

    def _spin(self, seconds: float, done: Callable[[], bool]) -> bool:
        deadline_s = time.monotonic() + seconds
        while not done():
            if self._interrupted():
                raise CalibrationStopped("interrupted; the base is at standstill", CANCELED)
            if time.monotonic() > deadline_s:
                return False
            self._executor.spin_once(timeout_sec=0.05)
        return True

    def _on_joints(self, message: JointState) -> None:
        angles = dict(zip(message.name, message.position, strict=False))
        if all(joint in angles for side in self._sides for joint in side):
            left, right = (sum(angles[joint] for joint in side) / len(side) for side in self._sides)
            self._angles.append((left, right))

    def _on_scan(self, message: LaserScan) -> None:
        if len(self._scans) < SCANS:
            self._scans.append(message)


def _beams(scan: LaserScan) -> Beams:
    return Beams(list(scan.ranges), scan.angle_min, scan.angle_increment, scan.range_min, scan.range_max)
