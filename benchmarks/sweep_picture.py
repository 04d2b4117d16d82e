"""Draws docs/safety_filter.png: the area that the footprint sweeps for four commands, and the limiting obstacle.

    python benchmarks/sweep_picture.py docs/safety_filter.png

Uses the filter's own geometry and judgement with the sample robot of the bench; needs matplotlib.
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from canbase_config.load import load_robot, sample
from canbase_velocity.motion import Pose
from canbase_velocity.obstacle import Geometry, Sight, judge
from canbase_velocity.ramp import AT_REST
from canbase_velocity.sweep import fastest_mps
from canbase_velocity.twist import Twist

COMMANDS = {
    "straight": Twist(0.6, 0.0),
    "arc": Twist(0.6, 0.8),
    "arc, backward": Twist(-0.5, 0.7),
    "turn in place": Twist(0.0, 1.5),
}
OBSTACLES_M = np.array([(0.6, 0.1), (0.62, 0.58), (-0.75, 0.32), (0.05, 0.39), (0.2, -0.33), (0.2, -0.36)])
LOOK_S = 1.2
STEPS = 25


def draw(axes: mpl.axes.Axes, name: str, twist: Twist, geometry: Geometry) -> None:
    """One command: the footprint now, along its arc, and the share of the speed that is left."""
    corners = geometry.box.edge(1)
    for step in range(STEPS + 1):
        pose = Pose().moved(twist, LOOK_S * step / STEPS)
        outline = Pose().from_here(corners, pose)
        axes.fill(*outline.T, facecolor="tab:blue", alpha=0.05)
    axes.fill(*corners.T, facecolor="none", edgecolor="black", linewidth=1.5)
    judgement = judge(twist, AT_REST, Sight(OBSTACLES_M), geometry)
    each = [judge(twist, AT_REST, Sight(point[np.newaxis, :]), geometry).share for point in OBSTACLES_M]
    colours = ["tab:red" if share == judgement.share < 1.0 else "tab:gray" for share in each]
    axes.scatter(*OBSTACLES_M.T, c=colours, s=30, zorder=3)
    speed_mps = fastest_mps(geometry.box, twist)
    axes.set_title(f"{name}: {100.0 * judgement.share:.0f} % of {speed_mps:.2f} m/s (fastest corner)", fontsize=10)
    axes.set_aspect("equal")
    axes.set(xlim=(-1.1, 1.3), ylim=(-0.9, 1.1))


def main(path: str) -> None:
    """Draw to `path`."""
    robot = load_robot(sample("bench")).robot
    geometry = Geometry.of(robot.limits, robot.safety, robot.rates.command_hz)
    figure, grid = plt.subplots(2, 2, figsize=(9, 8))
    for axes, (name, twist) in zip(grid.flat, COMMANDS.items(), strict=True):
        draw(axes, name, twist, geometry)
    figure.legend(handles=_legend(), loc="upper center", ncols=2, fontsize=9)
    figure.supxlabel("x in base_link [m], forward to the right")
    figure.supylabel("y in base_link [m]")
    figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.92), h_pad=2.0)
    figure.savefig(path, dpi=90)


def _legend() -> list[Line2D | Patch]:
    def dot(colour: str, label: str) -> Line2D:
        return Line2D([], [], marker="o", linestyle="", color=colour, label=label)

    return [
        Patch(facecolor="none", edgecolor="black", linewidth=1.5, label="footprint with padding, now"),
        Patch(facecolor="tab:blue", alpha=0.3, label=f"area swept in the next {LOOK_S} s"),
        dot("tab:red", "obstacle that limits the speed (title: allowed share of the commanded speed)"),
        dot("tab:gray", "other obstacle"),
    ]


if __name__ == "__main__":
    main(sys.argv[1])
