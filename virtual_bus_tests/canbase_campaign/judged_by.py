"""What the judges allow a robot: from its limits, its body and the times that documents state. Nothing of the product.

The keys of `limits`, `timeouts`, `rates` and `base` are what a robot's owner demands of it. The tolerances of the
watchdog (the section `watchdog` of robot.yaml) are the product's own choice, and count for nothing here: a watchdog
that is set too wide is found out. canbase_config/stopping.py is worked out again, for the same reason.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Final

from canbase_config.robot import Limits, Robot
from canbase_hazards.stated_times import QUICK_STOP_S, stated_s
from canbase_sim.plant.base import PlantParameters

LOOP_SHARE: Final = 0.03
"""A velocity loop under friction and slope is so far from its setpoint at most, as a share of the fastest wheel ..."""
CREEP_MPS: Final = 0.036
"""... and so far at any speed. At 36 mm/s a base comes half the width of a finger further until the first rung acts."""
FASTER_SHARE: Final = 0.3
"""A wheel that runs away may gain so much of the fastest wheel: 1.7 times the energy of a legal motion at most ..."""
FASTER_MPS: Final = 0.05
"""... and so much more on a slow robot."""
BESIDE_SHARE: Final = 0.1
"""A wheel that does not follow is noticed when it differs by so much of the fastest wheel, and FASTER_MPS."""
STANDS_MPS: Final = 0.02
"""Noise of a speed that counts as none."""
MESSAGE_S: Final = 0.05
"""A message between two processes of a loaded computer arrives so late at most."""
CYCLES: Final = 2.0
"""An order waits for the driver's next cycle, and its end is seen in the one after."""
SETTLES: Final = 3.0
"""Time constants of a velocity loop until it follows: 95 % of a step."""
DRIVE_CYCLE_S: Final = 0.01
"""A drive takes its setpoints so often at least."""


def max_wheel_mps(robot: Robot) -> float:
    """The fastest rim within the limits: straight on, or in place [m/s]."""
    return max(robot.limits.linear_mps, robot.limits.angular_radps * robot.base.track_m / 2.0)


def tolerance_mps(robot: Robot) -> float:
    """At the rim: what is no motion, or none beside an order [m/s]."""
    return CREEP_MPS + LOOP_SHARE * max_wheel_mps(robot)


def lag_s(body: PlantParameters) -> float:
    """Until a drive's velocity loop follows: it is tuned for the empty robot, and slower with load [s]."""
    return DRIVE_CYCLE_S + SETTLES * body.payload_factor / body.bandwidth_radps


def rounded_s(straight_s: float, linear_mps: float, jerk_mps3: float) -> float:
    """Time of a change of speed that takes `straight_s` without a limit of jerk [s]: v/a + a/j, or 2·√(v/j) where the
    acceleration is never reached."""
    if linear_mps == 0.0:
        return straight_s
    steepest_s = max(straight_s, sqrt(linear_mps / jerk_mps3))
    return steepest_s + linear_mps / (steepest_s * jerk_mps3)


def jerk_adds_s(limits: Limits) -> float:
    """How much longer the limit of jerk makes a change of speed [s]."""
    straight = (limits.linear_mps / rate for rate in (limits.acceleration_mps2, limits.deceleration_mps2))
    return max(rounded_s(time_s, limits.linear_mps, limits.jerk_mps3) - time_s for time_s in straight)


def ramp_s(limits: Limits, linear_mps: float, angular_radps: float) -> float:
    """An ordinary stop of linear and angular velocity together [s]."""
    straight_s = max(
        abs(linear_mps) / limits.deceleration_mps2, abs(angular_radps) / limits.angular_deceleration_radps2
    )
    return rounded_s(straight_s, abs(linear_mps), limits.jerk_mps3)


def hard_ramp_s(limits: Limits, linear_mps: float, angular_radps: float) -> float:
    """An emergency stop [s]: `emergency_deceleration_mps2`, the turn harder by the same share, no limit of jerk."""
    harder = limits.emergency_deceleration_mps2 / limits.deceleration_mps2
    turns_s = abs(angular_radps) / (limits.angular_deceleration_radps2 * harder)
    return max(abs(linear_mps) / limits.emergency_deceleration_mps2, turns_s)


@dataclass(frozen=True, slots=True)
class Bounds:
    """How far and for how long a wheel, or the base, may be beside its orders."""

    runaway_mps: float
    """So much faster than the fastest that was ordered of it a wheel may be ..."""
    runaway_s: float
    """... and for how long, while it has power."""
    path_radps: float
    """So far beside what was ordered the base may turn ..."""
    path_s: float
    """... and for how long, while it has power."""
    stands_mps: float
    """A wheel that is faster is not at standstill, whatever is reported."""

    @classmethod
    def of(cls, robot: Robot) -> Bounds:
        """The speeds by physics; the times are those of hazards.yaml, and of the first rung after them."""
        fastest_mps = max_wheel_mps(robot)
        beside_mps = FASTER_MPS + BESIDE_SHARE * fastest_mps
        return cls(
            FASTER_MPS + FASTER_SHARE * fastest_mps,
            max(stated_s(row, robot) for row in RUNS_AWAY) + QUICK_STOP_S,
            2.0 * beside_mps / robot.base.track_m,
            stated_s("wheel_follows_in_part", robot),
            beside_mps + STANDS_MPS,
        )


RUNS_AWAY: Final = ("encoder_lost_slow_or_at_rest", "drive_ignores_setpoints")
"""Rows of hazards.yaml whose wheel is faster than ordered."""
