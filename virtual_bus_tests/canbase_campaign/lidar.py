"""A laser scanner in the tests of the safety filter: what it reads among obstacles, and ways in which it lies.

360 readings of 1°, from 0.05 m to 10 m, with 2 mm of noise, as real scanners have it. Each fault is a plain function
from the scan that a sound scanner would send to the one that comes; also for the fault campaign.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache
from random import Random

import numpy as np

from canbase_velocity.scan import Scan
from canbase_velocity.sweep import Floats

READINGS = 360
STEP_RAD = 2.0 * math.pi / READINGS
RANGE_MIN_M, RANGE_MAX_M = 0.05, 10.0
NOISE_M = 0.002
SIZE_M = 0.03
"""Half of the width of what an obstacle shows."""

Fault = Callable[[Scan], Scan]


class Lidar:
    """A sound scanner in base_link; its first reading looks backward, the one in the middle ahead."""

    def __init__(self, seed: int = 1, noise_m: float = NOISE_M) -> None:
        self._random, self._noise_m = Random(seed), noise_m
        self._scans = 0

    def scan(self, obstacles: Floats) -> Scan:
        """What it reads among `obstacles`, places in base_link [m]."""
        ranges_m = [math.inf] * READINGS
        for x_m, y_m in np.asarray(obstacles).tolist():
            range_m, beams = _seen(x_m, y_m)
            measured_m = max(range_m + self._random.gauss(0.0, self._noise_m), RANGE_MIN_M)
            for beam in beams:
                ranges_m[beam] = min(ranges_m[beam], measured_m)
        self._scans += 1
        return self._of(np.array(ranges_m))

    def _of(self, ranges_m: Floats) -> Scan:
        return Scan(
            ranges_m,
            -math.pi,
            STEP_RAD,
            RANGE_MIN_M,
            RANGE_MAX_M,
            angle_max_rad=-math.pi + STEP_RAD * (READINGS - 1),
            stamp_ns=self._scans * 100_000_000,
        )


@lru_cache(maxsize=256)
def _seen(x_m: float, y_m: float) -> tuple[float, list[int]]:
    """How far away a place is, and which beams meet it."""
    range_m = max(math.hypot(x_m, y_m), RANGE_MIN_M)
    middle = (math.atan2(y_m, x_m) + math.pi) / STEP_RAD
    wide = max(1, math.ceil(SIZE_M / range_m / STEP_RAD))
    return range_m, [round(middle + beam) % READINGS for beam in range(-wide, wide + 1)]


def blind(reading_m: float = math.nan, share: float = 1.0, towards_rad: float = 0.0) -> Fault:
    """`share` of the readings, around `towards_rad` (0: ahead), are `reading_m`: NaN, 0, below range_min."""

    def fault(scan: Scan) -> Scan:
        ranges_m = np.array(scan.ranges_m, dtype=np.float64)
        angles_rad = scan.angle_min_rad + scan.angle_increment_rad * np.arange(ranges_m.size)
        off_rad = np.abs(np.mod(angles_rad - towards_rad + math.pi, 2.0 * math.pi) - math.pi)
        ranges_m[off_rad <= share * math.pi] = reading_m
        return dataclasses.replace(scan, ranges_m=ranges_m)

    return fault


def one_beam_left(scan: Scan) -> Scan:
    """All readings but one to the rear are NaN."""
    ranges_m = np.full(np.size(scan.ranges_m), np.nan)
    ranges_m[0] = 5.0
    return dataclasses.replace(scan, ranges_m=ranges_m)


class Frozen:
    """The first scan again and again; with `new_stamps` only its readings are old."""

    def __init__(self, *, new_stamps: bool) -> None:
        self._new_stamps = new_stamps
        self._first: Scan | None = None

    def __call__(self, scan: Scan) -> Scan:
        """The scan that comes in place of this one."""
        self._first = self._first or scan
        return dataclasses.replace(self._first, stamp_ns=scan.stamp_ns) if self._new_stamps else self._first


class FrozenPart:
    """`share` of the readings, around `towards_rad` (0: ahead), are those of the first scan; the others live."""

    def __init__(self, share: float, towards_rad: float = 0.0) -> None:
        self._share, self._towards_rad = share, towards_rad
        self._first: Scan | None = None

    def __call__(self, scan: Scan) -> Scan:
        """The scan that comes in place of this one."""
        self._first = self._first or scan
        kept = np.isnan(blind(math.nan, self._share, self._towards_rad)(scan).ranges_m)
        return dataclasses.replace(scan, ranges_m=np.where(kept, self._first.ranges_m, scan.ranges_m))


class ByTurns:
    """The first `count` scans again and again, by turns, as from a driver that hands out its old buffers."""

    def __init__(self, count: int, *, new_stamps: bool) -> None:
        self._count, self._new_stamps = count, new_stamps
        self._first: list[Scan] = []
        self._sent = 0

    def __call__(self, scan: Scan) -> Scan:
        """The scan that comes in place of this one."""
        if len(self._first) < self._count:
            self._first.append(scan)
        old = self._first[self._sent % self._count]
        self._sent += 1
        return dataclasses.replace(old, stamp_ns=scan.stamp_ns) if self._new_stamps else old


class Late:
    """What a driver hands out that takes longer and longer: `per_s` more with each second, `most_s` at the end.

    With the stamps of when it was measured; 10 scans a second.
    """

    def __init__(self, most_s: float, per_s: float = math.inf) -> None:
        self._most_s, self._per_s = most_s, per_s
        self._before: list[Scan] = []
        self._late_s = 0.0

    def __call__(self, scan: Scan) -> Scan:
        """The scan that comes in place of this one."""
        self._before.append(scan)
        self._late_s = min(self._late_s + self._per_s * 0.1, self._most_s)
        return self._before[max(0, len(self._before) - 1 - round(self._late_s * 10.0))]


def far_from(range_min_m: float, reading_m: float = -math.inf) -> Fault:
    """A scanner that measures nothing nearer than `range_min_m` reads `reading_m` there."""

    def fault(scan: Scan) -> Scan:
        ranges_m = np.array(scan.ranges_m, dtype=np.float64)
        ranges_m[ranges_m < range_min_m] = reading_m
        return dataclasses.replace(scan, ranges_m=ranges_m, range_min_m=range_min_m)

    return fault


class TwoOnOneTopic:
    """A second scanner, which sees nothing but a far wall behind it, publishes on the same topic in turn."""

    def __init__(self) -> None:
        self._other = Lidar(seed=2)
        self._sent = 0

    def __call__(self, scan: Scan) -> Scan:
        """The scan that comes in place of this one."""
        self._sent += 1
        if self._sent % 2:
            return dataclasses.replace(scan, frame="laser_front")
        there = self._other.scan(np.array([(-2.0, 0.0), (0.0, 3.0)]))
        return dataclasses.replace(there, stamp_ns=scan.stamp_ns, frame="laser_rear")
