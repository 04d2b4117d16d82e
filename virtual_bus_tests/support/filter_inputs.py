"""Inputs and settings of the safety filter for its tests: all is well, but for what a test changes."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from canbase_config.robot import Limits
from canbase_config.safety import Ceiling, Estop, Footprint, LimitZone, Safety
from canbase_config.safety import Scan as ScanConfig
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import NOWHERE, Points
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.obstacle import Geometry, Sight
from canbase_velocity.ramp import AT_REST, Moving
from canbase_velocity.safety_filter import FilterConfig, Inputs, ScanState
from canbase_velocity.sweep import Box
from canbase_velocity.twist import ZERO, Twist

INF, NAN = math.inf, math.nan
STANDSTILL_MPS = 0.005
LIMITS = Limits(
    linear_mps=1.0,
    angular_radps=2.0,
    acceleration_mps2=1.0,
    deceleration_mps2=2.0,
    emergency_deceleration_mps2=4.0,
    angular_acceleration_radps2=4.0,
    angular_deceleration_radps2=4.0,
).model_copy(update={"jerk_mps3": 1e9})
"""Ramps without a jerk limit, to be counted by hand: it is over within nanoseconds."""
HOLD_S = 0.02
BOX = Box(front_m=0.4, rear_m=0.4, left_m=0.3, right_m=0.3)


def config(*, scan: bool = True, estop: bool = True, latched: bool = False, **safety: Any) -> FilterConfig:
    """Stop distance 0.1 m, slow-down distance 0.6 m: from 1 m/s a ramp of 1 m/s² fits between them. Circle 0.5 m."""
    made = Safety(
        footprint=Footprint(front_m=0.4, rear_m=0.4, left_m=0.3, right_m=0.3),
        padding_m=0.0,
        scan=ScanConfig(required=scan, timeout_s=0.3),
        estop=Estop(required=estop, timeout_s=0.5, latched=latched),
        command_timeout_s=0.2,
        stop_distance_m=0.1,
        slow_distance_m=0.6,
        **safety,
    )
    return FilterConfig(LIMITS, made, STANDSTILL_MPS, Geometry.of(LIMITS, made, 1.0 / HOLD_S))


def scanned(age_s: float, *, required: bool = True, problem: str = "") -> tuple[ScanState, ...]:
    return (
        ScanState("scan", required, 0.3, age_s, problem, StopCause.SCAN_UNPLACED if problem else StopCause.SCAN_STALE),
    )


def places(*at_m: tuple[float, float]) -> Sight:
    return Sight(np.array(at_m).reshape(-1, 2))


def free(ahead_m: float = INF, behind_m: float = INF) -> Sight:
    """A thing in the middle of the way, that far from the footprint."""
    ways = ((0.4 + ahead_m, 0.0), (-0.4 - behind_m, 0.0))
    return places(*(at for at in ways if math.isfinite(at[0])))


GOOD = Inputs(
    command=Twist(0.5, 0.0),
    command_age_s=0.0,
    scans=scanned(0.0),
    sight=Sight(NOWHERE),
    moving=AT_REST,
    previous=ZERO,
    since_s=HOLD_S,
    estop=EstopState.FREE,
    pressed=False,
    estop_age_s=0.0,
)
HELD = {"estop": EstopState.HELD}


def given_that(**changes: Any) -> Inputs:
    """All is well and 0.5 m/s ordered, but for the changes. `motion`: a velocity that does not change."""
    if "motion" in changes:
        changes["moving"] = Moving(changes.pop("motion"))
    return dataclasses.replace(GOOD, **changes)


ZONE = LimitZone(front_m=1.5, rear_m=1.0, left_m=1.0, right_m=1.0, linear_mps=0.25, angular_radps=0.5)
CEILING = Ceiling(linear_mps=0.6, angular_radps=1.0, acceleration_mps2=0.5, angular_acceleration_radps2=1.0)
"""In 0.02 s an order may grow by 0.01 m/s and 0.02 rad/s."""


def fed(now_s: float, twist: Twist, *, pressed: bool = False, the_filter: SafetyFilter | None = None) -> SafetyFilter:
    """A filter that has just received everything it needs."""
    made = the_filter or SafetyFilter(config())
    made.accept_command(twist, now_s)
    see(made, now_s)
    made.on_estop(pressed, now_s)
    return made


def see(safety: SafetyFilter, now_s: float, *at_m: tuple[float, float]) -> None:
    """A scan with these places, each seen by two beams."""
    rows = np.repeat(np.array(at_m).reshape(-1, 2), 2, axis=0)
    safety.on_points("scan", Points(rows, np.arange(len(rows)), 360), None, now_s)
