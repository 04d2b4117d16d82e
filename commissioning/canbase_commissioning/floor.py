"""On the floor: wheel radius by a straight drive, track by a turn in place, both measured by a person. Slowly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from canbase_commissioning.calibration import radius, track
from canbase_commissioning.guide import Ask, CommissionError, Script, Until, number
from canbase_commissioning.powered_drives import PoweredDrives
from canbase_commissioning.wheel_direction import braking_way_m, rest

LIMIT_FACTOR = 3.0
"""A drive that takes this many times its expected time is given up."""


@dataclass(frozen=True, slots=True)
class FloorFound:
    """Radius and track [m], and what they were worked out from."""

    wheel_radius_m: float
    track_m: float
    odometry_m: float
    measured_m: float
    odometry_deg: float
    measured_deg: float


def measure_floor(rig: PoweredDrives, distance_m: float, turns: float, speed_mps: float) -> Script[FloorFound]:
    """Drives `distance_m` forward, then turns left by `turns`. Raises CommissionError, CalibrationError."""
    base = rig.robot.base
    clear = f"It will drive {distance_m:g} m forward at {speed_mps:g} m/s. Mark its position. Is the path free?"
    yield Ask("floor.straight", clear, confirms=True)
    left_m, right_m = yield from _drive(rig, speed_mps, speed_mps, lambda left, right: (left + right) / 2, distance_m)
    odometry_m = (left_m + right_m) / 2.0
    text = f"How far did it drive, in metres, to the millimetre (odometry: {odometry_m:.3f})?"
    measured_m = float((yield Ask("floor.distance_m", text, number(0.01, 100.0))))
    new_radius_m = radius(base.wheel_radius_m, odometry_m, measured_m)
    clear = f"It will turn {turns:g} times to the left on the spot. Mark its heading. Is there free space all around?"
    yield Ask("floor.turn", clear, confirms=True)
    arc_m = turns * math.pi * base.track_m
    left_m, right_m = yield from _drive(rig, -speed_mps, speed_mps, lambda left, right: (right - left) / 2, arc_m)
    odometry_rad = (right_m - left_m) / base.track_m
    told = f"{math.degrees(odometry_rad):.1f}"
    text = f"By how many degrees did it turn in all, {turns:g} turns are {360 * turns:g} (odometry: {told})?"
    measured_deg = float((yield Ask("floor.angle_deg", text, number(10.0, 36_000.0))))
    factor = new_radius_m / base.wheel_radius_m
    new_track_m = track(base.track_m, odometry_rad, math.radians(measured_deg), factor)
    return FloorFound(
        wheel_radius_m=new_radius_m,
        track_m=new_track_m,
        odometry_m=odometry_m,
        measured_m=measured_m,
        odometry_deg=math.degrees(odometry_rad),
        measured_deg=measured_deg,
    )


def _drive(
    rig: PoweredDrives, left_mps: float, right_mps: float, progress_m: Callable[[float, float], float], goal_m: float
) -> Script[tuple[float, float]]:
    """Until the progress is `goal_m`, and to a stand; the ways of both sides [m]."""
    start = _ways(rig)
    speed_mps = max(abs(left_mps), abs(right_mps))
    brakes_m = braking_way_m(rig, speed_mps)
    rig.speeds_mps = {j: left_mps if axis.drive.side == "left" else right_mps for j, axis in rig.axes.items()}

    def there(_now: float) -> bool:
        left_m, right_m = _since(rig, start)
        return progress_m(left_m, right_m) >= goal_m - brakes_m

    held = yield Until(there, LIMIT_FACTOR * goal_m / speed_mps + 5.0)
    yield from rest(rig)
    if not held:
        left_m, right_m = _since(rig, start)
        raise CommissionError(f"after a long time the wheels had rolled {left_m:.2f} m left, {right_m:.2f} m right")
    return _since(rig, start)


def _ways(rig: PoweredDrives) -> tuple[float, float]:
    """Mean way of the wheels of each side [m]."""
    sides = {"left": [0.0, 0], "right": [0.0, 0]}
    for axis in rig.axes.values():
        sides[axis.drive.side][0] += axis.travel.travel_m
        sides[axis.drive.side][1] += 1
    left, right = (total / count for total, count in sides.values())
    return left, right


def _since(rig: PoweredDrives, start: tuple[float, float]) -> tuple[float, float]:
    left_m, right_m = _ways(rig)
    return left_m - start[0], right_m - start[1]
