"""Feeds the wheels' travel into the odometry, one sample of all wheels at a time. Dead reckoning is `odometry.py`.

A wheel that lost its reference (its drive restarted, or its counter stays at another place) makes the travel of all
wheels unknown for that while: taking in the others' alone would turn the pose. The pose stands still instead, and goes
on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.robot import Base
from canbase_driver.drives.drive_group import Drives
from canbase_driver.motion.kinematics import Twist2D, base_twist
from canbase_driver.motion.odometry import Covariance, Odometry, Pose2D

LONGEST_S = 1.0
"""The mean velocity after a longer gap is taken over this time."""


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

    def __init__(self, drives: Drives, base: Base) -> None:
        self._drives, self._base = drives, base
        self._taken_at = -math.inf
        self._losses = self._sets = 0
        self.odometry = Odometry(base.track_m)
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
        return OdometryReport(
            pose=self.odometry.pose,
            twist=base_twist(*self._drives.speeds_mps(), self._base.track_m),
            pose_covariance=self.odometry.pose_covariance(),
            twist_covariance=self.odometry.twist_covariance(),
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
        losses = self._drives.losses()
        if losses != self._losses:
            self._losses = losses
            self.odometry.lose_reference()
        self.odometry.update(*self._drives.travel_m(), min(now_s - self._taken_at, LONGEST_S))
        self._taken_at = now_s
        self.serial += 1
