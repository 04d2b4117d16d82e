"""What obstacles leave of a command: geometry from sweep.py turned into speeds. Time comes in as ages and periods.

Rules:
1. Along the arc of the command the base must be able to stand before the stop distance, by a gentle braking that starts
   at the slow-down distance; it slows down on the same curve. From v·hold + v²/(2·a) = free way, with the time for
   both speeds together.
2. The base leaves the motion that it is in only by its ramps. If the ordinary ramp would no longer stop it before half
   the stop distance after one more period of the order, the order is zero. If it no longer does now, whatever is
   ordered, the base has to brake hard.
3. Each scan is looked at twice: as it was taken, and as the base must see it after what was ordered since then.
4. Where less than half of what the footprint will sweep is in the field of view of a scanner, the speed is limited.
5. So it is where scanners look, and too few of their beams say something, until the base would stand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from canbase_config.robot import Limits
from canbase_config.safety import LimitZone, Safety
from canbase_velocity.clearance import Field
from canbase_velocity.motion import Pose, follow
from canbase_velocity.sweep import NO_TOUCH, Box, Floats, Touch, fastest_mps, first_touch
from canbase_velocity.twist import Twist

SEEN_SHARE = 0.5
"""Rule 4: the share of the swept edge that has to be in a field of view."""
_EDGE_POINTS = 8
_LOOKS = 4
"""Rule 5 looks at so many places of the footprint on its path."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What all fresh scans together show: places of obstacles in base_link [m], and where the scanners look.

    `points` holds each place as scanned, and once more as the base must see it by now.
    """

    points: Floats
    fields: tuple[Field, ...] = ()


NOTHING_IN_SIGHT = Sight(np.empty((0, 2)))


@dataclass(frozen=True, slots=True)
class Geometry:
    """What the judgement needs of the configuration, computed once. `hold_s`: until the next order at the latest."""

    limits: Limits
    box: Box
    stop_m: float
    gentleness: float
    """Share of the ordinary deceleration that slowing down uses, 0 to 1."""
    hold_s: float
    reaction_s: float
    zones: tuple[LimitZone, ...]

    @staticmethod
    def of(limits: Limits, safety: Safety, command_hz: float) -> Geometry:
        """Of these sections of robot.yaml."""
        braking_m = safety.slow_distance_m - safety.stop_distance_m
        gentle_mps2 = limits.linear_mps**2 / (2.0 * braking_m)
        return Geometry(
            limits,
            Box.of(safety.footprint, safety.padding_m),
            safety.stop_distance_m,
            min(1.0, gentle_mps2 / limits.deceleration_mps2),
            1.0 / command_hz,
            safety.reaction_s,
            safety.limit_zones,
        )

    def reach_m(self, scan_timeout_s: float) -> float:
        """No obstacle farther from the footprint can matter to anything that is allowed."""
        limits = self.limits
        fastest_m_s = limits.linear_mps + limits.angular_radps * self.box.radius_m
        whole = Twist(limits.linear_mps, limits.angular_radps)
        waits_s = scan_timeout_s + self.reaction_s + 2.0 * self.hold_s
        way_m = fastest_m_s * (waits_s + braking_time_s(whole, limits) / (2.0 * self.gentleness))
        zones_m = (max(zone.front_m, zone.rear_m, zone.left_m, zone.right_m) for zone in self.zones)
        return self.stop_m + max(way_m, math.sqrt(2.0) * max(zones_m, default=0.0))


@dataclass(frozen=True, slots=True)
class Judgement:
    """`share` of the command that is left, 0 to 1, for the touch that decides."""

    share: float
    touch: Touch


def braking_time_s(twist: Twist, limits: Limits) -> float:
    """How long the driver's ordinary ramp from `twist` to standstill takes [s]."""
    return max(
        abs(twist.linear_mps) / limits.deceleration_mps2,
        abs(twist.angular_radps) / limits.angular_deceleration_radps2,
    )


def allowed_share(slack_s: float, braking_s: float, hold_s: float) -> float:
    """Share k of a velocity from which the base still stands in time: k·hold + k²·braking/2 = slack; at most 1.

    `slack_s`: until the last point to stand at, driven with the whole velocity. `braking_s`: from there to standstill.
    """
    if slack_s <= 0.0:
        return 0.0
    if slack_s >= hold_s + braking_s / 2.0:
        return 1.0
    return min(1.0, (math.sqrt(hold_s**2 + 2.0 * braking_s * slack_s) - hold_s) / braking_s)


def judge(order: Twist, motion: Twist, sight: Sight, geometry: Geometry) -> Judgement:
    """What is left of `order` (not zero), given the `motion` that the base is in."""
    limits, hold_s = geometry.limits, geometry.hold_s
    if sight.points.shape[0] == 0:
        return Judgement(1.0, NO_TOUCH)
    if brakes_too_late(follow(motion, order, limits, hold_s), sight, geometry):
        touch = first_touch(sight.points, geometry.box, motion if not motion.is_zero else order, geometry.stop_m)
        return Judgement(0.0, touch)
    touch = first_touch(sight.points, geometry.box, order, geometry.stop_m)
    braking_s = braking_time_s(order, limits) / geometry.gentleness
    return Judgement(allowed_share(touch.slack_s, braking_s, hold_s), touch)


def brakes_too_late(motion: Twist, sight: Sight, geometry: Geometry) -> bool:
    """Rule 2: from `motion` the ordinary ramp leads nearer to an obstacle than half the stop distance."""
    if motion.is_zero or sight.points.shape[0] == 0:
        return False
    touch = first_touch(sight.points, geometry.box, motion, geometry.stop_m / 2.0)
    return touch.slack_s < braking_time_s(motion, geometry.limits) / 2.0


def is_blind(order: Twist, sight: Sight, geometry: Geometry) -> bool:
    """Rule 4: what lies before the edge of the footprint, a stop distance along the arc of `order` (not zero)."""
    ahead_s = geometry.stop_m / fastest_mps(geometry.box, order)
    edge = geometry.box.edge(_EDGE_POINTS)
    swept = Pose().from_here(edge, Pose().moved(order, ahead_s))
    swept = swept[~geometry.box.contains(swept)]
    seen = np.zeros(swept.shape[0], dtype=np.bool_)
    for field in sight.fields:
        seen |= field.sees(swept)
    return bool(seen.sum() < SEEN_SHARE * swept.shape[0])


def told_share(order: Twist, sight: Sight, geometry: Geometry) -> float:
    """Rule 5: of the places where the footprint will be until it stands, by `order` (not zero) from now on, and that a
    scanner faces, the share that is covered by usable readings; 1 where no scanner faces any."""
    limits, box = geometry.limits, geometry.box
    order = order.scaled(speed_factor(order, limits.linear_mps, limits.angular_radps))
    stands_s = geometry.hold_s + geometry.reaction_s + braking_time_s(order, limits) / 2.0
    ahead_s = geometry.stop_m / fastest_mps(box, order) + stands_s
    edge, start = box.edge(_EDGE_POINTS), Pose()
    poses = (start.moved(order, ahead_s * step / _LOOKS) for step in range(1, _LOOKS + 1))
    swept = np.concatenate([start.from_here(edge, pose) for pose in poses])
    swept = swept[~box.contains(swept)]
    covered = [field.covers(swept) for field in sight.fields]
    faced = np.logical_or.reduce([faces for faces, _ in covered])
    told = np.logical_or.reduce([told for _, told in covered])
    return float(told.sum() / faced.sum()) if faced.any() else 1.0


def zone_factor(order: Twist, zone: LimitZone, sight: Sight) -> float:
    """Share of `order` that the zone leaves: 1 while it is empty."""
    box = Box(zone.front_m, zone.rear_m, zone.left_m, zone.right_m)
    if not box.contains(sight.points).any():
        return 1.0
    return speed_factor(order, zone.linear_mps, zone.angular_radps)


def speed_factor(twist: Twist, linear_mps: float, angular_radps: float) -> float:
    """Share of `twist` that keeps both speeds, on the same curve; at most 1."""
    return min(
        linear_mps / max(abs(twist.linear_mps), linear_mps),
        angular_radps / max(abs(twist.angular_radps), angular_radps),
    )
