"""From laser scans to points around the base and to the free way straight ahead and behind (REP 103, REP 117).

Which of the points are in the way of a command is sweep.py; glitches are dropped before, in glitch.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from canbase_config.safety import Scan as ScanConfig
from canbase_runtime.foreign_text import printable
from canbase_velocity.placement import Placement
from canbase_velocity.scan import Scan, ScanError, check
from canbase_velocity.sweep import FULL_TURN_RAD, Bools, Box, Floats

NOWHERE = np.empty((0, 2))
"""No points."""


MAX_BEAMS: Final = 1440
"""A scan with more readings is thinned out: of neighbours that are taken together the nearest counts."""
TOO_NEAR_M: Final = 0.001
"""What is too near to be measured is taken to be so far beside the footprint [m]: the base can drive away."""
GAP_M: Final = 0.03
"""A place this far beside a beam with a reading is covered by it [m]: no leg is hidden between two of them."""


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


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Where a scanner looks: its place, its first beam and the angle to its last [rad], its ranges [m].

    Rules of `covers`, for a place that the scanner's newest scan covers:
    1. It is within the range of that scan, and of the first one.
    2. A beam with a reading passes it no farther away than the beams of the first scan are apart, or than GAP_M.
    A place nearer than range_min is covered too: what is there takes the reading from its beam.
    """

    placement: Placement
    first_rad: float
    span_rad: float
    range_min_m: float
    range_max_m: float
    increment_rad: float = 0.0
    says: npt.NDArray[np.intp] | None = None
    """The beams with a reading, by their number from `first_rad` on, rising. None: all of them have one."""
    first: Field | None = None
    """Of the first scan since the start, which states where the scanner looks; None: this one is the first."""
    topic: str = ""

    def faces(self, points: Floats) -> tuple[Bools, Bools]:
        """Which of these places it faces, at any range, and which of them are within its range."""
        ranges_m, from_first_rad = self.seen_from(points)
        faces: Bools = (ranges_m >= self.range_min_m) & (from_first_rad <= self.span_rad)
        return faces, faces & (ranges_m <= self.range_max_m)

    def covers(self, points: Floats) -> Bools:
        """Which of these places its newest scan covers: nothing is there, or the obstacle has a reading."""
        ranges_m, from_first_rad = self.seen_from(points)
        return self._near_a_beam(self._gaps_rad(from_first_rad), ranges_m)

    def claims(self, points: Floats) -> Bools:
        """Which of these places the first scan looked at, with or without a reading."""
        first = self.first or self
        ranges_m, from_first_rad = first.seen_from(points)
        claimed: Bools = (from_first_rad <= first.span_rad) & (ranges_m <= first.range_max_m)
        return claimed

    def lost(self, points: Floats) -> Bools:
        """Which of these places the first scan looked at, and the newest one does not any more."""
        if self.first is None or self._is_as_wide_as(self.first):
            return np.zeros(points.shape[0], dtype=np.bool_)
        ranges_m, from_first_rad = self.seen_from(points)
        looked: Bools = self.claims(points) & ~self._near_a_beam(self._beside_rad(from_first_rad), ranges_m)
        return looked

    def _is_as_wide_as(self, first: Field) -> bool:
        mine = self.placement, self.first_rad, self.span_rad, self.increment_rad
        same = mine == (first.placement, first.first_rad, first.span_rad, first.increment_rad)
        return same and self.range_max_m >= first.range_max_m

    def _near_a_beam(self, gaps_rad: Floats, ranges_m: Floats) -> Bools:
        first = self.first or self
        near: Bools = (gaps_rad <= first.increment_rad) | (gaps_rad * ranges_m <= GAP_M)
        return near & (ranges_m <= min(self.range_max_m, first.range_max_m))

    def seen_from(self, points: Floats) -> tuple[Floats, Floats]:
        """How far these places are [m], and their angle from `first_rad` on, 0 to 2π."""
        ranges_m, angles_rad = self.placement.seen_from(points)
        from_first_rad: Floats = np.mod(angles_rad - self.first_rad, FULL_TURN_RAD)
        return ranges_m, from_first_rad

    def _beside_rad(self, from_first_rad: Floats) -> Floats:
        """From each of these directions to the nearest beam; between two of them half of their distance."""
        beyond_rad = np.minimum(from_first_rad - self.span_rad, FULL_TURN_RAD - from_first_rad)
        beside_rad: Floats = np.maximum(beyond_rad, 0.0) + self.increment_rad / 2.0
        return beside_rad

    def _gaps_rad(self, from_first_rad: Floats) -> Floats:
        """From each of these directions to the nearest beam with a reading."""
        if self.says is None:
            return self._beside_rad(from_first_rad)
        return self._gaps(from_first_rad / self.increment_rad - 0.5) * self.increment_rad

    def _gaps(self, at: Floats) -> Floats:
        """From each of these directions, counted in beams, to the nearest beam with a reading."""
        assert self.says is not None
        around = FULL_TURN_RAD / self.increment_rad
        says = np.concatenate(([self.says[-1] - around], self.says, [self.says[0] + around]))
        above = np.clip(np.searchsorted(says, at), 1, says.size - 1)
        gaps: Floats = np.minimum(np.abs(at - says[above - 1]), np.abs(says[above] - at))
        return gaps


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What one scan shows. `share`: of its beams that have a reading, above 0, at most 1."""

    points: Points
    field: Field
    share: float


class ScanReader:
    """Turns the scans of one scanner into points. Keeps the directions of the beams from scan to scan."""

    def __init__(self, config: ScanConfig, box: Box | None = None) -> None:
        """`box`: the footprint; None: what is too near to be measured counts as range_min, wherever that is."""
        self._config = config
        self._box = box
        self._geometry: tuple[int, float, float] | None = None
        self._cos: Floats = np.empty(0)
        self._sin: Floats = np.empty(0)
        self._sign = 0.0
        self._frame: str | None = None
        self._other_frame: str | None = None

    def read(self, scan: Scan, placement: Placement) -> View:
        """What the scan shows. Raises ScanError for a scan that cannot be used, or in which no beam has a reading.

        Readings (REP 117): +infinity and above range_max: nothing there. -infinity: too near to be measured, counts as
        the place of its beam next to the footprint, at most range_min away; so does a finite one below range_min (0,
        dust, the housing) where safety.scan.below_range_min is too_near. Otherwise that and NaN are no reading: such a
        beam has no reading.
        """
        check(scan)
        self._hold_frame(scan.frame)
        self._hold_direction(scan.angle_increment_rad)
        self._aim(scan.count, scan.angle_min_rad, scan.angle_increment_rad)
        ranges_m = np.asarray(scan.ranges_m, dtype=np.float64)
        near = ranges_m < scan.range_min_m if self._config.below_range_min == "too_near" else np.isneginf(ranges_m)
        usable = near | (ranges_m >= scan.range_min_m)
        if not usable.any():
            raise ScanError(f"none of its {ranges_m.size} readings is usable")
        hit_m = np.where(usable & (ranges_m <= scan.range_max_m), ranges_m, np.inf)
        if near.any():
            hit_m = np.where(near, np.minimum(self._beside_m(placement), scan.range_min_m), hit_m)
        if not (self._config.allow_empty or np.isfinite(hit_m).any()):
            raise ScanError("it sees nothing at all, and allow_empty is false")
        says = None if usable.all() else np.flatnonzero(usable if scan.angle_increment_rad > 0.0 else usable[::-1])
        field = field_of(scan, placement, says, math.inf if self._config.range_m is None else self._config.range_m)
        return View(self._points(scan, hit_m, placement), field, float(usable.mean()))

    def _points(self, scan: Scan, hit_m: Floats, placement: Placement) -> Points:
        together = -(-hit_m.size // MAX_BEAMS)
        if together == 1:
            beams = np.flatnonzero(np.isfinite(hit_m))
            return Points(self._at_m(hit_m, beams, placement), beams, hit_m.size)
        groups = np.pad(hit_m, (0, -hit_m.size % together), constant_values=np.inf).reshape(-1, together)
        nearest = groups.argmin(axis=1) + np.arange(groups.shape[0]) * together
        beams = np.flatnonzero(np.isfinite(groups.min(axis=1)))
        return Points(self._at_m(hit_m, nearest[beams], placement), beams, groups.shape[0])

    def _at_m(self, hit_m: Floats, hits: npt.NDArray[np.intp], placement: Placement) -> Floats:
        """Where these beams hit, in base_link."""
        return placement.points(hit_m[hits] * self._cos[hits], hit_m[hits] * self._sin[hits])

    def _beside_m(self, placement: Placement) -> Floats:
        """How far along each beam its first place beside the footprint is [m]; 0 for a scanner outside of it."""
        if self._box is None:
            return np.full(self._cos.size, np.inf)
        ways = placement.points(self._cos, self._sin) - (placement.x_m, placement.y_m)
        high = np.array((self._box.front_m, self._box.left_m)) - (placement.x_m, placement.y_m)
        low = np.array((-self._box.rear_m, -self._box.right_m)) - (placement.x_m, placement.y_m)
        with np.errstate(divide="ignore", invalid="ignore"):
            leaves_m = np.where(ways > 0.0, high / ways, np.where(ways < 0.0, low / ways, np.inf)).min(axis=1)
        beside_m: Floats = np.maximum(leaves_m + TOO_NEAR_M, 0.0)
        return beside_m

    def _hold_frame(self, frame: str | None) -> None:
        """Two scanners on one topic would each take away what the other one sees, and whose place is known is not."""
        self._frame = frame if self._frame is None else self._frame
        self._other_frame = frame if frame != self._frame else self._other_frame
        if self._other_frame is not None:
            raise ScanError(
                f"scans of {printable(self._frame or '')} and of {printable(self._other_frame)} come on one topic: "
                "give each scanner its own; start canbase again if the scanner was changed"
            )

    def _hold_direction(self, increment_rad: float) -> None:
        """A scanner that counts the other way round than before is mirrored, or is another one."""
        sign = math.copysign(1.0, increment_rad)
        if sign * self._sign < 0.0:
            raise ScanError("angle_increment has changed its sign; start canbase again if the scanner was changed")
        self._sign = sign

    def _aim(self, count: int, angle_min_rad: float, angle_increment_rad: float) -> None:
        geometry = (count, angle_min_rad, angle_increment_rad)
        if geometry == self._geometry:
            return
        angles_rad = angle_min_rad + angle_increment_rad * np.arange(count)
        self._cos, self._sin, self._geometry = np.cos(angles_rad), np.sin(angles_rad), geometry


def field_of(
    scan: Scan, placement: Placement, says: npt.NDArray[np.intp] | None = None, range_m: float = math.inf
) -> Field:
    """The field of view of a scan that can be used. Each beam counts for one increment. `says`: as in `Field`.
    `range_m`: what robot.yaml states as the scanner's range [m]."""
    increment_rad = abs(scan.angle_increment_rad)
    span_rad = increment_rad * (scan.count - 1)
    first_rad = scan.angle_min_rad - (span_rad if scan.angle_increment_rad < 0.0 else 0.0)
    return Field(
        placement=placement,
        first_rad=first_rad - increment_rad / 2.0,
        span_rad=span_rad + increment_rad,
        range_min_m=scan.range_min_m,
        range_max_m=min(scan.range_max_m, range_m),
        increment_rad=increment_rad,
        says=says if increment_rad > 0.0 else None,
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


def _least(distances_m: Floats) -> float:
    """The smallest, not below 0; infinity of none."""
    return max(0.0, float(distances_m.min(initial=math.inf)))
