"""A base among points in virtual time: the safety filter, the driver's own limits, a lag, a scanner. No bus, no clock.

The base really moves as canbase_driver.motion.limiter orders it, after the lag; the scanner sees where it really is.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from canbase_campaign.lidar import Fault, Lidar
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_velocity.clearance import Points
from canbase_velocity.decision import Decision
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.motion import Pose
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig
from canbase_velocity.sweep import Box, Floats
from canbase_velocity.twist import ZERO, Twist

STEP_S = 0.01
"""The driver's cycle, in which the base moves."""


def robot_with(**safety: object) -> Robot:
    """The sample robot of the bench with a scanner that is required, and other changes below `safety`."""
    robot = load_robot(sample("bench")).robot
    values = robot.model_dump()
    values["safety"] |= {"scan": {"required": True}, **safety}
    return Robot.model_validate(values)


class FilterWorld:
    """`obstacles`: places in the world [m]. `lag_s`: from the driver's order to the wheels."""

    def __init__(self, robot: Robot, obstacles: Floats, scan_period_s: float = 0.1, lag_s: float = 0.05) -> None:
        self.robot = robot
        self.filter = SafetyFilter(FilterConfig.of(robot))
        self.obstacles = obstacles
        self.pose = Pose()
        self.box = Box.of(robot.safety.footprint, 0.0)
        self.decision: Decision | None = None
        self.command = ZERO
        self.path_m = 0.0
        self.emergencies = 0
        self.scans = True
        """The scanner publishes."""
        self.lidar: Lidar | None = None
        """Its readings go the whole way into the filter; None: places do, without any noise."""
        self.fault: Fault = lambda scan: scan
        self._limiter = Limiter(robot.limits, robot.base.track_m)
        self._motion = MotionState.AT_REST
        self._wheels = deque([ZERO] * round(lag_s / STEP_S))
        self._scan_steps = round(scan_period_s / STEP_S)
        self._command_steps = round(1.0 / robot.rates.command_hz / STEP_S)
        self._step = 0

    @property
    def now_s(self) -> float:
        """Time [s]."""
        return 100.0 + self._step * STEP_S

    @property
    def seen(self) -> Floats:
        """The obstacles as the base sees them now."""
        return self.pose.from_here(self.obstacles, Pose())

    @property
    def gap_m(self) -> float:
        """From the footprint to the nearest obstacle [m]; 0: touched."""
        return float(self.box.distances_m(self.seen).min(initial=math.inf))

    def run(self, command: Twist, duration_s: float) -> float:
        """Order `command` for this long; the smallest gap meanwhile [m]."""
        self.command = command
        least_m = self.gap_m
        for _ in range(round(duration_s / STEP_S)):
            self._turn()
            least_m = min(least_m, self.gap_m)
        return least_m

    def _scan(self, now_s: float) -> None:
        scanner = self.robot.safety.scan
        if self.lidar is not None:
            sound = self.lidar.scan(self.seen)  # its stamps go on while nothing is published
            scan, wall_s = self.fault(sound), (sound.stamp_ns or 0) * 1e-9
            if self.scans:
                self.filter.on_laser_scan(scanner.topic, scan, Placement.of(scanner), now_s, wall_s)
            return
        if not self.scans:
            return
        count = self.obstacles.shape[0]
        points = Points(self.seen, np.arange(count), max(count, 1) + 1)
        self.filter.on_points(scanner.topic, points, None, now_s)

    def _turn(self) -> None:
        now_s = self.now_s
        if self._step % self._scan_steps == 0:
            self._scan(now_s)
        if self._step % self._command_steps == 0:
            self.filter.accept_command(self.command, now_s)
            self.decision = self.filter.decide(now_s)
            self.emergencies += self.decision.emergency
        assert self.decision is not None
        order = Twist2D(self.decision.twist.linear_mps, self.decision.twist.angular_radps)
        self._motion = self._limiter.step(self._motion, order, STEP_S, emergency=self.decision.emergency)
        self._wheels.append(Twist(self._motion.twist.linear_mps, self._motion.twist.angular_radps))
        wheels = self._wheels.popleft()
        before, self.pose = self.pose, self.pose.moved(wheels, STEP_S)
        self.path_m += math.hypot(self.pose.x_m - before.x_m, self.pose.y_m - before.y_m)
        self._step += 1
