"""What a scanner at standstill sees of a room: several scans become one set of points, less noisy than each. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from canbase_commissioning.umbmark.planar import Array

SEEN_SHARE: Final = 0.6
"""A beam counts if this share of the scans has a reading."""
QUIET_M: Final = 0.06
"""A beam whose readings spread more (standard deviation) sees something that moves, or an edge [m]."""
LEAST_POINTS: Final = 40
"""A scan of a room has more."""


class RoomError(ValueError):
    """A scan, or two of them, cannot be used; the text says why and what helps."""


@dataclass(frozen=True, slots=True)
class Beams:
    """One sensor_msgs/LaserScan: ranges [m], and the angles of the first beam and between two of them [rad]."""

    ranges_m: Sequence[float]
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float
    range_max_m: float


def room_points(scans: Sequence[Beams], upside_down: bool = False) -> Array:
    """n × 2 points in the scanner's frame, in the order of the beams: the median of each beam.

    `upside_down`: mounted with its z axis down. Raises RoomError for scans of different form or with too few points.
    """
    forms = {(len(scan.ranges_m), scan.angle_min_rad, scan.angle_increment_rad) for scan in scans}
    if len(forms) != 1:
        raise RoomError(
            f"{len(scans)} scans with {len(forms)} different forms (beams, first angle, step): expected one"
        )
    first, ranges = scans[0], np.array([scan.ranges_m for scan in scans], dtype=float)
    ranges[~((ranges > first.range_min_m) & (ranges < first.range_max_m))] = np.nan  # NaN, and what is out of range
    seen = np.isfinite(ranges).mean(axis=0) >= SEEN_SHARE
    seen[seen] = np.nanstd(ranges[:, seen], axis=0) <= QUIET_M
    if seen.sum() < LEAST_POINTS:
        raise RoomError(
            f"{seen.sum()} of {ranges.shape[1]} beams see a wall that stands still: at least {LEAST_POINTS}"
        )
    middle = np.nanmedian(ranges[:, seen], axis=0)
    angles = (first.angle_min_rad + first.angle_increment_rad * np.arange(ranges.shape[1]))[seen]
    return np.stack([middle * np.cos(angles), middle * np.sin(angles) * (-1.0 if upside_down else 1.0)], axis=1)
