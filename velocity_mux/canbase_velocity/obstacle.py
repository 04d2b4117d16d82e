"""What obstacles leave of a command: geometry from sweep.py turned into speeds. Time comes in as ages and periods.

Rules:
1. Along the arc of the command the base must be able to stand before the stop distance, by a gentle braking that starts
   at the slow-down distance; it slows down on the same curve. From v·hold + v·T/2 = free way, with the time T of the
   gentle ramp, jerk limit included, for both speeds together.
2. The base leaves the motion that it is in only by its ramps. If the ordinary ramp would no longer stop it before half
   the stop distance after one more period of the order, the order is zero. If it no longer does now, whatever is
   ordered, the base has to brake hard.
3. Each scan is looked at twice: as it was taken, and as the base must see it after what was ordered since then.
4. Where scanners look, the base is no faster than it can stop within their range, by a scan of age `Sight.age_s`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from canbase_config.robot import Limits
from canbase_config.safety import LimitZone, Safety
from canbase_config.stopping import ramp
from canbase_velocity.clearance import Field
from canbase_velocity.ramp import Moving, follow, stop_way_s
from canbase_velocity.sweep import FULL_TURN_RAD, NO_TOUCH, Box, Floats, Touch, fastest_mps, first_touch
from canbase_velocity.twist import Twist

_EDGE_POINTS = 8
_HALVINGS = 30
_LOOKS = 4
"""Rule 4 looks at this many places of the footprint on its path, at least."""
_LOOK_RAD = 0.15
"""So far it turns from one of them to the next one at most."""
_RANGE_HALVINGS = 8
"""Rule 4 finds a speed to 0.4 % of the ordered one."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What all fresh scans together show: places of obstacles in base_link [m], and where the scanners look.

    `points` holds each place as scanned, and once more as the base must see it by now. `fields`: of each scanner whose
    last scan counts. `lost`: the first field of each one whose scans have counted, and do not any more.
    """

    points: Floats
    fields: tuple[Field, ...] = ()
    age_s: float = 0.0
    """Of the oldest first reading, at least the longest timeout of a scan, so that a limit by it is steady [s]."""
    lost: tuple[Field, ...] = ()
    everywhere: bool = True
    """Without `fields`: every place is seen, or none is."""


@dataclass(frozen=True, slots=True)
class Geometry:
    """What the judgement needs of the configuration, computed once. `hold_s`: until the next order at the latest."""

    limits: Limits
    box: Box
    stop_m: float
    gentle: Limits
    """With the decelerations that slowing down uses: the ordinary ones, or a share of them."""
    hold_s: float
    reaction_s: float
    zones: tuple[LimitZone, ...]

    @staticmethod
    def of(limits: Limits, safety: Safety, command_hz: float) -> Geometry:
        """Of these sections of robot.yaml."""
        braking_m = safety.slow_distance_m - safety.stop_distance_m
        share = min(1.0, limits.linear_mps**2 / (2.0 * braking_m) / limits.deceleration_mps2)
        gentle = {
            "deceleration_mps2": share * limits.deceleration_mps2,
            "angular_deceleration_radps2": share * limits.angular_deceleration_radps2,
        }
        return Geometry(
            limits,
            Box.of(safety.footprint, safety.padding_m),
            safety.stop_distance_m,
            limits.model_copy(update=gentle),
            1.0 / command_hz,
            safety.reaction_s,
            safety.limit_zones,
        )

    def reach_m(self, scan_timeout_s: float) -> float:
        """No obstacle farther from the footprint can matter to anything that is allowed."""
        limits = self.limits
        fastest_m_s = limits.linear_mps + limits.angular_radps * self.box.radius_m
        waits_s = scan_timeout_s + self.reaction_s + 2.0 * self.hold_s
        way_m = fastest_m_s * (waits_s + ramp(self.gentle, limits.linear_mps, limits.angular_radps).time_s / 2.0)
        zones_m = (max(zone.front_m, zone.rear_m, zone.left_m, zone.right_m) for zone in self.zones)
        return self.stop_m + max(way_m, math.sqrt(2.0) * max(zones_m, default=0.0))


@dataclass(frozen=True, slots=True)
class Judgement:
    """`share` of the command that is left, 0 to 1, for the touch that decides."""

    share: float
    touch: Touch


def allowed_share(slack_s: float, twist: Twist, gentle: Limits, hold_s: float) -> float:
    """Share k of `twist` from which the base still stands in time, by the ramp of `gentle`; at most 1.

    `slack_s`: until the last point to stand at, driven with the whole velocity: k·hold + k·T(k)/2 = slack, where T is
    the time of the ramp from k times the velocity. Found by halving, from below.
    """
    if slack_s <= 0.0:
        return 0.0
    if _needs_s(1.0, twist, gentle, hold_s) <= slack_s:
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2.0
        low, high = (middle, high) if _needs_s(middle, twist, gentle, hold_s) <= slack_s else (low, middle)
    return low


def _needs_s(share: float, twist: Twist, gentle: Limits, hold_s: float) -> float:
    return share * (hold_s + stop_way_s(Moving(twist.scaled(share)), gentle))


def judge(order: Twist, moving: Moving, sight: Sight, geometry: Geometry) -> Judgement:
    """What is left of `order` (not zero), given the motion that the base is in."""
    hold_s = geometry.hold_s
    if sight.points.shape[0] == 0:
        return Judgement(1.0, NO_TOUCH)
    if brakes_too_late(follow(moving, order, geometry.limits, hold_s), sight, geometry):
        ahead = order if moving.twist.is_zero else moving.twist
        return Judgement(0.0, first_touch(sight.points, geometry.box, ahead, geometry.stop_m))
    touch = first_touch(sight.points, geometry.box, order, geometry.stop_m)
    return Judgement(allowed_share(touch.slack_s, order, geometry.gentle, hold_s), touch)


def brakes_too_late(moving: Moving, sight: Sight, geometry: Geometry) -> bool:
    """Rule 2: from this motion the ordinary ramp leads nearer to an obstacle than half the stop distance."""
    if moving.twist.is_zero or sight.points.shape[0] == 0:
        return False
    touch = first_touch(sight.points, geometry.box, moving.twist, geometry.stop_m / 2.0)
    return touch.slack_s < stop_way_s(moving, geometry.limits)


def range_share(order: Twist, sight: Sight, geometry: Geometry) -> float:
    """Rule 4: the share of `order` (not zero), found from below, from which the footprint stays within the range of the
    scanners that face its path until it is stationary; at most 1, and 0 where even the stop distance is beyond it.

    An obstacle just beyond the range is not in the newest scan, but in the next one, at most `sight.age_s` later.
    """
    if _is_in_range(order, sight, geometry):
        return 1.0
    low = 0.0
    high = speed_factor(order, geometry.limits.linear_mps, geometry.limits.angular_radps)
    for _ in range(_RANGE_HALVINGS):
        middle = (low + high) / 2.0
        slower = order.scaled(middle)  # rounding makes 0 of the smallest
        in_range = not slower.is_zero and _is_in_range(slower, sight, geometry)
        low, high = (middle, high) if in_range else (low, middle)
    return low


def _is_in_range(order: Twist, sight: Sight, geometry: Geometry) -> bool:
    places = swept(order, geometry, sight.age_s)
    faced = [field.faces(places) for field in sight.fields]
    anyone = np.logical_or.reduce([faces for faces, _ in faced])
    near = np.logical_or.reduce([in_range for _, in_range in faced])
    return not bool((anyone & ~near).any())


def swept(order: Twist, geometry: Geometry, age_s: float = 0.0, per_side: int = _EDGE_POINTS) -> Floats:
    """Places of the edge of the footprint until it is stationary, beside where it is: by `order` from now on, which it
    has also followed for `age_s`. `per_side`: places on each side of it."""
    limits, box = geometry.limits, geometry.box
    order = order.scaled(speed_factor(order, limits.linear_mps, limits.angular_radps))
    stands_s = age_s + geometry.hold_s + geometry.reaction_s + stop_way_s(Moving(order), limits)
    way_m = geometry.stop_m + fastest_mps(box, order) * stands_s
    order = order.normalized()
    ahead_s = way_m / fastest_mps(box, order)
    places = _moved(box.edge(per_side), order, ahead_s)
    return places[~box.contains(places)]


def _moved(edge: Floats, order: Twist, ahead_s: float) -> Floats:
    """The edge of the footprint at `_LOOKS` places on the arc, or more of them in a turn."""
    turned_rad = min(abs(order.angular_radps) * ahead_s, FULL_TURN_RAD)
    looks = max(_LOOKS, math.ceil(turned_rad / _LOOK_RAD))
    times_s = np.arange(1, looks + 1) * (ahead_s / looks)
    turns_rad = order.angular_radps * times_s
    chords_m = order.linear_mps * times_s * np.sinc(turns_rad / FULL_TURN_RAD)
    cos, sin = np.cos(turns_rad)[:, np.newaxis], np.sin(turns_rad)[:, np.newaxis]
    x_m = edge[:, 0] * cos - edge[:, 1] * sin + (chords_m * np.cos(turns_rad / 2.0))[:, np.newaxis]
    y_m = edge[:, 0] * sin + edge[:, 1] * cos + (chords_m * np.sin(turns_rad / 2.0))[:, np.newaxis]
    return np.column_stack((x_m.ravel(), y_m.ravel()))


def speed_factor(twist: Twist, linear_mps: float, angular_radps: float) -> float:
    """Share of `twist` that keeps both speeds, on the same curve; at most 1."""
    return min(
        linear_mps / max(abs(twist.linear_mps), linear_mps),
        angular_radps / max(abs(twist.angular_radps), angular_radps),
    )
