"""What a fit means for robot.yaml: whether it is certain enough, what changes, and in words. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from canbase_commissioning.edits import Edit, differs, rounded
from canbase_commissioning.umbmark.planar import Array, Wheels, pose
from canbase_commissioning.umbmark.squares import Closing, Course, closings
from canbase_commissioning.umbmark.wheel_fit import Fit, FitError, fit
from canbase_config.robot import Base, Robot

CERTAIN_RADIUS: Final = 0.001
CERTAIN_TRACK: Final = 0.0025
"""1 σ as a share; twice as much is what is promised: 0.2 % and 0.5 %."""
MOST_CHANGE: Final = 0.15
"""A value that is wrong by more is no matter of calibration: a diameter, a gear, another wheel."""
LEAST_RADIUS_ERROR: Final = 0.001
LEAST_TRACK_ERROR: Final = 0.002
"""For `odometry`: load, temperature and wear of tyres change more than a calibration can measure."""


def wheels_of(base: Base) -> Wheels:
    """As robot.yaml has them."""
    return Wheels(base.radius_m("left"), base.radius_m("right"), base.track_m)


def course_of(robot: Robot, side_m: float, squares: int) -> Course:
    """`squares` in each direction, with the values of robot.yaml."""
    return Course(wheels_of(robot.base), mount_of(robot), side_m, squares)


def mount_of(robot: Robot) -> Array:
    """Pose of the scanner on the base, as robot.yaml has it."""
    scan = robot.safety.scan
    return pose(scan.x_m, scan.y_m, scan.yaw_rad)


def result(robot: Robot, course: Course) -> tuple[list[str], list[Edit], str]:
    """In words, as changes of robot.yaml, and why it is refused (empty: it is not).

    Raises FitError where the stops carry no result at all.
    """
    course.enough()
    old = wheels_of(robot.base)
    found = fit(course.legs, old, mount_of(robot), robot.odometry)
    told = lines(found, old, closings(course.stops, old, found.wheels, found.mount))
    try:
        check(found, old)
    except FitError as error:
        return told, [], str(error)
    return told, geometry_edits(robot, found), ""


def check(found: Fit, old: Wheels) -> None:
    """Raises FitError for a result that is not certain enough, or that is no small correction."""
    uncertain = [
        f"{name} ±{100.0 * share:.2f} % (limit {100.0 * limit:g} %)"
        for name, share, limit in (
            ("wheel radius left", found.sigma.left_m / found.wheels.left_m, CERTAIN_RADIUS),
            ("wheel radius right", found.sigma.right_m / found.wheels.right_m, CERTAIN_RADIUS),
            ("track", found.sigma.track_m / found.wheels.track_m, CERTAIN_TRACK),
        )
        if not share <= limit
    ]
    if uncertain:
        raise FitError(f"not certain enough: {', '.join(uncertain)}. Raise --squares or --side, or drive slower")
    for name, new_m, old_m in (
        ("wheel radius on the left", found.wheels.left_m, old.left_m),
        ("wheel radius on the right", found.wheels.right_m, old.right_m),
        ("track", found.wheels.track_m, old.track_m),
    ):
        if abs(new_m / old_m - 1.0) > MOST_CHANGE:
            raise FitError(
                f"the {name} would change from {old_m:.4g} to {new_m:.4g} m, by more than {100 * MOST_CHANGE:.0f} %: "
                "run canbase setup commission first (a diameter for a radius, a gear ratio, another wheel?)"
            )


def geometry_edits(robot: Robot, found: Fit) -> list[Edit]:
    """Radius, ratio and track, and how wrong they may still be."""
    base, odometry, sigma, wheels = robot.base, robot.odometry, found.sigma, found.wheels
    radius_error = max(sigma.left_m / wheels.left_m, sigma.right_m / wheels.right_m, LEAST_RADIUS_ERROR)
    track_error = max(sigma.track_m / wheels.track_m, LEAST_TRACK_ERROR)
    values = {
        ("base", "wheel_radius_m"): (base.wheel_radius_m, wheels.radius_m),
        ("base", "wheel_ratio"): (base.wheel_ratio, wheels.ratio),
        ("base", "track_m"): (base.track_m, wheels.track_m),
        ("odometry", "radius_error"): (odometry.radius_error, float(f"{radius_error:.2g}")),
        ("odometry", "track_error"): (odometry.track_error, float(f"{track_error:.2g}")),
    }
    edits = [Edit(loc, before, rounded(after)) for loc, (before, after) in values.items()]
    return [edit for edit in edits if differs(edit)]


def lines(found: Fit, old: Wheels, closings: Sequence[Closing]) -> list[str]:
    """Old and new values with their certainty, and how the squares close."""
    new, sigma = found.wheels, found.sigma
    rows = [
        ("wheel radius left", old.left_m, new.left_m, sigma.left_m),
        ("wheel radius right", old.right_m, new.right_m, sigma.right_m),
        ("track", old.track_m, new.track_m, sigma.track_m),
    ]
    told = [
        f"{name:<19} {was:.5f} → {now:.5f} m  {100 * (now / was - 1):+.2f} %  (±{100 * error / now:.2f} %, 1 σ)"
        for name, was, now, error in rows
    ]
    x_m, y_m, yaw_rad = found.mount
    told.append(f"{'scanner on the base':<19} x {x_m:.3f} m, y {y_m:.3f} m, yaw {math.degrees(yaw_rad):.2f}°")
    told.append(
        f"{found.legs} legs used, {len(found.outliers)} left out; chi² / degree of freedom {found.chi2_share:.2f}"
    )
    for to_the_left, name in ((True, "left"), (False, "right")):
        ours = [each for each in closings if each.to_the_left is to_the_left]
        if ours:
            before, after = (_mean_m([getattr(each, when) for each in ours]) for when in ("before", "after"))
            told.append(
                f"squares to the {name}: at the end the odometry is {1000 * before:.0f} mm off, "
                f"with the new values {1000 * after:.0f} mm"
            )
    return told


def _mean_m(away: Sequence[Array]) -> float:
    """Of the mean of the ends: what is systematic (Borenstein and Feng's centre of gravity)."""
    mean = np.mean(away, axis=0)
    return float(math.hypot(mean[0], mean[1]))
