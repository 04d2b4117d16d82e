"""Is the driver's pose a pose that the base can have? Each published one is compared with the ground truth.

From the first one of a driver's life on, in motion too. What the driver says about its own pose counts for nothing: a
pose that it publishes is one that others follow. A new comparison begins where the truth says that no encoder could
know: an encoder lied, a second drive answered with the same node id, a drive's counter began anew; or the driver had no
line from a drive, and counts the loss in `pose_resets`: it cannot know whether that drive began to count anew, and
whoever follows the pose can know that travel is missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from canbase_campaign.excuses import STEP_S, Ledger
from canbase_campaign.judged_by import max_wheel_mps
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_sim.cia301.nmt import NmtState

BRAKES_MPS = 0.2
"""So much faster, or by what the drives brake since then, the base may have been when the newest sample was taken."""
BOOTS_S = 1.0
"""A driver that has a line again begins to boot the drive within this time [s]."""
HEADS_RAD = 0.02
"""... and so far beside the true heading."""
SHOWS_S = 2.0
"""What is lost in a gap shows as soon as the base is slow enough for the comparison to be sharp [s]."""
FLOOR_M, SHARE = 0.01, 0.03
"""What encoder steps, inner steps of the plant and cycles of different length may differ by."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where the base is and where it heads: x forward, y to the left at the start [m], yaw [rad]."""

    x_m: float
    y_m: float
    yaw_rad: float

    def seen_from(self, start: Place) -> tuple[float, float]:
        """Along the heading at `start`, and to its left [m]."""
        dx_m, dy_m = self.x_m - start.x_m, self.y_m - start.y_m
        cos, sin = math.cos(start.yaw_rad), math.sin(start.yaw_rad)
        return cos * dx_m + sin * dy_m, cos * dy_m - sin * dx_m


def true_place(world: World) -> Place:
    """Where the base is."""
    base = world.drives.bench.base
    return Place(base.x_m, base.y_m, base.turned_rad)


class OdometryJudge:
    """`take` every published pose; to `step` every step."""

    def __init__(self, world: World, shown: Shown, ledger: Ledger) -> None:
        self._world, self._shown, self._ledger = world, shown, ledger
        self._fastest_mps = max_wheel_mps(world.robot)
        self._late_s = world.robot.timeouts.feedback_s + 2.0 / world.robot.rates.control_hz
        """So old the newest sample in a published pose may be."""
        limits = world.robot.limits
        self._braked_mps = self._late_s * (
            limits.deceleration_mps2 + limits.angular_deceleration_radps2 * world.robot.base.track_m / 2.0
        )
        self._core: object = None
        self._lies_until = self._restarts_until = -math.inf
        """How long the newest sample may be one of a faulty encoder, or from before a counter began anew."""
        self._read_at = dict.fromkeys(world.drives.bench.nodes, world.clock.now_s)
        """When the driver had a line from each drive last."""
        self._missed_at = -math.inf
        """When one was last missing for longer than the newest sample may be old, or the adapter took nothing."""
        self._axes = [world.drives.axis(wheel) for wheel in range(len(world.robot.drives))]
        self._counters = self._counters_now()
        self._last: tuple[float, Place] | None = None
        self._origins: tuple[Place, Place] | None = None
        self._path_from_m = self._rim_from_mps = 0.0
        self._excused = ""
        """The row by which a pose beside the true one is excused now; empty: none."""
        self._beside = False
        """The newest pose needs that row."""
        self._gap_until, self._gap_unread_s = -math.inf, 0.0
        self._resets = 0
        """Published beside the poses: how often travel is missing."""
        self._unread_s = 0.0
        """The base moved for so long while the driver had no line from a drive, since it last counted a loss."""

    def step(self, now_s: float) -> None:
        """What an encoder cannot know, also while the driver hangs: it reads the counts of that time later."""
        if not self._shown.tells_truth:
            self._lies_until = now_s + self._late_s
        counters = self._counters_now()
        if counters != self._counters:
            self._counters, self._restarts_until = counters, now_s + self._late_s
        self._look_at_lines(now_s)
        rows = {"encoder lies": self._lies_until, "counter restarted": self._restarts_until}
        before, self._excused = self._excused, next((row for row, until in rows.items() if now_s <= until), "")
        if before and not self._excused:
            self._origins, self._beside = None, False  # what it missed by then is missing for ever
        elif self._excused and self._beside:
            self._ledger.excuse("odometry", self._excused)

    def _look_at_lines(self, now_s: float) -> None:
        world, blocked = self._world, self._world.bus.disturbance.blocked
        for node_id, node in world.drives.bench.nodes.items():
            sends = node.state is NmtState.OPERATIONAL and node.line.hears and not node.line.silent
            reads = world.driver.running and not world.driver.bus_problem
            if sends and reads and (f"drive{node_id}", "driver") not in blocked:
                self._read_at[node_id] = now_s
        if world.driver.bus_problem or now_s > min(self._read_at.values()) + self._late_s:
            self._missed_at = now_s
            self._unread_s += STEP_S * self._ledger.moves

    def _counters_now(self) -> list[int]:
        return [axis.encoder_offset for axis in self._axes]

    def take(self, snapshot: Any, now_s: float) -> str:
        """What is wrong with the pose in this message of odom, or an empty text."""
        driver = self._world.driver
        if driver.core is not self._core:
            self._core, self._last, self._origins, self._resets = driver.core, None, None, 0
        pose = snapshot.odometry.pose
        place = Place(pose.x_m, pose.y_m, pose.yaw_rad)
        problem = self._difference(place)
        resets_before, self._resets = self._resets, snapshot.odometry.pose_resets
        if self._resets > resets_before and now_s <= self._missed_at + BOOTS_S:
            self._gap_until, self._gap_unread_s, self._unread_s = now_s + SHOWS_S, self._unread_s, 0.0
        if now_s <= self._gap_until and (problem or self._heads_elsewhere(place)):
            self._ledger.add("odometry", "unread", self._gap_unread_s)
            self._gap_until, problem = -math.inf, self._restart(place)
        self._beside = bool(problem)
        return self._jump(place, now_s) or ("" if self._excused else problem)

    def _jump(self, place: Place, now_s: float) -> str:
        last, self._last = self._last, (now_s, place)
        if last is None:
            return ""
        moved_m = math.hypot(place.x_m - last[1].x_m, place.y_m - last[1].y_m)
        possible_m = 1.1 * self._fastest_mps * (now_s - last[0] + self._late_s) + FLOOR_M
        return f"pose moved {moved_m:.3f} m in {now_s - last[0]:.3f} s" if moved_m > possible_m else ""

    def _difference(self, place: Place) -> str:
        base, truth = self._world.drives.bench.base, true_place(self._world)
        rim_mps = max(abs(base.v_left_mps), abs(base.v_right_mps))
        if self._origins is None:
            return self._restart(place)
        seen, true = place.seen_from(self._origins[0]), truth.seen_from(self._origins[1])
        off_m = math.hypot(seen[0] - true[0], seen[1] - true[1])
        rims_mps = rim_mps + max(BRAKES_MPS, self._braked_mps) + self._rim_from_mps
        possible_m = FLOOR_M + SHARE * (base.path_m - self._path_from_m) + self._late_s * rims_mps
        return f"pose is {off_m:.3f} m beside the true one" if off_m > possible_m else ""

    def _heads_elsewhere(self, place: Place) -> bool:
        """A turn was missed: it shows in the distance later."""
        if self._origins is None:
            return False
        turned_rad = true_place(self._world).yaw_rad - self._origins[1].yaw_rad
        return abs(math.remainder(place.yaw_rad - self._origins[0].yaw_rad - turned_rad, math.tau)) > HEADS_RAD

    def _restart(self, place: Place) -> str:
        """The comparison begins anew with this pose, which nothing is wrong with."""
        base = self._world.drives.bench.base
        rim_mps = max(abs(base.v_left_mps), abs(base.v_right_mps))
        self._origins, self._path_from_m = (place, true_place(self._world)), base.path_m
        self._rim_from_mps = rim_mps + max(BRAKES_MPS, self._braked_mps) if rim_mps > 0.0 else 0.0
        return ""
