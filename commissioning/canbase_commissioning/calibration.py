"""What measurements mean for robot.yaml: direction, gear, counts, unit, radius and track. Calculations alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, get_args

from canbase_config.drive import Drive
from canbase_config.profile import VelocityUnit
from canbase_config.units import motor_rev_per_s

AGREES: Final = 0.03
"""Two ways of measuring agree within this share: a mark on a tyre and a tape are no better."""
PLAUSIBLE: Final = (0.5, 2.0)
"""A radius or track that is off by more was measured wrong, or typed wrong."""
BOTH_EDGES: Final = (0.25, 4.0)
"""Lines of an encoder taken for its increments, or the other way round."""


class CalibrationError(ValueError):
    """The measurements contradict each other. The text names the likely reason."""


@dataclass(frozen=True, slots=True)
class Turned:
    """Revolutions of one wheel: by the encoder (6064h), by the velocity (606Ch), and as the person saw them."""

    by_position: float
    by_velocity: float
    seen: float


@dataclass(frozen=True, slots=True)
class Scale:
    """The scale of one drive as it should be in robot.yaml. None: the profile's unit is right, or left alone."""

    gear_ratio: float
    counts_per_motor_rev: int
    velocity_unit: VelocityUnit | None
    why: str
    """In words; empty: all was right."""


def agree(a: float, b: float) -> bool:
    """Whether two measurements are the same within AGREES."""
    return abs(a - b) <= AGREES * max(abs(a), abs(b))


def scale(drive: Drive, turned: Turned) -> Scale:
    """The one key of robot.yaml that explains the three counts. Raises CalibrationError when no single one does."""
    pos, vel, seen = abs(turned.by_position), abs(turned.by_velocity), abs(turned.seen)
    if min(pos, vel, seen) <= 0.0:
        raise CalibrationError(f"{drive.joint}: a count is zero (encoder {pos:.2f}, 606Ch {vel:.2f}, seen {seen:g})")
    if agree(pos, seen) and agree(vel, seen):
        return Scale(drive.gear_ratio, drive.counts_per_motor_rev, drive.velocity_unit, "")
    if agree(pos, vel):
        return _by_gear(drive, pos / seen)
    if agree(vel, seen):
        counts = round(drive.counts_per_motor_rev * pos / seen)
        why = f"counts_per_motor_rev: the encoder counted {pos:.2f} revolutions, the wheel made {seen:g}"
        return Scale(drive.gear_ratio, counts, drive.velocity_unit, why)
    if agree(pos, seen):
        return _by_unit(drive, seen / vel)
    raise CalibrationError(
        f"{drive.joint}: the wheel made {seen:g} revolutions, its encoder counted {pos:.2f}, 606Ch gives {vel:.2f}: "
        "more than one of gear_ratio, counts_per_motor_rev and velocity_unit is wrong; take them from the data sheets"
    )


def _by_gear(drive: Drive, factor: float) -> Scale:
    """Position and velocity agree: the gear is wrong, or, where the unit counts increments, these taken fourfold."""
    why = f"the wheel turned {1.0 / factor:.3g} times as far as robot.yaml says"
    if "counts" in drive.actual_unit and any(agree(factor, edge) for edge in BOTH_EDGES):
        counts = round(drive.counts_per_motor_rev * factor)
        return Scale(drive.gear_ratio, counts, drive.velocity_unit, f"counts_per_motor_rev: {why}")
    return Scale(drive.gear_ratio * factor, drive.counts_per_motor_rev, drive.velocity_unit, f"gear_ratio: {why}")


def _by_unit(drive: Drive, factor: float) -> Scale:
    counts = drive.counts_per_motor_rev
    wanted = motor_rev_per_s(drive.actual_unit, counts) * factor
    units: tuple[VelocityUnit, ...] = get_args(VelocityUnit)
    found = next((unit for unit in units if agree(motor_rev_per_s(unit, counts), wanted)), None)
    if found is None:
        raise CalibrationError(
            f"{drive.joint}: one bit of 606Ch is {factor:.3g} times {drive.actual_unit}, a unit that canbase does "
            "not know: set the unit of velocities in the drive itself (60A9h, or the manufacturer's tool)"
        )
    why = f"velocity_unit: 606Ch gives {1.0 / factor:.3g} times the revolutions"
    return Scale(drive.gear_ratio, counts, found, why)


def radius(before_m: float, odometry_m: float, measured_m: float) -> float:
    """Wheel radius [m] from a straight drive. Raises CalibrationError for a result that cannot be."""
    return _plausible("wheel_radius_m", before_m, before_m * measured_m / odometry_m)


def track(before_m: float, odometry_rad: float, measured_rad: float, radius_factor: float) -> float:
    """Track [m] from a turn in place; `radius_factor`: new radius / old radius. Raises CalibrationError."""
    return _plausible("track_m", before_m, before_m * odometry_rad / measured_rad * radius_factor)


def _plausible(key: str, before: float, after: float) -> float:
    low, high = PLAUSIBLE
    if not math.isfinite(after) or not low <= after / before <= high:
        raise CalibrationError(f"{key} would change from {before:g} to {after:g}: measure again, or edit robot.yaml")
    return after


def stop_time_s(way_m: float, speed_mps: float, deceleration_mps2: float) -> float:
    """When a wheel stood that rolled `way_m` further: at `speed_mps` first, then down a ramp [s].

    way = v t + v²/2a, and it stands v/a after t.
    """
    return way_m / speed_mps + speed_mps / (2.0 * deceleration_mps2)
