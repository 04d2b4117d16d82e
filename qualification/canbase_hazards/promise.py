"""What a row of the catalogue states for one robot: how soon the component acts, and how far the base goes then."""

from __future__ import annotations

from canbase_config.robot import Robot
from canbase_hazards.catalogue import Braking, Row
from canbase_hazards.formula import evaluate


def worst_distance_m(row: Row, robot: Robot) -> float | None:
    """From the failure at limits.linear_mps until standstill [m]; None where no formula holds."""
    if row.distance_m:
        return evaluate(row.distance_m, robot)
    limits = robot.limits
    rate = {
        Braking.RAMP: limits.deceleration_mps2,
        Braking.QUICK_STOP: limits.emergency_deceleration_mps2,
    }.get(row.braking)
    if rate is None or not row.within_s:
        return None
    speed_mps = limits.linear_mps
    return float(speed_mps * evaluate(row.within_s, robot) + speed_mps**2 / (2.0 * rate))
