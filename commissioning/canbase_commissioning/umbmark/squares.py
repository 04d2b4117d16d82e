"""The squares of UMBmark, corner by corner: the next move, the legs for the fit, and how each square closes. Pure.

The scanner also keeps the base on its course. Wheels that are 3 % wrong would lead it a metre away after a few squares,
and into a wall.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from canbase_commissioning.umbmark.planar import Array, Wheels, between, compose, inverse, rolled, wrapped
from canbase_commissioning.umbmark.room_scan import RoomError
from canbase_commissioning.umbmark.scan_match import match
from canbase_commissioning.umbmark.wheel_fit import FitError, Leg, seen

CORNERS: Final = 4
PER_SQUARE: Final = 2 * CORNERS
"""Moves of one square."""
LEAST_LEGS: Final = 0.75
"""So many of the legs need a match."""


@dataclass(frozen=True, slots=True)
class Move:
    """One goal: metres forward, or radians to the left."""

    kind: Literal["drive", "turn"]
    amount: float

    def __str__(self) -> str:
        return f"drive {self.amount:.2f} m" if self.kind == "drive" else f"turn {math.degrees(self.amount):+.0f}°"


@dataclass(frozen=True, slots=True)
class Stop:
    """The base at standstill after a move: wheel angles since the stop before (n × 2), and what the scanner sees."""

    angles_rad: Array
    points: Array


@dataclass(frozen=True, slots=True)
class Closing:
    """Where a square ends, as the room shows it, from where the odometry has it: with the old and the new values."""

    to_the_left: bool
    before: Array
    after: Array


class Course:
    """Squares to the left and to the right in turn, from the first stop on. `take` each stop; it has the next move."""

    def __init__(self, wheels: Wheels, mount: Array, side_m: float, squares: int) -> None:
        """`wheels` and `mount` (pose of the scanner on the base): of robot.yaml; `squares`: in each direction."""
        self._wheels, self._mount, self._side_m = wheels, mount, side_m
        self.moves = 2 * squares * PER_SQUARE
        self.at = np.zeros(3)
        """Pose of the base, as seen from the first stop."""
        self.stops: list[Stop] = []
        self.legs: list[Leg] = []
        self.problems: list[str] = []
        """Why a leg has no match."""

    def take(self, stop: Stop) -> Move | None:
        """The next move; None: all squares are driven."""
        if self.stops:
            self.at = compose(self.at, self._moved(self.stops[-1], stop))
        self.stops.append(stop)
        done = len(self.stops) - 1
        return self._next(done) if done < self.moves else None

    def enough(self) -> None:
        """Raises FitError where too many legs have no match."""
        count = len(self.legs) + len(self.problems)
        if len(self.legs) < LEAST_LEGS * count:
            raise FitError(f"{len(self.problems)} of {count} legs have no match; the first: {self.problems[0]}")

    def _moved(self, before: Stop, stop: Stop) -> Array:
        """Motion of the base, by the room, or by its wheels where the scans do not match."""
        base = rolled(stop.angles_rad, self._wheels)
        try:
            found = match(before.points, stop.points, seen(base, self._mount))
        except RoomError as error:
            self.problems.append(str(error))
            return base
        self.legs.append(Leg(stop.angles_rad, found.pose, found.covariance))
        return compose(compose(self._mount, found.pose), inverse(self._mount))

    def _next(self, done: int) -> Move:
        square, step = divmod(done, PER_SQUARE)
        side = 1.0 if square % 2 == 0 else -1.0
        corners = self._side_m * np.array([[1.0, 0.0], [1.0, side], [0.0, side], [0.0, 0.0]])
        if step == PER_SQUARE - 1:
            return Move("turn", wrapped(-self.at[2]))
        away = corners[(step + 1) // 2] - self.at[:2]
        if step % 2 == 0:
            return Move("drive", math.hypot(*away))
        return Move("turn", wrapped(math.atan2(away[1], away[0]) - self.at[2]))


def closings(stops: Sequence[Stop], old: Wheels, new: Wheels, mount: Array) -> list[Closing]:
    """Of each square whose first and last scan match. `mount`: pose of the scanner on the base."""
    found = []
    for first in range(0, len(stops) - PER_SQUARE, PER_SQUARE):
        square = stops[first + 1 : first + 1 + PER_SQUARE]
        ends = [_end(square, wheels) for wheels in (old, new)]
        try:
            scanner = match(stops[first].points, square[-1].points, seen(ends[1], mount)).pose
        except RoomError:
            continue
        base = compose(compose(mount, scanner), inverse(mount))
        found.append(Closing((first // PER_SQUARE) % 2 == 0, *(_away(base, end) for end in ends)))
    return found


def _end(square: Sequence[Stop], wheels: Wheels) -> Array:
    end = np.zeros(3)
    for stop in square:
        end = compose(end, rolled(stop.angles_rad, wheels))
    return end


def _away(true: Array, believed: Array) -> Array:
    """x and y in the frame of the start, and yaw."""
    return np.array([*(true[:2] - believed[:2]), between(believed, true)[2]])
