"""Feeds the wheels' travel into the odometry, one sample of all wheels at a time. Dead reckoning is `odometry.py`.

A wheel that lost its reference (its drive restarted, or its counter jumped for good) makes the travel of all wheels
unknown for that while: taking in the others' alone would turn the pose. The pose stands still instead, and goes on.
"""

from __future__ import annotations

import math

from canbase_driver.drives.drive_group import Drives
from canbase_driver.motion.odometry import Odometry, Pose2D

LONGEST_S = 1.0
"""The mean velocity after a longer gap is taken over this time."""


class OdometryFeed:
    """Owns the odometry of the base. `serial` grows by one with each sample that entered it."""

    def __init__(self, drives: Drives, track_m: float) -> None:
        self._drives = drives
        self._taken_at = -math.inf
        self._losses = self._sets = 0
        self.odometry = Odometry(track_m)
        self.serial = 0

    @property
    def pose_resets(self) -> int:
        """How often the pose was set anew, or missed some travel."""
        return self._sets + self._losses

    def set_pose(self, pose: Pose2D) -> None:
        """The pose goes on from there."""
        self._sets += 1
        self.odometry.reset(pose)

    def update(self, now_s: float) -> None:
        """Take the sample in if every wheel has given a fresh one since the last; call it after each feedback."""
        axes = self._drives.axes
        if not all(axis.has_fresh_sample(now_s) for axis in axes):
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
