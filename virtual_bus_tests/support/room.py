"""A furnished room, a scanner in it, and a base whose wheels are not as robot.yaml says: squares of simulated bases."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from canbase_commissioning.umbmark.planar import Array, Wheels, compose, pose
from canbase_commissioning.umbmark.room_scan import Beams, room_points
from canbase_commissioning.umbmark.squares import Course, Move, Stop

NOISE_M = 0.01
"""Of one reading (1 σ): what scanners for mobile robots state."""
BEAMS = 360
SAMPLES_PER_M = 80


def box(x_m: float, y_m: float, width_m: float, depth_m: float, turned_rad: float = 0.0) -> list[Array]:
    """Four walls, each 2 × 2, around a corner of the box."""
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    corners = np.array([[0, 0], [width_m, 0], [width_m, depth_m], [0, depth_m]]) @ np.array([[cos, sin], [-sin, cos]])
    corners = corners + np.array([x_m, y_m])
    return [np.array([corners[k], corners[(k + 1) % 4]]) for k in range(4)]


FURNISHED = np.array(
    [
        *box(-2.6, -2.9, 6.2, 5.8, 0.1),
        *box(2.4, 1.6, 0.8, 0.5, 0.2),
        *box(-2.0, -2.2, 0.5, 1.1),
        *box(-2.2, 1.9, 1.2, 0.4),
    ]
)
"""6 m × 6 m with three pieces of furniture: walls × 2 × 2 [m]."""
CORRIDOR = np.array([[[-50.0, -2.5], [50.0, -2.5]], [[-50.0, 2.5], [50.0, 2.5]]])


def ranges_m(walls: Array, at: Array, angles_rad: Array) -> Array:
    """To the nearest wall in each direction; infinity where there is none."""
    ways = np.stack([np.cos(angles_rad + at[2]), np.sin(angles_rad + at[2])], axis=1)
    begin, along = walls[:, 0] - at[:2], walls[:, 1] - walls[:, 0]
    across = ways[:, None, 0] * along[None, :, 1] - ways[:, None, 1] * along[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (begin[:, 0] * along[:, 1] - begin[:, 1] * along[:, 0]) / across
        share = (begin[:, 0] * ways[:, None, 1] - begin[:, 1] * ways[:, None, 0]) / across
    range_m[~((range_m > 0.0) & (share >= 0.0) & (share <= 1.0))] = np.inf
    nearest: Array = range_m.min(axis=1)
    return nearest


def scans(
    walls: Array,
    at: Array,
    rng: np.random.Generator,
    count: int = 10,
    noise_m: float = NOISE_M,
    view_rad: float = math.tau,
) -> list[Beams]:
    """Of a scanner at this pose; `view_rad`: its field of view, straight ahead in the middle."""
    step_rad = math.tau / BEAMS
    beams = round(view_rad / step_rad)
    first_rad = -step_rad * (beams - 1) / 2.0
    angles_rad: Array = np.linspace(first_rad, -first_rad, beams)
    true_m = ranges_m(walls, at, angles_rad)
    noisy = true_m + noise_m * rng.standard_normal((count, beams))
    return [Beams(list(each), first_rad, step_rad, 0.05, 12.0) for each in noisy]


@dataclass(frozen=True, slots=True)
class Truth:
    """A base as it really is."""

    wheels: Wheels
    mount: Array
    """Pose of the scanner on the base."""
    slip_m: float = 0.003
    """Random, of the travel of one side after 1 m (1 σ) [m/√m]."""


@dataclass(slots=True)
class SimulatedBase:
    """Drives what its odometry takes for a square. `at`: its true pose; `been`: after each move."""

    truth: Truth
    believed: Wheels
    rng: np.random.Generator
    at: Array
    been: list[Array] = field(default_factory=list)

    def scanner(self) -> Array:
        """Its true pose in the room."""
        return compose(self.at, self.truth.mount)

    def go(self, move: Move) -> Array:
        """Angles of the wheels, sample by sample [rad]."""
        angles = self._drive(move.amount, 0.0) if move.kind == "drive" else self._drive(0.0, move.amount)
        self.been.append(self.at)
        return angles

    def _drive(self, distance_m: float, turn_rad: float) -> Array:
        half_m = turn_rad * self.believed.track_m / 2.0
        samples = max(2, round(SAMPLES_PER_M * max(abs(distance_m), abs(half_m))))
        ends = np.array([(distance_m - half_m) / self.believed.left_m, (distance_m + half_m) / self.believed.right_m])
        angles: Array = np.linspace(0.0, 1.0, samples + 1)[:, None] * ends[None, :]
        self._move(np.diff(angles, axis=0))
        return angles

    def _move(self, steps_rad: Array) -> None:
        wheels = self.truth.wheels
        for left_rad, right_rad in steps_rad:
            left_m, right_m = (self._slipped(left_rad * wheels.left_m), self._slipped(right_rad * wheels.right_m))
            distance_m, turn_rad = (left_m + right_m) / 2.0, (right_m - left_m) / wheels.track_m
            self.at = compose(self.at, pose(0.0, 0.0, turn_rad / 2.0))
            self.at = compose(self.at, pose(distance_m, 0.0, turn_rad / 2.0))

    def _slipped(self, rolled_m: float) -> float:
        return rolled_m + self.truth.slip_m * math.sqrt(abs(rolled_m)) * float(self.rng.standard_normal())


def drawn_truth(believed: Wheels, mount: Array, rng: np.random.Generator, share: float = 0.03) -> Truth:
    """Radius of each side and track within ± `share` of what robot.yaml has; the scanner within 2 cm and 1°."""
    left, right, track = 1.0 + share * rng.uniform(-1.0, 1.0, 3)
    wheels = Wheels(believed.left_m * left, believed.right_m * right, believed.track_m * track)
    return Truth(wheels, mount + np.array([0.02, 0.02, math.radians(1.0)]) * rng.uniform(-1.0, 1.0, 3))


def open_squares(side_m: float, squares: int) -> list[Move]:
    """Without a scanner that keeps the base on its course: in each direction as many, in turn."""
    found = []
    for number in range(2 * squares):
        turn_rad = math.pi / 2.0 if number % 2 == 0 else -math.pi / 2.0
        found += [Move("drive", side_m), Move("turn", turn_rad)] * 4
    return found


def drive_course(base: SimulatedBase, course: Course, walls: Array = FURNISHED, view_rad: float = math.tau) -> None:
    """All stops, as the wheels and a scanner report them."""

    def stop(angles: Array) -> Stop:
        return Stop(angles, room_points(scans(walls, base.scanner(), base.rng, view_rad=view_rad)))

    move = course.take(stop(np.zeros((1, 2))))
    while move is not None:
        move = course.take(stop(base.go(move)))
