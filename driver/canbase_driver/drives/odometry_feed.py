"""Feeds the wheels' travel into the odometry, one sample of all wheels at a time. Dead reckoning is `odometry.py`.

A wheel that lost its reference (its drive restarted, or its counter stays at another place) makes the travel of all
wheels unknown for that while: taking in the others' alone would turn the pose. The pose stands still instead, and goes
on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.robot import Robot
from canbase_driver.drives.drive_group import Drives
from canbase_driver.motion.kinematics import Twist2D, base_twist
from canbase_driver.motion.limiter import Limiter
from canbase_driver.motion.odometry import Odometry, Pose2D
from canbase_driver.motion.pose_error import Covariance, TwistError
from canbase_driver.motion.slip import SideSlip

LONGEST_S = 1.0
"""The mean velocity after a longer gap is taken over this time."""
LOST_MAX_M = 10.0
"""What a wheel may have rolled while its travel was unknown counts as this at most: the pose is unknown by then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryReport:
    """Where the base is and how it moves, at one moment."""

    pose: Pose2D
    """Of base_frame in odom_frame; forward, to the left and unwrapped yaw, as they were at the start."""
    twist: Twist2D
    """Measured velocity of the base."""
    pose_covariance: Covariance
    twist_covariance: Covariance
    valid: bool
    """Every wheel has fresh feedback and a reference: the pose moves as the wheels do. Otherwise it is not published.

    It is about now. What was rolled while a wheel had no reference never enters the pose, of no wheel: the pose
    goes on without a jump from where it was, and `travel_losses` counts that travel is missing.
    """
    travel_losses: int = 0
    """How often the pose missed some travel since start: a drive restarted, or an encoder stayed at another place."""
    pose_resets: int = 0
    """How often the pose was reset, or missed some travel, since start: a distance across a reset is invalid."""
    odom_frame: str = "odom"
    """REP 105."""
    base_frame: str = "base_link"
    """REP 105."""

    @property
    def events(self) -> dict[str, int]:
        """What should not grow; in /diagnostics alone."""
        return {"travel_losses": self.travel_losses}


class OdometryFeed:
    """Owns the odometry of the base. `serial` grows by one with each sample that entered it."""

    def __init__(self, drives: Drives, robot: Robot) -> None:
        self._drives, self._base = drives, robot.base
        self._taken_at = -math.inf
        self._losses = self._sets = 0
        self._wheel_mps = Limiter(robot.limits, robot.base.track_m).wheel_mps
        self._left_slip, self._right_slip = (SideSlip(robot.odometry.grip_mps2) for _ in range(2))
        self._twist_error = TwistError(robot.odometry, robot.base.track_m, 1.0 / robot.rates.odometry_hz)
        self.odometry = Odometry(robot.base.track_m, robot.odometry)
        self.serial = 0

    @property
    def pose_resets(self) -> int:
        """How often the pose was reset, or missed some travel."""
        return self._sets + self._losses

    def set_pose(self, pose: Pose2D) -> None:
        """The pose goes on from there."""
        self._sets += 1
        self.odometry.reset(pose)

    def report(self, now_s: float) -> OdometryReport:
        """All of it at the time `now_s` [s, monotonic]."""
        twist = base_twist(*self._drives.speeds_mps(), self._base.track_m)
        slips_mps = self._left_slip.speed_mps, self._right_slip.speed_mps
        return OdometryReport(
            pose=self.odometry.pose,
            twist=twist,
            pose_covariance=self.odometry.pose_covariance(),
            twist_covariance=self._twist_error.covariance(twist, *slips_mps),
            valid=self._drives.are_fresh(now_s) and self._drives.have_references(),
            travel_losses=self._drives.losses(),
            pose_resets=self.pose_resets,
            odom_frame=self._base.odom_frame,
            base_frame=self._base.base_frame,
        )

    def update(self, now_s: float) -> None:
        """Take the sample in if every wheel has given a fresh one since the last; call it after each feedback."""
        axes = self._drives.axes
        for axis in axes:
            if not axis.has_fresh_sample(now_s):
                return
        for axis in axes:
            axis.sample_taken()
        if now_s > self._taken_at and self._drives.have_references():
            self._enter(now_s)

    def _enter(self, now_s: float) -> None:
        gap_s = now_s - self._taken_at
        losses = self._drives.losses()
        if losses != self._losses:
            self._losses = losses
            self._lose(gap_s)
        dt_s = min(gap_s, LONGEST_S)
        self.odometry.update(*self._drives.travel_m(), dt_s, *self._slips_m(dt_s))
        self._taken_at = now_s
        self.serial += 1

    def _lose(self, gap_s: float) -> None:
        """Nothing has measured what a wheel did in this time: as far as its limits allow, it may have rolled."""
        rolled_m = min(self._wheel_mps * gap_s, LOST_MAX_M) if math.isfinite(gap_s) else 0.0
        self.odometry.lose_reference(rolled_m)
        self._left_slip.forget()
        self._right_slip.forget()

    def _slips_m(self, dt_s: float) -> tuple[float, float]:
        left, right = ([axis.velocity_mps for axis in side] for side in (self._drives.left, self._drives.right))
        return self._left_slip.update(left, dt_s), self._right_slip.update(right, dt_s)
