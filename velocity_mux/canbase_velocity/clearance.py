"""From a laser scan to the free way around the footprint rectangle, in base_link (REP 103, REP 117).

The way ahead and behind is that of the corridor which the rectangle sweeps when it drives straight. Turning on the spot
is judged by the points inside the circle that the rectangle sweeps, by their distance from the rectangle. Arcs are not
swept yet: they count as straight, and as turning too when their centre lies inside that circle (safety_filter.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from canbase_config.safety import Footprint
from canbase_config.safety import Scan as ScanConfig

Floats: TypeAlias = "npt.NDArray[np.float64]"


@dataclass(frozen=True, slots=True)
class Scan:
    """What is needed of a sensor_msgs/LaserScan: ranges [m], angles [rad] in the scanner's frame."""

    ranges_m: npt.ArrayLike
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float


@dataclass(frozen=True, slots=True)
class Clearances:
    """Free way from the edge of the footprint to the nearest point [m], 0 when touched, infinity when nothing is seen.

    ahead, behind: in the straight corridor. around: to points inside the circle swept by turning on the spot.
    """

    ahead_m: float
    behind_m: float
    around_m: float


FREE = Clearances(math.inf, math.inf, math.inf)


def swept_radius_m(footprint: Footprint) -> float:
    """Radius of the circle around base_link that the footprint sweeps when turning on the spot [m]."""
    return math.hypot(max(footprint.front_m, footprint.rear_m), max(footprint.left_m, footprint.right_m))


class ClearanceReader:
    """Computes clearances for one footprint and one scanner. Keeps the directions of the beams from scan to scan."""

    def __init__(self, footprint: Footprint, scanner: ScanConfig) -> None:
        self._footprint = footprint
        self._scanner = scanner
        self._radius_m = swept_radius_m(footprint)
        self._geometry: tuple[int, float, float] | None = None
        self._cos: Floats = np.empty(0)
        self._sin: Floats = np.empty(0)

    def read(self, scan: Scan) -> Clearances | None:
        """The clearances; None when the scan says nothing: empty, geometry not finite, or not one usable reading.

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
        x_m, y_m = self._points(scan, ranges_m, usable & (ranges_m <= scan.range_max_m) & np.isfinite(ranges_m))
        return self._clearances(x_m, y_m)

    def _points(self, scan: Scan, ranges_m: Floats, hits: npt.NDArray[np.bool_]) -> tuple[Floats, Floats]:
        self._aim(ranges_m.size, scan.angle_min_rad, scan.angle_increment_rad)
        hit_m = ranges_m[hits]
        return self._scanner.x_m + hit_m * self._cos[hits], self._scanner.y_m + hit_m * self._sin[hits]

    def _aim(self, count: int, angle_min_rad: float, angle_increment_rad: float) -> None:
        geometry = (count, angle_min_rad, angle_increment_rad)
        if geometry == self._geometry:
            return
        angles_rad = self._scanner.yaw_rad + angle_min_rad + angle_increment_rad * np.arange(count)
        self._cos, self._sin, self._geometry = np.cos(angles_rad), np.sin(angles_rad), geometry

    def _clearances(self, x_m: Floats, y_m: Floats) -> Clearances:
        """A point inside the rectangle touches it: on its front half ahead, on its rear half behind."""
        shape = self._footprint
        in_corridor = (y_m <= shape.left_m) & (y_m >= -shape.right_m)
        corridor_x_m = x_m[in_corridor]
        beyond_x_m = np.maximum(np.maximum(x_m - shape.front_m, -shape.rear_m - x_m), 0.0)
        beyond_y_m = np.maximum(np.maximum(y_m - shape.left_m, -shape.right_m - y_m), 0.0)
        in_circle = np.hypot(x_m, y_m) <= self._radius_m
        return Clearances(
            ahead_m=_least(corridor_x_m[corridor_x_m > 0.0] - shape.front_m),
            behind_m=_least(-corridor_x_m[corridor_x_m <= 0.0] - shape.rear_m),
            around_m=_least(np.hypot(beyond_x_m, beyond_y_m)[in_circle]),
        )


def _is_sound(scan: Scan) -> bool:
    """Geometry from which points can be computed, and limits that can be compared with."""
    numbers = (scan.angle_min_rad, scan.angle_increment_rad, scan.range_min_m)
    return all(map(math.isfinite, numbers)) and scan.range_max_m > scan.range_min_m >= 0.0


def _least(distances_m: Floats) -> float:
    """The smallest, not below 0; infinity of none."""
    return max(0.0, float(distances_m.min(initial=math.inf)))
