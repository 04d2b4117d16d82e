"""What obstacles leave of a command, told with distances [m] and speeds [m/s]."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from canbase_config.safety import Scan as ScanConfig
from canbase_runtime.stop_cause import StopCause
from canbase_velocity.clearance import Field, Points
from canbase_velocity.decision import Action
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.obstacle import Geometry, Sight
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig, ScanState, decide
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import (
    HOLD_S,
    INF,
    LIMITS,
    STANDSTILL_MPS,
    config,
    fed,
    free,
    given_that,
    places,
    scanned,
    see,
)


def test_an_obstacle_blocks_the_way_to_it_and_no_other() -> None:
    ahead, behind = free(ahead_m=0.0), free(behind_m=0.0)
    forward, backward, turning = Twist(0.3, 0.0), Twist(-0.3, 0.0), Twist(0.0, 1.0)
    stops = {
        (where, way): decide(given_that(sight=sight, command=twist), config()).action is Action.STOP
        for where, sight in (("ahead", ahead), ("behind", behind))
        for way, twist in (("forward", forward), ("backward", backward), ("turning", turning), ("standing", ZERO))
    }
    assert {key for key, stopped in stops.items() if stopped} == {
        ("ahead", "forward"),
        ("ahead", "turning"),
        ("behind", "backward"),
        ("behind", "turning"),
    }


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_towards_an_obstacle_the_speed_falls_so_that_the_base_stands_at_the_stop_distance(sign: float) -> None:
    """Between slow-down and stop distance: v · 0.02 s + v² / (2 · 1 m/s²) = free way - 0.1 m."""
    full = Twist(sign, 0.0)
    speeds = {}
    for free_m in (0.7, 0.621, 0.6, 0.35, 0.12, 0.1001, 0.1, 0.05, 0.0):
        decision = decide(given_that(command=full, sight=free(ahead_m=free_m, behind_m=free_m)), config())
        speeds[free_m] = (round(decision.twist.linear_mps * sign, 4), decision.action, decision.cause)
    slow, stop = (Action.SLOW, StopCause.OBSTACLE_NEAR), (Action.STOP, StopCause.OBSTACLE)
    assert speeds == {
        0.7: (1.0, Action.PASS, StopCause.NONE),
        0.621: (1.0, Action.PASS, StopCause.NONE),
        0.6: (0.9802, *slow),
        0.35: (0.6874, *slow),
        0.12: (0.181, *slow),
        0.1001: (0.0, *stop),  # below the speed that counts as standstill
        0.1: (0.0, *stop),
        0.05: (0.0, *stop),
        0.0: (0.0, *stop),
    }


def test_slowing_begins_before_the_slow_down_distance_when_the_ordinary_ramp_needs_it() -> None:
    limits = LIMITS.model_copy(update={"deceleration_mps2": 0.5})
    gentle = FilterConfig(limits, config().safety, STANDSTILL_MPS, Geometry.of(limits, config().safety, 1.0 / HOLD_S))
    decision = decide(given_that(command=Twist(1.0, 0.0), sight=free(ahead_m=0.7)), gentle)
    speed_mps = decision.twist.linear_mps
    assert speed_mps * HOLD_S + speed_mps**2 / (2 * 0.5) == pytest.approx(0.6)


def test_on_an_arc_the_order_is_slowed_on_the_same_curve() -> None:
    decision = decide(given_that(command=Twist(0.5, 0.5), sight=places((0.56, 0.1))), config())
    assert decision.action is Action.SLOW
    assert decision.twist.angular_radps == pytest.approx(decision.twist.linear_mps)
    assert "ahead on the arc" in decision.detail


@pytest.mark.parametrize(
    ("twist", "at_m", "action"),
    [
        (Twist(0.0, 0.5), (0.38, 0.31), Action.STOP),  # right before the front left corner as it turns left
        (Twist(0.0, -0.5), (0.38, 0.31), Action.PASS),  # away from it
        (Twist(0.0, 2.0), (0.2, 0.42), Action.SLOW),
        (Twist(0.0, 0.5), (0.0, 0.51), Action.PASS),  # beyond the circle
        (Twist(0.3, 0.5), (0.0, 0.35), Action.PASS),  # beside it: an arc forward swings the rear to the other side
        (Twist(0.3, 1.0), (-0.3, -0.32), Action.STOP),  # the rear right corner swings into it
        (Twist(0.3, 0.0), (-0.3, -0.32), Action.PASS),
    ],
)
def test_turning_stops_for_what_the_corners_would_hit(twist: Twist, at_m: tuple[float, float], action: Action) -> None:
    assert decide(given_that(command=twist, sight=places(at_m)), config()).action is action


def test_a_base_in_motion_that_can_no_longer_stop_gently_brakes_hard() -> None:
    """At 1 m/s the ordinary ramp of 2 m/s² needs 0.25 m; half the stop distance is 0.05 m."""
    fast = Twist(1.0, 0.0)
    late = decide(given_that(command=fast, motion=fast, sight=free(ahead_m=0.29)), config())
    in_time = decide(given_that(command=fast, motion=fast, sight=free(ahead_m=0.31)), config())
    assert (late.action, late.cause, late.twist, late.emergency) == (Action.STOP, StopCause.OBSTACLE, ZERO, True)
    assert (in_time.action, in_time.emergency) == (Action.SLOW, False)


@pytest.mark.parametrize(("free_m", "emergency"), [(0.29, True), (0.31, False)])
def test_a_zero_command_that_comes_too_late_brakes_hard_too(free_m: float, emergency: bool) -> None:
    decision = decide(given_that(command=ZERO, motion=Twist(1.0, 0.0), sight=free(ahead_m=free_m)), config())
    assert (decision.action, decision.twist, decision.emergency) == (Action.PASS, ZERO, emergency)


BACK_ONLY = Field(Placement(-0.4, 0.0, (-1.0, 0.0), (0.0, -1.0)), -math.pi / 2, math.pi, 0.05, 10.0)


@pytest.mark.parametrize(
    ("changes", "settings", "cause"),
    [
        ({"scans": (*scanned(0.0), ScanState("scan_rear", True, 0.3, 0.31))}, {}, StopCause.SCAN_STALE),
        ({"command_age_s": 0.21}, {}, StopCause.COMMAND_STALE),
        ({"estop": EstopState.AWAITS_RESET}, {}, StopCause.ESTOP),
        ({"sight": Sight(free(ahead_m=0.29).points, (BACK_ONLY,))}, {"blind_mps": 0.0}, StopCause.BLIND),
        ({"command": Twist(0.02, 0.0)}, {}, StopCause.OBSTACLE),  # the stick is pulled back to a creep
        ({"command": Twist(-0.5, 0.0)}, {}, StopCause.OBSTACLE),
        ({"command": ZERO}, {}, StopCause.NONE),
    ],
)
def test_whatever_stops_it_a_base_for_which_the_ordinary_ramp_is_too_late_brakes_hard(
    changes: dict[str, Any], settings: dict[str, Any], cause: StopCause
) -> None:
    """At 1 m/s with 0.29 m free, the ordinary ramp of 2 m/s² needs 0.25 m; with 0.31 m it would do."""
    moving = {"motion": Twist(1.0, 0.0), "sight": free(ahead_m=0.29), **changes}
    late = decide(given_that(**moving), config(**settings))
    assert (late.cause, late.twist, late.emergency) == (cause, ZERO, True)
    fields = moving["sight"].fields
    in_time = {**moving, "sight": Sight(free(ahead_m=0.31).points, fields)}
    assert not decide(given_that(**in_time), config(**settings)).emergency


def test_hard_braking_that_began_lasts_until_standstill() -> None:
    """The obstacle is gone from the scans, or the scans are gone: nothing says that the ordinary ramp is enough."""
    assert decide(given_that(motion=Twist(0.5, 0.0), braking_hard=True), config()).emergency
    assert not decide(given_that(motion=ZERO, braking_hard=True), config()).emergency
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    for step in range(1, 101):
        fed(step * HOLD_S, Twist(1.0, 0.0), the_filter=safety)
        safety.decide(step * HOLD_S)
    see(safety, 2.01, (0.6, 0.0))
    assert safety.decide(2.01).emergency
    see(safety, 2.03)
    assert safety.decide(2.03).emergency
    end = safety.shut_down(2.05)
    assert (end.cause, end.twist, end.emergency) == (StopCause.SHUTDOWN, ZERO, True)
    assert not safety.shut_down(3.0).emergency


def test_the_base_leaves_its_motion_only_by_its_ramps() -> None:
    """Turning on the spot is ordered and free, but at 1 m/s the wall ahead comes first."""
    turn = Twist(0.0, 1.0)
    assert decide(given_that(command=turn, sight=free(ahead_m=0.28)), config()).action is Action.PASS
    moving = decide(given_that(command=turn, motion=Twist(1.0, 0.0), sight=free(ahead_m=0.28)), config())
    assert (moving.action, moving.twist, moving.emergency) == (Action.STOP, ZERO, True)


def test_of_several_scanners_each_required_one_must_be_fresh_and_all_are_looked_at() -> None:
    rear = ScanConfig(required=False, topic="scan_rear", timeout_s=0.3)
    safety = fed(0.0, ZERO, the_filter=SafetyFilter(config(more_scans=(rear,))))
    safety.decide(0.0)
    wall = Points(np.array([(-0.42, 0.0), (-0.42, 0.05)]), np.array([0, 1]), 360)
    safety.on_points("scan_rear", wall, None, 0.0)
    fed(0.1, Twist(-0.3, 0.0), the_filter=safety)
    assert safety.decide(0.1).cause is StopCause.OBSTACLE
    free_way = safety.clearances(0.1)
    assert free_way is not None
    assert free_way.ahead_m == INF
    assert free_way.behind_m == pytest.approx(0.02)
    fed(0.31, Twist(-0.3, 0.0), the_filter=safety)
    assert safety.decide(0.31).cause is StopCause.NONE  # the rear scan is stale and is not required
    assert safety.clearances(0.7) is None
    safety.on_unplaced_scan("scan", "tf_static does not say where laser is in base_link")
    assert safety.decide(0.32).cause is StopCause.SCAN_UNPLACED
    fed(0.33, ZERO, the_filter=safety)
    assert safety.decide(0.33).cause is StopCause.NONE


def test_the_way_ordered_since_the_scan_is_counted() -> None:
    """1 m/s since a scan of 0.25 s ago: what was 0.7 m away is now 0.35 m away, with the reaction of 0.1 s."""
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    for step in range(1, 101):
        now_s = step * HOLD_S
        fed(now_s, Twist(1.0, 0.0), the_filter=safety)
        safety.decide(now_s)
    see(safety, 2.0, (1.1, 0.0))
    orders = {}
    for step in range(1, 14):
        now_s = 2.0 + step * HOLD_S
        safety.accept_command(Twist(1.0, 0.0), now_s)
        safety.on_estop(False, now_s)
        orders[step] = safety.decide(now_s).twist.linear_mps
    assert orders[1] == pytest.approx(0.96, abs=0.03)
    assert list(orders.values()) == sorted(orders.values(), reverse=True)
    assert orders[13] < 0.75
