"""Three ways to drive a distance, cycle by cycle. Used by accuracy.py."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

from canbase_action_server.goal_queue import GoalQueue
from canbase_action_server.goal_request import DriveRequest, Request
from canbase_action_server.inputs import Driver, Inputs, Mux, Odometry, Safety
from canbase_action_server.motion import STOP, BaseTwist
from canbase_action_server.outcome import ErrorCode
from canbase_config.robot import Robot
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import Received
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView
from drive_rig import Case

SLOW_HZ = 10.0
"""Cycle of the lecture's loop (dt = 0.1), and default of Nav2's behavior server."""
MINIMUM_MPS = 0.1
"""Nav2's default minimum_speed."""


class Controller(Protocol):
    """One way to drive a distance."""

    period_s: float

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """The order, and whether this is the result."""


class Ours:
    """canbase."""

    def __init__(self, robot: Robot, start: Odometry, request: Request) -> None:
        self.period_s = 1.0 / robot.action.control_hz
        self._goal_queue = GoalQueue(robot)
        self._goal_queue.admit("goal", request, start.received)

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """One control cycle."""
        cycle = self._goal_queue.tick(_inputs(odometry), now_s)
        for end in cycle.ends:
            if end.outcome.code is not ErrorCode.OK:
                raise RuntimeError(f"the goal failed: {end.outcome.message}")
        return cycle.twist or STOP, bool(cycle.ends)


class Lecture:
    """Constant speed until the distance is there."""

    period_s = 1.0 / SLOW_HZ

    def __init__(self, robot: Robot, case: Case, start: Odometry) -> None:
        self._case, self._start = case, start.pose

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """One turn of the loop."""
        pose = odometry.pose
        if math.hypot(pose.x_m - self._start.x_m, pose.y_m - self._start.y_m) >= abs(self._case.distance_m):
            return STOP, True
        return BaseTwist(math.copysign(self._case.speed_mps, self._case.distance_m)), False


class StopProfile:
    """v² = 2as, with the deceleration that the robot can do."""

    period_s = 1.0 / SLOW_HZ

    def __init__(self, robot: Robot, case: Case, start: Odometry) -> None:
        self._case, self._start, self._limits = case, start.pose, robot.limits
        self._last_mps = 0.0

    def cycle(self, odometry: Odometry, now_s: float) -> tuple[BaseTwist, bool]:
        """One cycle."""
        pose, limits = odometry.pose, self._limits
        driven_m = math.hypot(pose.x_m - self._start.x_m, pose.y_m - self._start.y_m)
        left_m = abs(self._case.distance_m) - driven_m
        if left_m <= 0.0:
            return STOP, True
        stop_mps = math.sqrt(2.0 * limits.deceleration_mps2 * left_m)
        speed_mps = min(self._case.speed_mps, self._last_mps + limits.acceleration_mps2 * self.period_s, stop_mps)
        self._last_mps = max(min(MINIMUM_MPS, self._case.speed_mps), speed_mps)
        return BaseTwist(math.copysign(self._last_mps, self._case.distance_m)), False


def _inputs(odometry: Odometry) -> Inputs:
    """A healthy robot."""
    at = odometry.received
    safety = Safety(stops=False, cause=StopCause.NONE, detail="", estop=False)
    driver = Driver(DriverState.ENABLED, "none", "", WatchdogView.OK, "none", standstill=False, hears_command=True)
    return Inputs(Received(odometry, at), Received(safety, at), Received(driver, at), Received(Mux(""), at))


class FastStopProfile(StopProfile):
    """The same, as often as canbase."""

    period_s = 1.0 / 50.0


WAYS: dict[str, Callable[[Robot, Case, Odometry], Controller]] = {
    "canbase": lambda robot, case, start: Ours(robot, start, DriveRequest(case.distance_m, case.speed_mps)),
    "lecture": Lecture,
    "v² = 2as": StopProfile,
    "v² = 2as, 50 Hz": FastStopProfile,
}
