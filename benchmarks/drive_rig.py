"""A base, the motor driver and odometry in virtual time, for one goal after the other. Used by accuracy.py.

Body, friction, slip and servo are those of the simulated drives; limits and kinematics are the driver's own.
"""

from __future__ import annotations

import math
import random
from collections import deque
from dataclasses import dataclass

from canbase_action_server.along_track import BasePose
from canbase_action_server.inputs import Odometry
from canbase_action_server.motion import STOP, BaseTwist
from canbase_config.robot import Robot
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_driver.motion.limiter import Limiter, MotionState
from canbase_sim.plant.base import Base, MountedWheel, PlantParameters


@dataclass(frozen=True, slots=True)
class Case:
    """One goal on one base."""

    seed: int
    distance_m: float
    speed_mps: float
    body: PlantParameters
    control_hz: float
    odometry_hz: float
    chain_s: float
    """From the order to the driver: two hops over DDS."""


class Rig:
    """Base, driver and odometry of one case, in virtual time. The driver's limits and kinematics are the real ones."""

    def __init__(self, robot: Robot, case: Case) -> None:
        self._robot, self._case = robot, case
        self._chance = random.Random(case.seed)
        left, right = (MountedWheel(case.body.motor(2), 1) for _ in range(2))
        self._motors = (left.motor, right.motor)
        self.base = Base(case.body, robot.base.track_m, robot.base.standstill_mps, [left], [right], 0.0)
        for motor in self._motors:
            motor.power_on()
        drive = robot.drives[0]
        self._count_m = 2.0 * math.pi * robot.base.wheel_radius_m / (drive.gear_ratio * drive.counts_per_motor_rev)
        self._limiter, self._state = Limiter(robot.limits, robot.base.track_m), MotionState.AT_REST
        self._pipe: deque[tuple[float, BaseTwist]] = deque()
        self._order = STOP
        self._pose, self._counts = BasePose(0.0, 0.0, 0.0), (0, 0)
        self._transit: deque[Odometry] = deque()
        self.odometry = Odometry(0.0, self._pose, 0.0, 0.0)
        self._next_drive = self._next_odometry = 0.0

    @property
    def way_m(self) -> float:
        """By encoder, signed."""
        return (self.base.travel_left_m + self.base.travel_right_m) / 2.0

    @property
    def turned_rad(self) -> float:
        """By encoder, signed, not wrapped."""
        return (self.base.travel_right_m - self.base.travel_left_m) / self._robot.base.track_m

    def order(self, twist: BaseTwist, now_s: float) -> None:
        """A velocity order enters the chain."""
        self._pipe.append((now_s + self._case.chain_s * self._chance.uniform(0.3, 1.0), twist))

    def step(self, now_s: float) -> None:
        """One inner step that ends at `now_s`."""
        self.base.step(now_s)
        while self._pipe and self._pipe[0][0] <= now_s:
            self._order = self._pipe.popleft()[1]
        if now_s >= self._next_drive:
            self._next_drive += 1.0 / self._case.control_hz
            self._drive()
        if now_s >= self._next_odometry:
            self._next_odometry += 1.0 / self._case.odometry_hz
            self._publish(now_s)
        while self._transit and self._transit[0].received <= now_s:
            self.odometry = self._transit.popleft()

    def _drive(self) -> None:
        """A cycle of the motor driver: encoders in, setpoints out."""
        self._integrate()
        target = Twist2D(self._order.linear_mps, self._order.angular_radps)
        self._state = self._limiter.step(self._state, target, 1.0 / self._case.control_hz)
        speeds = wheel_speeds(self._state.twist, self._robot.base.track_m)
        slope = 2.0 * max(self._robot.limits.acceleration_mps2, self._robot.limits.deceleration_mps2)
        for motor, speed_mps in zip(self._motors, speeds, strict=True):
            motor.run(speed_mps, slope, slope)

    def _integrate(self) -> None:
        ways = (self.base.travel_left_m, self.base.travel_right_m)
        counts = (round(ways[0] / self._count_m), round(ways[1] / self._count_m))
        left_m, right_m = ((new - old) * self._count_m for new, old in zip(counts, self._counts, strict=True))
        self._counts = counts
        turned_rad = (right_m - left_m) / self._robot.base.track_m
        heading = self._pose.yaw_rad + turned_rad / 2.0
        way_m = (left_m + right_m) / 2.0
        x_m, y_m = self._pose.x_m + way_m * math.cos(heading), self._pose.y_m + way_m * math.sin(heading)
        self._pose = BasePose(x_m, y_m, self._pose.yaw_rad + turned_rad)

    def _publish(self, now_s: float) -> None:
        """What the driver's last cycle saw; it arrives late and unevenly."""
        arrives = now_s + self._chance.uniform(0.0005, 0.4 / self._case.odometry_hz)
        left_mps, right_mps = self.base.v_left_mps, self.base.v_right_mps
        turn_radps = (right_mps - left_mps) / self._robot.base.track_m
        self._transit.append(Odometry(arrives, self._pose, (left_mps + right_mps) / 2.0, turn_radps))
