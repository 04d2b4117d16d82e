"""Whether scanners see the area that a command needs: the footprint on its path until standstill, and limit zones.

Rules:
1. A place counts as free only where the newest scan of a fresh scanner covers it (`Field.covers`). Nothing that was not
   received makes a place free: neither a share of beams, nor covered places beside it. The outcome of a place that is
   not covered is a stop, or at most blind_mps (safety_filter.py).
2. What a scanner looked at with its first scan, and does not look at any more, is not covered, though another scanner
   covers it: the first scanner may have seen what the other one cannot. This holds for a scanner whose scans do not
   count any more, and for one whose field has become narrower, shorter or coarser.
3. Places within GAP_M of where the footprint is need no cover: no leg is hidden there.
4. A limit zone of which a place is not covered counts as occupied.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from canbase_config.safety import LimitZone
from canbase_velocity.clearance import GAP_M
from canbase_velocity.obstacle import Geometry, Sight, speed_factor, swept
from canbase_velocity.sweep import Bools, Box, Floats
from canbase_velocity.twist import Twist

EDGE_M = 0.05
"""The places on the edge of the footprint are so far apart at most [m]: a gap of 0.11 m, EDGE_M + 2 GAP_M, is seen."""
MOST_PER_SIDE = 40
"""On a side that is longer than 2 m they are farther apart."""
ZONE_PLACES = 12
"""Rule 4 looks at so many places along each side of a zone."""


class Why(enum.Enum):
    """Why a place is not covered."""

    LOST = "lost"
    """By rule 2."""
    UNREAD = "unread"
    """A scanner looks there, and none of its beams has a reading beside."""
    UNSEEN = "unseen"
    """No scanner looks there."""


@dataclass(frozen=True, slots=True)
class Gap:
    """The path of a command is not covered. `share`: of its places that are. `topics`: of the scanners that are lost,
    or have no reading."""

    why: Why
    share: float
    topics: tuple[str, ...] = ()


def uncovered(order: Twist, sight: Sight, geometry: Geometry) -> Gap | None:
    """What of the path of `order` (not zero) is not covered; None: nothing."""
    places = swept(order, geometry, per_side=_per_side(geometry.box))
    places = places[geometry.box.distances_m(places) > GAP_M]
    covered = _covered(places, sight)
    if covered.all():
        return None
    share, open_places = float(covered.mean()), places[~covered]
    lost = [field for field in sight.lost if field.claims(open_places).any()]
    lost += [field for field in sight.fields if field.lost(open_places).any()]
    if lost:
        return Gap(Why.LOST, share, tuple(field.topic for field in lost))
    unread = tuple(field.topic for field in sight.fields if field.claims(open_places).any())
    return Gap(Why.UNREAD if unread else Why.UNSEEN, share, unread)


def zone_factor(order: Twist, zone: LimitZone, sight: Sight, geometry: Geometry) -> float:
    """Share of `order` that the zone leaves: 1 while it is seen to be empty."""
    box = Box(front_m=zone.front_m, rear_m=zone.rear_m, left_m=zone.left_m, right_m=zone.right_m)
    if not box.contains(sight.points).any() and is_seen(zone, sight, geometry):
        return 1.0
    return speed_factor(order, zone.linear_mps, zone.angular_radps)


def is_seen(zone: LimitZone, sight: Sight, geometry: Geometry) -> bool:
    """Rule 4: every place of the zone beside the footprint is covered."""
    return bool(_covered(_zone_places(zone, geometry.box), sight).all())


def _covered(places: Floats, sight: Sight) -> Bools:
    """Rules 1 and 2."""
    covered = np.full(places.shape[0], sight.everywhere and not sight.fields)
    for field in sight.fields:
        covered |= field.covers(places)
    for field in sight.lost:
        covered &= ~field.claims(places)
    for field in sight.fields:
        covered &= ~field.lost(places)
    return covered


@lru_cache(maxsize=16)
def _per_side(box: Box) -> int:
    longest_m = max(box.front_m + box.rear_m, box.left_m + box.right_m)
    return min(MOST_PER_SIDE, math.ceil(longest_m / EDGE_M))


@lru_cache(maxsize=16)
def _zone_places(zone: LimitZone, box: Box) -> Floats:
    along_m = np.linspace(-zone.rear_m, zone.front_m, ZONE_PLACES)
    across_m = np.linspace(-zone.right_m, zone.left_m, ZONE_PLACES)
    places = np.stack(np.meshgrid(along_m, across_m), axis=-1).reshape(-1, 2)
    places = places[box.distances_m(places) > GAP_M]
    places.flags.writeable = False
    return places
