"""How exactly `canbase setup calibrate` finds wheel radii and track: simulated bases in a furnished room, in no time.

    PYTHONPATH=virtual_bus_tests python benchmarks/calibration.py --bases 200 --write docs

Each base has a radius on each side and a track within ±3 % of robot.yaml, wheels that slip at random, and a scanner
within 2 cm and 1° of where robot.yaml has it. It drives the course by its wrong odometry.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from canbase_commissioning.edits import with_edits
from canbase_commissioning.umbmark.planar import Array, Wheels, pose
from canbase_commissioning.umbmark.squares import closings
from canbase_commissioning.umbmark.verdict import course_of, result, wheels_of
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from figures import quantile, replace_section
from support.room import BEAMS, NOISE_M, SimulatedBase, Truth, drawn_truth, drive_course, open_squares

SIDE_M, SQUARES = 1.5, 4
START = pose(0.0, 0.0, 0.3)
MOUNT = pose(0.15, 0.0, 0.0)
HEADING = "### How exact it is"
PICTURE = "calibration.png"
LIMITS = {"wheel radius": 0.2, "track": 0.5}
"""Promised [%]."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One base: errors of the result [%] and ends of its squares [m]."""

    errors: dict[str, float]
    refused: str
    before_m: tuple[float, ...]
    after_m: tuple[float, ...]
    truth: Wheels
    found: Wheels


def robot_with_scanner() -> Robot:
    """The bench sample with a scanner."""
    robot = load_robot(sample("bench")).robot
    scan = robot.safety.scan.model_copy(update={"x_m": float(MOUNT[0])})
    return robot.model_copy(update={"safety": robot.safety.model_copy(update={"scan": scan})})


def measure(robot: Robot, seed: int, view_rad: float = math.tau) -> Measured:
    """One simulated base, calibrated."""
    rng, believed = np.random.default_rng(seed), wheels_of(robot.base)
    base = SimulatedBase(drawn_truth(believed, MOUNT, rng), believed, rng, START)
    course = course_of(robot, SIDE_M, SQUARES)
    drive_course(base, course, view_rad=view_rad)
    _, edits, refused = result(robot, course)
    found, true = wheels_of(with_edits(robot, edits).base), base.truth.wheels
    ends = closings(course.stops, believed, found, base.truth.mount)
    return Measured(
        {
            "wheel radius left": 100.0 * (found.left_m / true.left_m - 1.0),
            "wheel radius right": 100.0 * (found.right_m / true.right_m - 1.0),
            "track": 100.0 * (found.track_m / true.track_m - 1.0),
        },
        refused,
        tuple(math.hypot(*end.before[:2]) for end in ends),
        tuple(math.hypot(*end.after[:2]) for end in ends),
        true,
        found,
    )


def table(measured: Sequence[Measured]) -> str:
    """As Markdown."""
    lines = ["| error [%] | p50 | p95 | p99 | max | promised |", "|---|---|---|---|---|---|"]
    for name in measured[0].errors:
        errors = [abs(one.errors[name]) for one in measured]
        cells = " | ".join(f"{quantile(errors, share):.3f}" for share in (0.5, 0.95, 0.99, 1.0))
        lines.append(f"| {name} | {cells} | {_limit(name)} |")
    lines += ["", "| end of a square, off by [mm] | p50 | p95 | max |", "|---|---|---|---|"]
    for when in ("before", "after"):
        ends_m = [end_m for one in measured for end_m in getattr(one, f"{when}_m")]
        cells = " | ".join(f"{1000.0 * quantile(ends_m, share):.0f}" for share in (0.5, 0.95, 1.0))
        lines.append(f"| {when} | {cells} |")
    return "\n".join(lines)


def section(measured: Sequence[Measured]) -> str:
    """The section of docs/odometry.md."""
    refused = sum(bool(one.refused) for one in measured)
    accepted = [one for one in measured if not one.refused]
    return f"""{HEADING}

{len(measured)} simulated bases, each with a radius on each side and a track within ±3 % of robot.yaml, slip of 3 mm
after 1 m on each side (1 σ), and a scanner with {BEAMS} beams and {1000 * NOISE_M:.0f} mm of noise (1 σ), within 2 cm
and 1° of its place in robot.yaml.
Each base drives {SQUARES} squares of {SIDE_M} m in each direction. {refused} of the results were refused.

{table(accepted)}

![Squares with the old and the new values, and the errors of all bases](pictures/{PICTURE})

`PYTHONPATH=virtual_bus_tests python benchmarks/calibration.py --bases {len(measured)} --write docs` writes this
section.
"""


def path(robot: Robot, believed: Wheels, true: Wheels, to_the_left: bool) -> Array:
    """Where a base really goes that drives a square by these values, without slip: n × 2 [m]."""
    base = SimulatedBase(Truth(true, MOUNT, slip_m=0.0), believed, np.random.default_rng(0), pose(0.0, 0.0, 0.0))
    points = [base.at[:2]]
    for move in open_squares(SIDE_M, 1)[0 if to_the_left else 8 :][:8]:
        base.go(move)
        points.append(base.at[:2])
    return np.array(points)


def draw(robot: Robot, measured: Sequence[Measured], file: Path) -> None:
    """Squares of the base with the median end, before and after, and the distribution of all errors."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    one = sorted(measured, key=lambda each: max(each.before_m))[len(measured) // 2]
    figure, (before, after, errors) = plt.subplots(1, 3, figsize=(11.0, 3.6), layout="constrained")
    for axes, believed, title in (
        (before, wheels_of(robot.base), "Before"),
        (after, one.found, "After canbase setup calibrate"),
    ):
        _squares(axes, robot, believed, one.truth, title)
    for name in one.errors:
        errors.hist([each.errors[name] for each in measured], bins=25, histtype="step", label=name)
    errors.set(title=f"Errors of {len(measured)} bases", xlabel="error [%]", ylabel="bases")
    errors.legend(fontsize=7)
    figure.savefig(file, dpi=110)


def _squares(axes: Any, robot: Robot, believed: Wheels, true: Wheels, title: str) -> None:
    for to_the_left, name in ((True, "to the left"), (False, "to the right")):
        points = path(robot, believed, true, to_the_left)
        axes.plot(points[:, 0], points[:, 1], marker=".", label=name)
        axes.plot(*points[-1], marker="x", markersize=9, color="black")
    axes.plot(0.0, 0.0, marker="o", color="black", markersize=5)
    axes.set(title=f"{title}: start ●, end ×", xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.legend(fontsize=7)


def main() -> int:
    """Exit code 0; 1 where a result that was not refused is farther off than promised."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bases", type=int, default=50)
    parser.add_argument(
        "--write", type=Path, metavar="FOLDER", help="replace the section and the picture in this folder"
    )
    arguments = parser.parse_args()
    robot = robot_with_scanner()
    measured = [measure(robot, seed) for seed in range(arguments.bases)]
    text = section(measured)
    print(text)
    if arguments.write:
        replace_section(arguments.write / "odometry.md", text)
        draw(robot, measured, arguments.write / "pictures" / PICTURE)
    far = [one for one in measured if not one.refused and not _kept(one)]
    print(f"{len(far)} of {len(measured)} farther off than promised")
    return 1 if far else 0


def _kept(one: Measured) -> bool:
    return all(abs(error) <= _limit(name) for name, error in one.errors.items())


def _limit(name: str) -> float:
    return LIMITS["track" if name == "track" else "wheel radius"]


if __name__ == "__main__":
    raise SystemExit(main())
