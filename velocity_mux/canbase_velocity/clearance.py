"""From laser scans to points around the base and to the free way straight ahead and behind (REP 103, REP 117).

Which of the points are in the way of a command is sweep.py; glitches are dropped before, in glitch.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from canbase_velocity.placement import Placement
from canbase_velocity.sweep import Bools, Box, Floats

NOWHERE = np.empty((0, 2))
"""No points."""


@dataclass(frozen=True, slots=True)
class Scan:
    """What is needed of a sensor_msgs/LaserScan: ranges [m], angles [rad] in the scanner's frame."""

    ranges_m: npt.ArrayLike
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float
    scan_time_s: float = 0.0
    """How long the scanner takes for one scan [s]: its first reading is so old when the message is sent."""


@dataclass(frozen=True, slots=True)
class Clearances:
    """Free way in the straight corridor, from the edge of the footprint [m]; 0: touched, infinity: nothing seen."""

    ahead_m: float
    behind_m: float


FREE = Clearances(math.inf, math.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """What a scan sees, in base_link [m], in the order of its beams. `beams`: the index of the beam of each point."""

    at_m: Floats
    beams: npt.NDArray[np.intp]
    beam_count: int


@dataclass(frozen=True, slots=True)
class Field:
    """Where a scanner looks: its place, its first beam and the angle to its last [rad], its ranges [m]."""

    placement: Placement
    first_rad: float
    span_rad: float
    range_min_m: float
    range_max_m: float

    def sees(self, points: Floats) -> Bools:
        """Which of these places the scanner would see, if nothing stood before them."""
        ranges_m, angles_rad = self.placement.seen_from(points)
        in_range = (ranges_m >= self.range_min_m) & (ranges_m <= self.range_max_m)
        seen: Bools = in_range & (np.mod(angles_rad - self.first_rad, 2.0 * math.pi) <= self.span_rad)
        return seen


class ScanReader:
    """Turns the scans of one scanner into points. Keeps the directions of the beams from scan to scan."""

    def __init__(self) -> None:
        self._geometry: tuple[int, float, float] | None = None
        self._cos: Floats = np.empty(0)
        self._sin: Floats = np.empty(0)

    def read(self, scan: Scan, placement: Placement) -> Points | None:
        """The points; None when the scan says nothing: empty, geometry not finite, or not one usable reading.

        Readings (REP 117): +infinity and above range_max: nothing there. -infinity: too close to measure, counts as
        range_min. NaN, and finite below range_min (dust, the housing): no reading.
        """
        ranges_m = np.asarray(scan.ranges_m, dtype=np.float64)
        if not _is_sound(scan):
            return None
        ranges_m = np.where(np.isneginf(ranges_m), scan.range_min_m, ranges_m)
        usable = ranges_m >= scan.range_min_m
        if not usable.any():
            return None
        beams = np.flatnonzero(usable & (ranges_m <= scan.range_max_m) & np.isfinite(ranges_m))
        self._aim(ranges_m.size, scan.angle_min_rad, scan.angle_increment_rad)
        hit_m = ranges_m[beams]
        at_m = placement.points(hit_m * self._cos[beams], hit_m * self._sin[beams])
        return Points(at_m, beams, ranges_m.size)

    def _aim(self, count: int, angle_min_rad: float, angle_increment_rad: float) -> None:
        geometry = (count, angle_min_rad, angle_increment_rad)
        if geometry == self._geometry:
            return
        angles_rad = angle_min_rad + angle_increment_rad * np.arange(count)
        self._cos, self._sin, self._geometry = np.cos(angles_rad), np.sin(angles_rad), geometry


def field_of(scan: Scan, placement: Placement) -> Field:
    """The field of view of a scan that `ScanReader.read` understood. Each beam counts for one increment."""
    increment_rad = abs(scan.angle_increment_rad)
    span_rad = increment_rad * (np.size(scan.ranges_m) - 1)
    first_rad = scan.angle_min_rad - (span_rad if scan.angle_increment_rad < 0.0 else 0.0)
    return Field(
        placement, first_rad - increment_rad / 2.0, span_rad + increment_rad, scan.range_min_m, scan.range_max_m
    )


def clearances(points: Floats, box: Box) -> Clearances:
    """The free way straight ahead and behind. A point inside touches: ahead of the middle ahead, else behind."""
    x_m, y_m = points[:, 0], points[:, 1]
    corridor_x_m = x_m[(y_m <= box.left_m) & (y_m >= -box.right_m)]
    is_ahead = corridor_x_m > (box.front_m - box.rear_m) / 2.0
    return Clearances(
        ahead_m=_least(corridor_x_m[is_ahead] - box.front_m),
        behind_m=_least(-corridor_x_m[~is_ahead] - box.rear_m),
    )


def _is_sound(scan: Scan) -> bool:
    """Geometry from which points can be computed, and limits that can be compared with."""
    numbers = (scan.angle_min_rad, scan.angle_increment_rad, scan.range_min_m)
    return all(map(math.isfinite, numbers)) and scan.range_max_m > scan.range_min_m >= 0.0


def _least(distances_m: Floats) -> float:
    """The smallest, not below 0; infinity of none."""
    return max(0.0, float(distances_m.min(initial=math.inf)))
