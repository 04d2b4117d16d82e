"""Is the driver's pose a pose that the base can have? Compared with the ground truth.

From each standstill after the driver's start, or after the driver reported that it missed some travel
(`travel_losses`). A second drive with the same node id reports another position, while the first one sends nothing too:
undetectable.
"""

from __future__ import annotations

import math

from canbase_action_server.along_track import Pose, displacement
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_config.stopping import max_wheel_mps

BRAKES_MPS = 0.2
"""So much faster, or by what the drives brake since then, the base may have been when the newest sample was taken."""
FLOOR_M, SHARE = 0.01, 0.03
"""What encoder steps, inner steps of the plant and cycles of different length may differ by."""


def true_pose(world: World) -> Pose:
    """Where the base is."""
    base = world.drives.bench.base
    return Pose(base.x_m, base.y_m, base.turned_rad)


class OdometryJudge:
    """To be called every step."""

    def __init__(self, world: World, shown: Shown) -> None:
        self._world, self._shown = world, shown
        self._fastest_mps = max_wheel_mps(world.robot)
        self._late_s = world.robot.timeouts.feedback_s + 2.0 / world.robot.rates.control_hz
        """So old the newest sample may be while the driver calls its odometry valid."""
        limits = world.robot.limits
        self._braked_mps = self._late_s * (
            limits.deceleration_mps2 + limits.angular_deceleration_radps2 * world.robot.base.track_m / 2.0
        )
        self._core: object = None
        self._seen_at = 0.0
        self._losses = 0
        self._lies_until = -math.inf
        """How long the newest sample may be one of a faulty encoder, or of a second drive with the same node id."""
        self._last: tuple[float, Pose] | None = None
        self._origins: tuple[Pose, Pose] | None = None
        self._path_from_m = 0.0

    def step(self, now_s: float) -> str:
        """What is wrong now, or an empty text."""
        if not self._shown.tells_truth:  # also while the driver hangs: it reads the counts of that time later
            self._lies_until = now_s + self._late_s
            self._origins = None
        driver = self._world.driver
        snapshot = driver.snapshot
        if snapshot is None or snapshot.time_s <= self._seen_at:
            return ""
        self._seen_at = snapshot.time_s
        if driver.core is not self._core:
            self._core, self._last, self._origins = driver.core, None, None
        if now_s <= self._lies_until:
            self._origins = None
        if snapshot.odometry.travel_losses != self._losses:
            self._losses, self._origins = snapshot.odometry.travel_losses, None
        if not snapshot.odometry.valid:
            return ""
        pose = Pose(snapshot.odometry.pose.x_m, snapshot.odometry.pose.y_m, snapshot.odometry.pose.yaw_rad)
        return self._jump(pose, now_s) or (self._difference(pose) if now_s > self._lies_until else "")

    def _jump(self, pose: Pose, now_s: float) -> str:
        last, self._last = self._last, (now_s, pose)
        if last is None:
            return ""
        way_m = math.hypot(pose.x_m - last[1].x_m, pose.y_m - last[1].y_m)
        possible_m = 1.1 * self._fastest_mps * (now_s - last[0] + self._late_s) + FLOOR_M
        return f"pose moved {way_m:.3f} m in {now_s - last[0]:.3f} s" if way_m > possible_m else ""

    def _difference(self, pose: Pose) -> str:
        base, truth = self._world.drives.bench.base, true_pose(self._world)
        if self._origins is None:
            if abs(base.v_left_mps) + abs(base.v_right_mps) > 0.0:
                return ""
            self._origins, self._path_from_m = (pose, truth), base.path_m
        seen, true = displacement(self._origins[0], pose), displacement(self._origins[1], truth)
        off_m = math.hypot(seen.along_m - true.along_m, seen.lateral_m - true.lateral_m)
        rim_mps = max(abs(base.v_left_mps), abs(base.v_right_mps)) + max(BRAKES_MPS, self._braked_mps)
        possible_m = FLOOR_M + SHARE * (base.path_m - self._path_from_m) + self._late_s * rim_mps
        return f"pose is {off_m:.3f} m beside the true one" if off_m > possible_m else ""
