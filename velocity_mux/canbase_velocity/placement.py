"""Where a scanner is mounted: from robot.yaml, or from the static transforms of tf. Projects its plane to the floor."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from canbase_config.safety import Scan as ScanConfig
from canbase_runtime.foreign_text import printable
from canbase_velocity.sweep import Floats

MAX_TILT_RAD = math.radians(10.0)
"""A scanner that is tilted more measures the floor or passes over obstacles; it is not used."""
LONGEST_CHAIN = 32
MOVED = 1e-3
"""A scanner whose place, or the end of an axis of one metre, changes by more has moved [m]."""


class PlacementError(ValueError):
    """A scanner cannot be placed; the text is for the operator."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The scanner in base_link: its origin [m], and where its x and y axes point on the floor."""

    x_m: float
    y_m: float
    x_axis: tuple[float, float]
    y_axis: tuple[float, float]

    @staticmethod
    def of(scanner: ScanConfig) -> Placement:
        """The pose in robot.yaml."""
        cos, sin = math.cos(scanner.yaw_rad), math.sin(scanner.yaw_rad)
        up = -1.0 if scanner.upside_down else 1.0
        return Placement(scanner.x_m, scanner.y_m, (cos, sin), (-up * sin, up * cos))

    def points(self, x_m: Floats, y_m: Floats) -> Floats:
        """Places in the scanner's frame as places in base_link, one row each [m]."""
        return np.column_stack((
            self.x_m + x_m * self.x_axis[0] + y_m * self.y_axis[0],
            self.y_m + x_m * self.x_axis[1] + y_m * self.y_axis[1],
        ))  # fmt: skip

    def seen_from(self, points: Floats) -> tuple[Floats, Floats]:
        """Range [m] and angle [rad] at which the scanner sees places in base_link."""
        x_m, y_m = points[:, 0] - self.x_m, points[:, 1] - self.y_m
        along_m = x_m * self.x_axis[0] + y_m * self.x_axis[1]
        aside_m = x_m * self.y_axis[0] + y_m * self.y_axis[1]
        return np.hypot(along_m, aside_m), np.arctan2(aside_m, along_m)


class HeldPlacement:
    """The first place of a scanner in tf_static: it does not move on its base; another place is an error."""

    def __init__(self) -> None:
        self._first: Placement | None = None
        self._moved = False

    def hold(self, frame: str, placement: Placement) -> Placement:
        """The placement. Raises PlacementError from the first other one on, until the next start."""
        self._first = self._first or placement
        self._moved = self._moved or _apart(self._first, placement) > MOVED
        if self._moved:
            raise PlacementError(
                f"tf_static has moved {printable(frame)}: two nodes publish it, or the scanner was changed; "
                "start canbase again when one place is left"
            )
        return placement


def _apart(one: Placement, other: Placement) -> float:
    def numbers(placement: Placement) -> tuple[float, ...]:
        return placement.x_m, placement.y_m, *placement.x_axis, *placement.y_axis

    return max(abs(a - b) for a, b in zip(numbers(one), numbers(other), strict=True))


@dataclass(frozen=True, slots=True)
class Transform:
    """A frame in its parent frame: translation [m] and the quaternion of its rotation."""

    parent: str
    x_m: float
    y_m: float
    z_m: float
    qx: float
    qy: float
    qz: float
    qw: float

    def matrix(self) -> npt.NDArray[np.float64]:
        """4 × 4, from this frame to its parent. Raises PlacementError for numbers that are no transform."""
        numbers = (self.x_m, self.y_m, self.z_m, self.qx, self.qy, self.qz, self.qw)
        norm = math.hypot(self.qx, self.qy, self.qz, self.qw)
        if not all(map(math.isfinite, numbers)) or norm < 0.5:
            raise PlacementError(f"tf_static has a transform below {printable(self.parent)} that is none: {numbers}")
        x, y, z, w = self.qx / norm, self.qy / norm, self.qz / norm, self.qw / norm
        return np.array((
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), self.x_m),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), self.y_m),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), self.z_m),
            (0.0, 0.0, 0.0, 1.0),
        ))  # fmt: skip


def placed_by_tf(frame: str, base_frame: str, transforms: Mapping[str, Transform]) -> Placement:
    """The place of `frame` in `base_frame` by static transforms, given by child frame.

    Raises PlacementError, with what is missing, for an unknown frame or a scanner that is tilted.
    """
    whole, at = np.eye(4), frame
    for _ in range(LONGEST_CHAIN):
        if at == base_frame:
            return _on_the_floor(frame, whole)
        if at not in transforms:
            raise PlacementError(
                f"tf_static does not say where {printable(at) or 'the empty frame'} is in {base_frame}"
            )
        whole, at = transforms[at].matrix() @ whole, transforms[at].parent
    raise PlacementError(f"tf_static goes round in circles between {printable(frame)} and {base_frame}")


def _on_the_floor(frame: str, matrix: npt.NDArray[np.float64]) -> Placement:
    if abs(matrix[2, 2]) < math.cos(MAX_TILT_RAD):
        tilt_deg = math.degrees(math.acos(min(1.0, abs(matrix[2, 2]))))
        raise PlacementError(f"{printable(frame)} is tilted by {tilt_deg:.0f}°; the scanner has to be level")
    x_axis, y_axis = (float(matrix[0, 0]), float(matrix[1, 0])), (float(matrix[0, 1]), float(matrix[1, 1]))
    return Placement(float(matrix[0, 3]), float(matrix[1, 3]), x_axis, y_axis)
