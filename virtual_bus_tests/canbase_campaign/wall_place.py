"""Where a wall may appear so that the base must not touch it: as near as one fault leaves room to stop."""

from __future__ import annotations

from typing import Final

from canbase_campaign.envelope import react_s
from canbase_config.robot import Robot
from canbase_hazards.stated_times import stated_s

SPEEDING_UP_MPS: Final = 0.2
"""By so much the base may become faster until the wall is noticed."""


def far_enough_m(robot: Robot, linear_mps: float, scan_s: float, *, lies: bool) -> float:
    """From the footprint to the wall, for a base that is so fast [m].

    `scan_s`: from one scan to the next. `lies`: the scanner shows an old world, which is noticed later. The base slows
    down as gently as its distances of robot.yaml let it, and keeps the distance at which it has to stand.
    """
    limits, safety = robot.limits, robot.safety
    gentlest = limits.linear_mps**2 / (2.0 * (safety.slow_distance_m - safety.stop_distance_m))
    braking_m = linear_mps**2 / (2.0 * min(gentlest, limits.deceleration_mps2))
    sees_s = react_s(robot, layers=1) + safety.scan.timeout_s + scan_s
    if lies:
        sees_s = max(sees_s, react_s(robot, layers=1) + stated_s("scanner_frozen", robot))
    noticing_m = (abs(linear_mps) + SPEEDING_UP_MPS) * sees_s
    return safety.padding_m + safety.stop_distance_m + braking_m + noticing_m
