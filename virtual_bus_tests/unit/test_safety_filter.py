"""What the safety filter lets through, told as stories with times [s], and its properties."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from canbase.msg import SafetyState
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.robot import Limits
from canbase_config.safety import Ceiling, Estop, Footprint, LimitZone, Safety
from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.clearance import NOWHERE, Field, Points
from canbase_velocity.decision import Action, Cause, Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import NOTHING_TO_RESET, SafetyFilter
from canbase_velocity.motion import ExpectedMotion, follow
from canbase_velocity.obstacle import NOTHING_IN_SIGHT, Geometry, Sight, allowed_share, braking_time_s
from canbase_velocity.placement import Placement
from canbase_velocity.safety_filter import FilterConfig, Inputs, ScanState, decide
from canbase_velocity.sweep import Box, fastest_mps, first_touch
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
)
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


def scanned(age_s: float | None, *, required: bool = True, problem: str = "") -> tuple[ScanState, ...]:
    return (ScanState("scan", required, 0.3, age_s, problem),)


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
    sight=NOTHING_IN_SIGHT,
    motion=ZERO,
    previous=ZERO,
    since_s=HOLD_S,
    estop=EstopState.FREE,
    pressed=False,
    estop_age_s=0.0,
)
HELD = {"estop": EstopState.HELD}


def given_that(**changes: Any) -> Inputs:
    """All is well and 0.5 m/s ordered, but for the changes."""
    return dataclasses.replace(GOOD, **changes)


def test_with_all_well_a_command_goes_through_as_it_came() -> None:
    decision = decide(GOOD, config())
    assert decision.twist == GOOD.command
    assert (decision.action, decision.cause, decision.detail, decision.clears_on) == (Action.PASS, Cause.NONE, "", "")


def test_actions_and_causes_are_those_of_the_message() -> None:
    assert [action.value for action in Action] == [
        SafetyState.PASS,
        SafetyState.LIMIT,
        SafetyState.SLOW,
        SafetyState.STOP,
    ]
    constants = {getattr(SafetyState, name) for name in dir(SafetyState) if name.startswith("CAUSE_")}
    assert {cause.value for cause in Cause} == constants


@pytest.mark.parametrize(
    ("changes", "cause", "words"),
    [
        ({"command_age_s": None}, Cause.COMMAND_STALE, "nothing received on cmd_vel_mux yet"),
        ({"command_age_s": 0.25}, Cause.COMMAND_STALE, "cmd_vel_mux silent for 0.25 s (timeout 0.20 s)"),
        ({"command": Twist(NAN, 0.0)}, Cause.COMMAND_INVALID, "cmd_vel_mux carries"),
        ({"command": Twist(0.0, INF)}, Cause.COMMAND_INVALID, "cmd_vel_mux carries"),
        ({"scans": scanned(None)}, Cause.SCAN_STALE, "nothing received on scan yet"),
        ({"scans": scanned(0.35)}, Cause.SCAN_STALE, "scan silent for 0.35 s (timeout 0.30 s)"),
        ({"scans": scanned(0.0, problem="tf_static is empty")}, Cause.SCAN_UNPLACED, "scan: tf_static is empty"),
        (HELD | {"pressed": True}, Cause.ESTOP, "the emergency stop is pressed"),
        (HELD | {"estop_age_s": None}, Cause.ESTOP_STALE, "nothing received on estop_state yet"),
        (HELD | {"estop_age_s": 0.6}, Cause.ESTOP_STALE, "estop_state silent for 0.60 s (timeout 0.50 s)"),
        ({"estop": EstopState.AWAITS_ZERO}, Cause.ESTOP, "has not been zero since"),
        ({"estop": EstopState.AWAITS_RESET}, Cause.ESTOP, "waits for a reset"),
        ({"sight": free(ahead_m=0.05)}, Cause.OBSTACLE, "0.05 m free ahead, stop distance 0.10 m"),
    ],
)
def test_each_reason_to_stop_has_its_cause_and_says_what_ends_it(
    changes: dict[str, Any], cause: Cause, words: str
) -> None:
    decision = decide(given_that(**changes), config())
    assert (decision.action, decision.cause, decision.twist) == (Action.STOP, cause, ZERO)
    assert words in decision.detail
    assert decision.clears_on != ""


@pytest.mark.parametrize(
    ("changes", "timeout_s", "cause"),
    [
        (lambda age_s: {"command_age_s": age_s}, 0.2, Cause.COMMAND_STALE),
        (lambda age_s: {"scans": scanned(age_s)}, 0.3, Cause.SCAN_STALE),
    ],
)
def test_an_input_is_fresh_until_exactly_its_timeout(changes: Any, timeout_s: float, cause: Cause) -> None:
    assert decide(given_that(**changes(timeout_s)), config()).cause is Cause.NONE
    assert decide(given_that(**changes(math.nextafter(timeout_s, INF))), config()).cause is cause


def test_what_is_not_required_may_be_silent() -> None:
    silent = given_that(scans=scanned(None, required=False), estop_age_s=None)
    assert decide(silent, config(scan=False, estop=False)).twist == GOOD.command
    unplaced = given_that(scans=scanned(0.0, required=False, problem="tf_static is empty"))
    assert decide(unplaced, config(scan=False)).twist == GOOD.command


def test_of_several_reasons_to_stop_the_earlier_rule_is_told() -> None:
    everything = {
        "estop": EstopState.HELD, "pressed": True, "estop_age_s": 9.0, "command": Twist(NAN, 0.0), "command_age_s": 9.0,
        "scans": scanned(9.0),
    }  # fmt: skip
    causes = []
    for key, good in (("pressed", False), ("estop", EstopState.FREE), ("command_age_s", 0.0),
                      ("command", Twist(5.0, 0.0)), ("scans", scanned(0.0))):  # fmt: skip
        causes.append(decide(given_that(**everything), config()).cause)
        everything[key] = good
    assert causes == [
        Cause.ESTOP, Cause.ESTOP_STALE, Cause.COMMAND_STALE, Cause.COMMAND_INVALID, Cause.SCAN_STALE,
    ]  # fmt: skip
    assert decide(given_that(**everything), config()).cause is Cause.SPEED


@pytest.mark.parametrize(
    ("asked", "ordered"),
    [
        (Twist(1.0, 2.0), Twist(1.0, 2.0)),  # exactly at both limits
        (Twist(2.0, 0.5), Twist(1.0, 0.25)),
        (Twist(-2.0, 0.5), Twist(-1.0, 0.25)),
        (Twist(0.5, 4.0), Twist(0.25, 2.0)),
        (Twist(4.0, -4.0), Twist(1.0, -1.0)),  # the harder of both limits
        (Twist(0.0, -8.0), Twist(0.0, -2.0)),
        (Twist(1e308, 0.0), Twist(1.0, 0.0)),
    ],
)
def test_the_speed_ceiling_keeps_the_curve(asked: Twist, ordered: Twist) -> None:
    decision = decide(given_that(command=asked), config())
    assert (decision.twist.linear_mps, decision.twist.angular_radps) == pytest.approx(
        (ordered.linear_mps, ordered.angular_radps)
    )
    assert (decision.action is Action.LIMIT) is (asked != ordered)
    assert (decision.cause is Cause.SPEED) is (asked != ordered)


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
    for free_m in (0.7, 0.62, 0.6, 0.35, 0.12, 0.1001, 0.1, 0.05, 0.0):
        decision = decide(given_that(command=full, sight=free(ahead_m=free_m, behind_m=free_m)), config())
        speeds[free_m] = (round(decision.twist.linear_mps * sign, 4), decision.action, decision.cause)
    slow, stop = (Action.SLOW, Cause.OBSTACLE_NEAR), (Action.STOP, Cause.OBSTACLE)
    assert speeds == {
        0.7: (1.0, Action.PASS, Cause.NONE),
        0.62: (1.0, Action.PASS, Cause.NONE),
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
    assert (late.action, late.cause, late.twist, late.emergency) == (Action.STOP, Cause.OBSTACLE, ZERO, True)
    assert (in_time.action, in_time.emergency) == (Action.SLOW, False)


@pytest.mark.parametrize(("free_m", "emergency"), [(0.29, True), (0.31, False)])
def test_a_zero_command_that_comes_too_late_brakes_hard_too(free_m: float, emergency: bool) -> None:
    decision = decide(given_that(command=ZERO, motion=Twist(1.0, 0.0), sight=free(ahead_m=free_m)), config())
    assert (decision.action, decision.twist, decision.emergency) == (Action.PASS, ZERO, emergency)


def test_the_base_leaves_its_motion_only_by_its_ramps() -> None:
    """Turning on the spot is ordered and free, but at 1 m/s the wall ahead comes first."""
    turn = Twist(0.0, 1.0)
    assert decide(given_that(command=turn, sight=free(ahead_m=0.28)), config()).action is Action.PASS
    moving = decide(given_that(command=turn, motion=Twist(1.0, 0.0), sight=free(ahead_m=0.28)), config())
    assert (moving.action, moving.twist, moving.emergency) == (Action.STOP, ZERO, True)


def test_only_a_held_emergency_stop_brakes_hard_of_the_reasons_to_stop() -> None:
    moving = {"motion": Twist(1.0, 0.0)}
    assert decide(given_that(**HELD, **moving), config()).emergency is True
    assert decide(given_that(scans=scanned(9.0), **moving), config()).emergency is False
    assert decide(given_that(estop=EstopState.AWAITS_RESET, **moving), config()).emergency is False


ZONE = LimitZone(front_m=1.5, rear_m=1.0, left_m=1.0, right_m=1.0, linear_mps=0.25, angular_radps=0.5)


@pytest.mark.parametrize(
    ("at_m", "asked", "ordered"),
    [
        ((1.49, 0.9), Twist(-0.5, 0.0), Twist(-0.25, 0.0)),  # whatever the direction of travel
        ((1.51, 0.9), Twist(-0.5, 0.0), Twist(-0.5, 0.0)),
        ((0.0, 0.99), Twist(0.0, 1.0), Twist(0.0, 0.5)),
        ((0.0, 0.99), Twist(0.2, 0.1), Twist(0.2, 0.1)),
    ],
)
def test_something_in_a_limit_zone_limits_the_speed(at_m: tuple[float, float], asked: Twist, ordered: Twist) -> None:
    decision = decide(given_that(command=asked, sight=places(at_m)), config(limit_zones=(ZONE,)))
    assert decision.twist == ordered
    assert decision.cause is (Cause.NONE if asked == ordered else Cause.ZONE)


AHEAD_ONLY = Field(Placement(0.4, 0.0, (1.0, 0.0), (0.0, 1.0)), -math.pi / 2, math.pi, 0.05, 10.0)
BEHIND_ONLY = Field(Placement(-0.4, 0.0, (-1.0, 0.0), (0.0, -1.0)), -math.pi / 2, math.pi, 0.05, 10.0)


def looking(*fields: Field) -> Sight:
    return Sight(NOWHERE, fields)


@pytest.mark.parametrize(
    ("command", "fields", "speed_mps"),
    [
        (Twist(0.5, 0.0), (AHEAD_ONLY,), 0.5),
        (Twist(-0.5, 0.0), (AHEAD_ONLY,), 0.15),
        (Twist(-0.1, 0.0), (AHEAD_ONLY,), 0.1),
        (Twist(-0.5, 0.0), (AHEAD_ONLY, BEHIND_ONLY), 0.5),
        (Twist(0.5, 0.0), (BEHIND_ONLY,), 0.15),
        (Twist(0.0, 1.0), (AHEAD_ONLY,), 0.15),
        (Twist(-0.5, 0.0), (), 0.5),  # looks everywhere, or nobody looks at all and no scan is required
    ],
)
def test_where_no_scanner_looks_the_base_creeps(command: Twist, fields: tuple[Field, ...], speed_mps: float) -> None:
    decision = decide(given_that(command=command, sight=looking(*fields)), config())
    assert fastest_mps(BOX, decision.twist) == pytest.approx(speed_mps)
    assert (decision.cause is Cause.BLIND) == (decision.twist != command)


def test_with_a_blind_speed_of_0_the_base_does_not_go_where_no_scanner_looks() -> None:
    decision = decide(given_that(command=Twist(-0.5, 0.0), sight=looking(AHEAD_ONLY)), config(blind_mps=0.0))
    assert (decision.action, decision.cause, decision.twist) == (Action.STOP, Cause.BLIND, ZERO)


CEILING = Ceiling(linear_mps=0.6, angular_radps=1.0, acceleration_mps2=0.5, angular_acceleration_radps2=1.0)
"""In 0.02 s an order may grow by 0.01 m/s and 0.02 rad/s."""


@pytest.mark.parametrize(
    ("previous", "asked", "ordered"),
    [
        (ZERO, Twist(0.5, 0.5), Twist(0.01, 0.01)),  # from rest on the curve of the command
        (ZERO, Twist(-0.2, 1.0), Twist(-0.004, 0.02)),
        (Twist(0.5, 0.0), Twist(0.5, 1.0), Twist(0.5, 0.02)),  # into a turn without slowing down
        (Twist(0.5, 0.5), Twist(0.2, 0.2), Twist(0.2, 0.2)),  # what falls, falls at once
        (Twist(0.5, 0.5), ZERO, ZERO),
        (Twist(0.5, 0.0), Twist(-0.5, 0.0), Twist(-0.01, 0.0)),  # a reversal begins at zero
        (Twist(0.59, 0.0), Twist(0.9, 0.0), Twist(0.6, 0.0)),  # a ceiling of its own, below that of the driver
    ],
)
def test_orders_grow_no_faster_than_the_ceiling_and_keep_the_curve(
    previous: Twist, asked: Twist, ordered: Twist
) -> None:
    decision = decide(given_that(command=asked, previous=previous), config(ceiling=CEILING))
    got = decision.twist
    assert (got.linear_mps, got.angular_radps) == pytest.approx((ordered.linear_mps, ordered.angular_radps))


def test_without_time_nothing_grows() -> None:
    decision = decide(given_that(previous=Twist(0.1, 0.0), since_s=0.0), config(ceiling=CEILING))
    assert decision.twist.linear_mps == pytest.approx(0.1)
    assert (decision.action, decision.cause) == (Action.LIMIT, Cause.ACCELERATION)


def test_ceiling_and_obstacle_together_tell_the_more_severe_and_order_the_slower() -> None:
    decision = decide(given_that(command=Twist(4.0, 0.0), sight=free(ahead_m=0.35)), config())
    assert (decision.action, decision.cause) == (Action.SLOW, Cause.OBSTACLE_NEAR)
    assert decision.twist.linear_mps == pytest.approx(0.6874, abs=1e-4)
    far = decide(given_that(command=Twist(4.0, 0.0), sight=free(ahead_m=0.62)), config())
    assert (far.action, far.twist.linear_mps) == (Action.LIMIT, 1.0)


def test_how_long_the_ordinary_ramp_takes() -> None:
    assert braking_time_s(Twist(-1.0, 0.0), LIMITS) == 0.5
    assert braking_time_s(Twist(0.1, -2.0), LIMITS) == 0.5
    assert braking_time_s(ZERO, LIMITS) == 0.0


def fed(now: float, twist: Twist, *, pressed: bool = False, the_filter: SafetyFilter | None = None) -> SafetyFilter:
    """A filter that has just received everything it needs."""
    made = the_filter or SafetyFilter(config())
    made.on_command(twist, now)
    see(made, now)
    made.on_estop(pressed, now)
    return made


def see(safety: SafetyFilter, now: float, *at_m: tuple[float, float]) -> None:
    """A scan with these places, each seen by two beams."""
    rows = np.repeat(np.array(at_m).reshape(-1, 2), 2, axis=0)
    safety.on_scan("scan", Points(rows, np.arange(len(rows)), 360), None, now)


def test_a_filter_that_received_nothing_stops() -> None:
    decision = SafetyFilter(config()).decide(0.0)
    assert (decision.action, decision.cause) == (Action.STOP, Cause.ESTOP_STALE)


def test_after_the_emergency_stop_is_released_the_command_has_to_be_zero_once() -> None:
    drive = Twist(0.5, 0.0)
    safety = fed(0.0, ZERO)
    assert safety.decide(0.0).cause is Cause.NONE  # the required topic began with a zero command
    fed(1.0, drive, the_filter=safety)
    assert safety.decide(1.0).twist == drive
    fed(1.1, drive, pressed=True, the_filter=safety)
    assert safety.decide(1.1).cause is Cause.ESTOP
    fed(1.2, ZERO, pressed=True, the_filter=safety)  # a zero while it is pressed does not count
    assert safety.decide(1.2).cause is Cause.ESTOP
    fed(1.3, drive, the_filter=safety)  # released, the joystick still pushed
    assert (safety.decide(1.3).cause, safety.decide(1.3).twist) == (Cause.ESTOP, ZERO)
    fed(1.4, ZERO, the_filter=safety)
    assert (safety.decide(1.4).action, safety.decide(1.4).cause) == (Action.PASS, Cause.NONE)
    fed(1.5, drive, the_filter=safety)
    assert safety.decide(1.5).twist == drive


def test_a_short_press_between_two_decisions_is_not_missed() -> None:
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    safety.on_command(Twist(0.5, 0.0), 0.1)
    safety.on_estop(True, 0.101)
    safety.on_estop(False, 0.102)
    assert safety.decide(0.103).cause is Cause.ESTOP


def test_a_required_emergency_stop_that_was_silent_needs_a_zero_command_too() -> None:
    drive = Twist(0.5, 0.0)
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    safety.on_command(drive, 0.51)
    see(safety, 0.51)
    assert safety.decide(0.51).cause is Cause.ESTOP_STALE
    fed(0.6, drive, the_filter=safety)
    assert safety.decide(0.6).cause is Cause.ESTOP
    fed(0.7, ZERO, the_filter=safety)
    assert safety.decide(0.7).cause is Cause.NONE


def test_a_stale_zero_command_does_not_free_the_emergency_stop() -> None:
    safety = fed(0.0, ZERO, pressed=True)
    safety.decide(0.0)
    safety.on_estop(False, 0.3)
    assert safety.decide(0.3).cause is Cause.ESTOP  # the zero is 0.3 s old, its timeout 0.2 s
    safety.on_command(Twist(0.5, 0.0), 0.31)
    assert safety.decide(0.31).cause is Cause.ESTOP


def test_the_zero_command_counts_until_exactly_its_timeout() -> None:
    safety = fed(0.0, ZERO, pressed=True)
    safety.on_estop(False, 0.2)
    see(safety, 0.2)
    assert safety.decide(0.2).cause is Cause.NONE


def test_without_an_emergency_stop_nothing_waits_for_a_zero_command() -> None:
    safety = SafetyFilter(config(scan=False, estop=False))
    safety.on_command(Twist(0.5, 0.0), 0.0)
    assert safety.decide(0.0).twist == Twist(0.5, 0.0)


def latched(now: float, twist: Twist) -> SafetyFilter:
    """A filter whose emergency stop needs a reset; it was heard released, and `twist` is ordered."""
    safety = fed(now, ZERO, the_filter=SafetyFilter(config(latched=True)))
    assert safety.decide(now).cause is Cause.NONE  # at the start nothing has to be reset
    return fed(now, twist, the_filter=safety)


def test_a_latched_emergency_stop_needs_a_reset_after_its_release() -> None:
    safety = latched(0.0, Twist(0.5, 0.0))
    assert safety.reset((), 0.0) == (True, NOTHING_TO_RESET)
    fed(0.1, ZERO, pressed=True, the_filter=safety)
    assert safety.decide(0.1).cause is Cause.ESTOP
    assert safety.reset((), 0.1) == (False, "refused: the emergency stop on estop_state is pressed")
    fed(0.2, ZERO, the_filter=safety)
    assert (safety.decide(0.2).clears_on, safety.estop) == ("reset", EstopState.AWAITS_RESET)
    fed(0.3, Twist(0.5, 0.0), the_filter=safety)
    assert safety.reset((), 0.3)[0] is False  # the driving source is not zero
    fed(0.4, ZERO, the_filter=safety)
    done, sentence = safety.reset(("navigation",), 0.4)  # another one is not, it would drive next
    assert (done, sentence.split(";")[0]) == (False, "refused: navigation orders a velocity")
    assert safety.decide(0.4).cause is Cause.ESTOP
    assert safety.reset((), 0.4)[0] is True
    assert safety.decide(0.4).cause is Cause.NONE
    fed(0.5, Twist(0.5, 0.0), the_filter=safety)
    assert safety.decide(0.5).twist == Twist(0.5, 0.0)


def test_a_silence_of_the_stop_button_is_latched_once_it_was_heard() -> None:
    safety = latched(0.0, ZERO)
    safety.on_command(ZERO, 0.6)
    see(safety, 0.6)
    assert safety.decide(0.6).cause is Cause.ESTOP_STALE
    assert safety.reset((), 0.6) == (False, "refused: the emergency stop on estop_state is silent")
    fed(0.7, ZERO, the_filter=safety)
    assert (safety.decide(0.7).cause, safety.estop) == (Cause.ESTOP, EstopState.AWAITS_RESET)


@pytest.mark.parametrize("state", list(EstopState))
def test_a_press_holds_from_every_state(state: EstopState) -> None:
    safety = latched(0.0, Twist(0.5, 0.0))
    safety._estop.state = state
    fed(0.1, ZERO, pressed=True, the_filter=safety)
    decision = safety.decide(0.1)
    assert (decision.cause, decision.twist, decision.emergency) == (Cause.ESTOP, ZERO, True)
    assert safety.estop is EstopState.HELD


def test_of_several_scanners_each_required_one_must_be_fresh_and_all_are_looked_at() -> None:
    rear = ScanConfig(required=False, topic="scan_rear", timeout_s=0.3)
    safety = fed(0.0, ZERO, the_filter=SafetyFilter(config(more_scans=(rear,))))
    safety.decide(0.0)
    wall = Points(np.array([(-0.42, 0.0), (-0.42, 0.05)]), np.array([0, 1]), 360)
    safety.on_scan("scan_rear", wall, None, 0.0)
    fed(0.1, Twist(-0.3, 0.0), the_filter=safety)
    assert safety.decide(0.1).cause is Cause.OBSTACLE
    free_way = safety.clearances(0.1)
    assert free_way is not None
    assert free_way.ahead_m == INF
    assert free_way.behind_m == pytest.approx(0.02)
    fed(0.31, Twist(-0.3, 0.0), the_filter=safety)
    assert safety.decide(0.31).cause is Cause.NONE  # the rear scan is stale and is not required
    assert safety.clearances(0.7) is None
    safety.on_unplaced_scan("scan", "tf_static does not say where laser is in base_link")
    assert safety.decide(0.32).cause is Cause.SCAN_UNPLACED
    fed(0.33, ZERO, the_filter=safety)
    assert safety.decide(0.33).cause is Cause.NONE


def test_the_way_ordered_since_the_scan_is_counted() -> None:
    """1 m/s since a scan of 0.25 s ago: what was 0.7 m away is now 0.35 m away, with the reaction of 0.1 s."""
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    for step in range(1, 101):
        now = step * HOLD_S
        fed(now, Twist(1.0, 0.0), the_filter=safety)
        safety.decide(now)
    see(safety, 2.0, (1.1, 0.0))
    orders = {}
    for step in range(1, 14):
        now = 2.0 + step * HOLD_S
        safety.on_command(Twist(1.0, 0.0), now)
        safety.on_estop(False, now)
        orders[step] = safety.decide(now).twist.linear_mps
    assert orders[1] == pytest.approx(0.96, abs=0.03)
    assert list(orders.values()) == sorted(orders.values(), reverse=True)
    assert orders[13] < 0.75


numbers = st.floats() | st.floats(-3.0, 3.0) | st.sampled_from([0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 5e-324])
finite = numbers.filter(math.isfinite)
ages_s = st.none() | st.floats(0.0, 1.0) | st.sampled_from([0.2, 0.3, 0.5])
spots_m = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)) | st.sampled_from([(0.4, 0.3), (0.5, 0.0), (0.0, 0.0)])
sights = st.lists(spots_m, max_size=8).map(lambda at: places(*at))
motions = st.builds(Twist, st.floats(-1.0, 1.0), st.floats(-2.0, 2.0)) | st.just(ZERO)
all_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, numbers, numbers),
    command_age_s=ages_s,
    scans=ages_s.map(scanned),
    sight=sights,
    motion=motions,
    previous=motions,
    since_s=st.floats(0.0, 0.1),
    estop=st.sampled_from(EstopState),
    pressed=st.booleans(),
    estop_age_s=ages_s,
)
moving_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, finite, finite),
    command_age_s=st.floats(0.0, 0.2),
    scans=st.floats(0.0, 0.3).map(scanned),
    sight=sights,
    motion=motions,
    previous=motions,
    since_s=st.floats(0.0, 0.1),
    estop=st.just(EstopState.FREE),
    pressed=st.just(False),
    estop_age_s=st.floats(0.0, 0.5),
)
ceilings = st.none() | st.just(CEILING)
configs = st.builds(
    lambda scan, estop, ceiling, zones: config(scan=scan, estop=estop, ceiling=ceiling, limit_zones=zones),
    st.booleans(), st.booleans(), ceilings, st.just(()) | st.just((ZONE,)),
)  # fmt: skip


@given(inputs=all_inputs | moving_inputs, settings=configs)
def test_the_order_is_finite_never_faster_than_the_command_or_the_limits_and_never_turned_around(
    inputs: Inputs, settings: FilterConfig
) -> None:
    order = decide(inputs, settings).twist
    assert order.is_finite
    assert abs(order.linear_mps) <= LIMITS.linear_mps
    assert abs(order.angular_radps) <= LIMITS.angular_radps
    for ordered, asked in (
        (order.linear_mps, inputs.command.linear_mps),
        (order.angular_radps, inputs.command.angular_radps),
    ):
        assert ordered == 0.0 or (
            abs(ordered) <= abs(asked) * (1 + 1e-12) and math.copysign(1.0, ordered) == math.copysign(1.0, asked)
        )


@given(inputs=moving_inputs)
def test_without_a_ceiling_of_growth_the_curve_is_that_of_the_command(inputs: Inputs) -> None:
    order, asked = decide(inputs, config()).twist, inputs.command
    across = order.linear_mps * asked.angular_radps - order.angular_radps * asked.linear_mps
    scale = max(abs(asked.angular_radps), abs(asked.linear_mps))
    assert not math.isfinite(across) or abs(across) <= 1e-9 * scale


@given(inputs=all_inputs, settings=configs)
def test_it_stops_whenever_a_required_input_is_stale_or_the_emergency_stop_is_not_free(
    inputs: Inputs, settings: FilterConfig
) -> None:
    stale = [
        inputs.command_age_s is None or inputs.command_age_s > 0.2,
        not inputs.scans[0].is_fresh,
        inputs.estop is not EstopState.FREE,
        not inputs.command.is_finite,
    ]
    decision = decide(inputs, settings)
    assert decision.action is Action.STOP or not any(stale)
    assert decision.twist == ZERO or decision.action is not Action.STOP
    assert (decision.cause is Cause.NONE) == (decision.action is Action.PASS)


def stands_in_time(decision: Decision, inputs: Inputs) -> bool:
    """Along the arc of the order, by the ordinary ramp, before the stop distance."""
    touch = first_touch(inputs.sight.points, BOX, decision.twist, 0.1)
    return braking_time_s(decision.twist, LIMITS) / 2.0 <= touch.slack_s * (1 + 1e-9)


@given(inputs=moving_inputs)
def test_from_every_ordered_speed_the_base_can_stand_before_the_stop_distance(inputs: Inputs) -> None:
    decision = decide(inputs, config())
    assert decision.twist.is_zero or stands_in_time(decision, inputs)


@given(inputs=moving_inputs)
def test_one_more_obstacle_never_makes_an_order_faster(inputs: Inputs) -> None:
    fewer = dataclasses.replace(inputs, sight=Sight(inputs.sight.points[1:]))
    order, order_of_fewer = decide(inputs, config()).twist, decide(fewer, config()).twist
    assert abs(order.linear_mps) <= abs(order_of_fewer.linear_mps) * (1 + 1e-12)


@given(inputs=all_inputs, settings=configs)
def test_zero_is_always_allowed(inputs: Inputs, settings: FilterConfig) -> None:
    assert decide(dataclasses.replace(inputs, command=ZERO), settings).twist == ZERO


@given(
    slack_s=st.floats(-1.0, 10.0) | st.sampled_from([0.0, 5e-324]),
    braking_s=st.floats(1e-6, 3.0),
    hold_s=st.floats(0.001, 0.3),
)
def test_the_allowed_share_uses_the_time_up(slack_s: float, braking_s: float, hold_s: float) -> None:
    share = allowed_share(slack_s, braking_s, hold_s)
    assert 0.0 <= share <= 1.0
    used_s = share * hold_s + share**2 * braking_s / 2.0
    assert share == 1.0 or used_s == pytest.approx(max(slack_s, 0.0), abs=1e-9)
    assert share < 1.0 or used_s <= slack_s * (1 + 1e-9) + 1e-9


def test_the_expected_motion_follows_the_ramps() -> None:
    assert follow(ZERO, Twist(1.0, 0.0), LIMITS, 0.1).linear_mps == pytest.approx(0.1)
    assert follow(Twist(1.0, 0.0), ZERO, LIMITS, 0.1).linear_mps == pytest.approx(0.8)
    braking = follow(Twist(1.0, 0.5), ZERO, LIMITS, 0.1)
    assert braking.angular_radps / braking.linear_mps == pytest.approx(0.5)
    turning = follow(Twist(1.0, 0.0), Twist(0.0, 2.0), LIMITS, 0.1)
    assert turning.linear_mps == pytest.approx(0.8)  # braking does not wait for the turn
    assert 0.0 < turning.angular_radps <= 0.4
    back = follow(Twist(0.2, 0.0), Twist(-1.0, 0.0), LIMITS, 0.05)
    assert -1.0 < back.linear_mps < 0.2
    assert follow(Twist(0.2, 0.0), Twist(0.3, 0.0), LIMITS, 5.0) == Twist(0.3, 0.0)


def test_the_expected_pose_is_remembered_between_orders_and_no_longer_than_asked_for() -> None:
    motion = ExpectedMotion(LIMITS, memory_s=0.5)
    motion.order(Twist(1.0, 0.0), 10.0)
    at_m = [motion.advance(10.0 + step * 0.1).x_m for step in range(21)]
    assert at_m[10] == pytest.approx(0.5, abs=1e-6)  # 1 m/s² from rest
    assert motion.pose_at(11.75).x_m == pytest.approx((at_m[17] + at_m[18]) / 2.0)
    assert motion.pose_at(11.8).x_m == pytest.approx(at_m[18])
    assert motion.pose_at(13.0).x_m == at_m[20]
    assert at_m[14] <= motion.pose_at(10.0).x_m <= at_m[15]
