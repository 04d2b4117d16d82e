"""One laser scan as it came, and whether it can be used (REP 117, sensor_msgs/LaserScan). Frozen ones are frozen.py."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

MAX_READINGS: Final = 100_000
"""A scan with more readings is dropped: no scanner has so many, and processing it would delay the filter."""
SLACK_RAD: Final = 0.02
"""So far angle_max may be from where the readings end, or 1.5 readings: drivers count the last one differently."""
FULL_TURN_RAD: Final = 2.0 * math.pi


class ScanError(ValueError):
    """A scan cannot be used; the text is for the operator."""


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
    angle_max_rad: float | None = None
    """None: not stated, and not compared."""
    stamp_ns: int | None = None
    """Of its header. It is compared with the one before and with nothing else. None: not stated, and not compared."""
    frame: str | None = None
    """frame_id of its header: whose it is. None: not stated, and not compared."""

    @property
    def count(self) -> int:
        """Number of readings."""
        return int(np.size(self.ranges_m))


def check(scan: Scan) -> None:
    """Raises ScanError, with the values, for a scan whose readings have no known direction or range."""
    problem = next(_problems(scan), None)
    if problem is not None:
        raise ScanError(problem)


def _problems(scan: Scan) -> Iterator[str]:
    step_rad, count = scan.angle_increment_rad, scan.count
    if count == 0:
        yield "it has no readings"
    if count > MAX_READINGS:
        yield f"it has {count} readings, at most {MAX_READINGS} are looked at"
    angles = (scan.angle_min_rad, step_rad, 0.0 if scan.angle_max_rad is None else scan.angle_max_rad)
    if not all(map(math.isfinite, angles)):
        yield f"angle_min {angles[0]}, angle_increment {step_rad} or angle_max {angles[2]} is no number"
    if not (math.isfinite(scan.range_min_m) and scan.range_max_m > scan.range_min_m >= 0.0):
        yield f"range_min {scan.range_min_m} and range_max {scan.range_max_m} are no range"
    slack_rad = max(SLACK_RAD, 1.5 * abs(step_rad))
    span_rad = step_rad * (count - 1)
    if count > 1 and step_rad == 0.0:
        yield "angle_increment is 0"
    if abs(span_rad) > FULL_TURN_RAD + slack_rad:
        yield f"{count} readings of {step_rad:.5f} rad are more than a full turn"
    if scan.angle_max_rad is not None and abs(scan.angle_max_rad - scan.angle_min_rad - span_rad) > slack_rad:
        yield (
            f"{count} readings of {step_rad:.5f} rad do not lead from angle_min {scan.angle_min_rad:.3f} to "
            f"angle_max {scan.angle_max_rad:.3f}"
        )
