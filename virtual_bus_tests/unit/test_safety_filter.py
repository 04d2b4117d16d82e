"""What the safety filter lets through, told as stories with times [s], and its properties."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from canbase.msg import SafetyState
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.robot import Limits
from canbase_config.safety import Estop, Footprint, Safety
from canbase_config.safety import Scan as ScanConfig
from canbase_velocity.clearance import FREE, Clearances
from canbase_velocity.decision import Action, Cause
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.safety_filter import FilterConfig, Inputs, approach_speed_mps, braking_time_s, decide
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


def config(*, scan: bool = True, estop: bool = True) -> FilterConfig:
    """Stop distance 0.1 m, slow-down distance 0.6 m: from 1 m/s a ramp of 1 m/s² fits between them. Circle 0.5 m."""
    safety = Safety(
        footprint=Footprint(front_m=0.4, rear_m=0.4, left_m=0.3, right_m=0.3),
        scan=ScanConfig(required=scan, timeout_s=0.3),
        estop=Estop(required=estop, timeout_s=0.5),
        command_timeout_s=0.2,
        stop_distance_m=0.1,
        slow_distance_m=0.6,
    )
    return FilterConfig(LIMITS, safety, STANDSTILL_MPS)


GOOD = Inputs(
    command=Twist(0.5, 0.0),
    command_age_s=0.0,
    clearances=FREE,
    scan_age_s=0.0,
    estop=False,
    estop_age_s=0.0,
    awaits_zero=False,
)


def given_that(**changes: Any) -> Inputs:
    """All is well and 0.5 m/s ordered, but for the changes."""
    return dataclasses.replace(GOOD, **changes)


def free(ahead_m: float = INF, behind_m: float = INF, around_m: float = INF) -> Clearances:
    return Clearances(ahead_m, behind_m, around_m)


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
        ({"scan_age_s": None}, Cause.SCAN_STALE, "nothing received on scan yet"),
        ({"scan_age_s": 0.35}, Cause.SCAN_STALE, "scan silent for 0.35 s (timeout 0.30 s)"),
        ({"estop": True}, Cause.ESTOP, "the emergency stop is pressed"),
        ({"estop_age_s": None}, Cause.ESTOP_STALE, "nothing received on estop_state yet"),
        ({"estop_age_s": 0.6}, Cause.ESTOP_STALE, "estop_state silent for 0.60 s (timeout 0.50 s)"),
        ({"awaits_zero": True}, Cause.ESTOP, "has not been zero since"),
        ({"clearances": free(ahead_m=0.05)}, Cause.OBSTACLE, "0.05 m free ahead, stop distance 0.10 m"),
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
    ("key", "timeout_s", "cause"),
    [
        ("command_age_s", 0.2, Cause.COMMAND_STALE),
        ("scan_age_s", 0.3, Cause.SCAN_STALE),
        ("estop_age_s", 0.5, Cause.ESTOP_STALE),
    ],
)
def test_an_input_is_fresh_until_exactly_its_timeout(key: str, timeout_s: float, cause: Cause) -> None:
    assert decide(given_that(**{key: timeout_s}), config()).cause is Cause.NONE
    assert decide(given_that(**{key: math.nextafter(timeout_s, INF)}), config()).cause is cause


def test_what_is_not_required_may_be_silent_but_is_obeyed_while_it_talks() -> None:
    relaxed = config(scan=False, estop=False)
    silent = given_that(scan_age_s=None, estop_age_s=None)
    assert decide(silent, relaxed).twist == GOOD.command
    assert decide(given_that(estop=True, estop_age_s=100.0), relaxed).cause is Cause.ESTOP  # nobody released it
    wall = free(ahead_m=0.0)
    assert decide(given_that(clearances=wall, scan_age_s=0.3), relaxed).cause is Cause.OBSTACLE
    assert decide(given_that(clearances=wall, scan_age_s=0.31), relaxed).cause is Cause.NONE


def test_of_several_reasons_to_stop_the_earlier_rule_is_told() -> None:
    everything = {
        "estop": True, "estop_age_s": 9.0, "awaits_zero": True, "command": Twist(NAN, 0.0), "command_age_s": 9.0,
        "scan_age_s": 9.0,
    }  # fmt: skip
    causes = []
    for key, good in (("estop", False), ("estop_age_s", 0.0), ("awaits_zero", False), ("command_age_s", 0.0),
                      ("command", Twist(5.0, 0.0)), ("scan_age_s", 0.0)):  # fmt: skip
        causes.append(decide(given_that(**everything), config()).cause)
        everything[key] = good
    assert causes == [
        Cause.ESTOP, Cause.ESTOP_STALE, Cause.ESTOP, Cause.COMMAND_STALE, Cause.COMMAND_INVALID, Cause.SCAN_STALE,
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
        (where, way): decide(given_that(clearances=clearances, command=twist), config()).action is Action.STOP
        for where, clearances in (("ahead", ahead), ("behind", behind))
        for way, twist in (("forward", forward), ("backward", backward), ("turning", turning), ("standing", ZERO))
    }
    assert {key for key, stopped in stops.items() if stopped} == {("ahead", "forward"), ("behind", "backward")}


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_towards_an_obstacle_the_speed_falls_so_that_the_base_stands_at_the_stop_distance(sign: float) -> None:
    """Between slow-down and stop distance: v = sqrt(2 · 1 m/s² · (free way - 0.1 m))."""
    full = Twist(sign, 0.5)
    speeds = {}
    for free_m in (0.7, 0.6, 0.599, 0.35, 0.12, 0.1001, 0.1, 0.05, 0.0):
        decision = decide(given_that(command=full, clearances=free(ahead_m=free_m, behind_m=free_m)), config())
        assert decision.twist.angular_radps == pytest.approx(0.5 * abs(decision.twist.linear_mps))  # the same curve
        speeds[free_m] = (round(decision.twist.linear_mps * sign, 4), decision.action, decision.cause)
    slow, stop = (Action.SLOW, Cause.OBSTACLE_NEAR), (Action.STOP, Cause.OBSTACLE)
    assert speeds == {
        0.7: (1.0, Action.PASS, Cause.NONE),
        0.6: (1.0, Action.PASS, Cause.NONE),
        0.599: (0.999, *slow),
        0.35: (0.7071, *slow),
        0.12: (0.2, *slow),
        0.1001: (0.0141, *slow),
        0.1: (0.0, *stop),
        0.05: (0.0, *stop),
        0.0: (0.0, *stop),
    }


def test_slowing_begins_before_the_slow_down_distance_when_the_ordinary_ramp_needs_it() -> None:
    gentle = dataclasses.replace(config(), limits=LIMITS.model_copy(update={"deceleration_mps2": 0.5}))
    decision = decide(given_that(command=Twist(1.0, 0.0), clearances=free(ahead_m=0.7)), gentle)
    assert decision.twist.linear_mps == pytest.approx(math.sqrt(2 * 0.5 * 0.6))


def test_a_speed_below_standstill_is_a_stop_so_that_nobody_creeps_for_ever() -> None:
    creep_m = 0.1 + STANDSTILL_MPS**2 / 2
    just_more = decide(given_that(clearances=free(ahead_m=creep_m + 1e-9)), config())
    just_less = decide(given_that(clearances=free(ahead_m=creep_m - 1e-9)), config())
    assert (just_more.action, just_less.action) == (Action.SLOW, Action.STOP)


def test_the_way_driven_since_the_scan_is_counted() -> None:
    """0.5 m free beyond the stop distance, ramp 1 m/s², scan 0.2 s old: v · 0.2 s + v² / 2 = 0.5 m."""
    decision = decide(given_that(command=Twist(1.0, 0.0), clearances=free(ahead_m=0.6), scan_age_s=0.2), config())
    speed_mps = decision.twist.linear_mps
    assert speed_mps * 0.2 + speed_mps**2 / 2 == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("twist", "around_m", "action"),
    [
        (Twist(0.0, 0.5), 0.05, Action.STOP),
        (Twist(0.0, -0.5), 0.1, Action.STOP),
        (Twist(0.0, 2.0), 0.15, Action.SLOW),
        (Twist(0.0, 0.5), 0.15, Action.PASS),
        (Twist(0.2, 0.5), 0.05, Action.STOP),  # centre of the turn inside the swept circle
        (Twist(-0.2, 0.5), 0.05, Action.STOP),
        (Twist(0.25, 0.5), 0.05, Action.PASS),  # on the circle: counts as straight
        (Twist(0.2, 0.0), 0.05, Action.PASS),
    ],
)
def test_turning_stops_for_what_the_corners_would_hit(twist: Twist, around_m: float, action: Action) -> None:
    assert decide(given_that(command=twist, clearances=free(around_m=around_m)), config()).action is action


def test_a_turn_is_slowed_by_the_ordinary_ramp_of_the_farthest_corner() -> None:
    """4 rad/s² at 0.5 m are 2 m/s²; 0.05 m of free way more than the stop distance: sqrt(0.2) m/s at the corner."""
    decision = decide(given_that(command=Twist(0.0, -2.0), clearances=free(around_m=0.15)), config())
    assert decision.twist.angular_radps == pytest.approx(-math.sqrt(0.2) / 0.5)


def test_ceiling_and_obstacle_together_tell_the_more_severe_and_order_the_slower() -> None:
    decision = decide(given_that(command=Twist(4.0, 0.0), clearances=free(ahead_m=0.35)), config())
    assert (decision.action, decision.cause) == (Action.SLOW, Cause.OBSTACLE_NEAR)
    assert decision.twist.linear_mps == pytest.approx(math.sqrt(0.5))
    far = decide(given_that(command=Twist(4.0, 0.0), clearances=free(ahead_m=0.6)), config())
    assert (far.action, far.twist.linear_mps) == (Action.LIMIT, 1.0)


def test_how_long_the_ordinary_ramp_takes() -> None:
    assert braking_time_s(Twist(-1.0, 0.0), LIMITS) == 0.5
    assert braking_time_s(Twist(0.1, -2.0), LIMITS) == 0.5
    assert braking_time_s(ZERO, LIMITS) == 0.0


def fed(now: float, twist: Twist, *, pressed: bool = False, the_filter: SafetyFilter | None = None) -> SafetyFilter:
    """A filter that has just received everything it needs."""
    made = the_filter or SafetyFilter(config())
    made.on_command(twist, now)
    made.on_scan(FREE, now)
    made.on_estop(pressed, now)
    return made


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
    safety.on_scan(FREE, 0.51)
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
    safety.on_scan(FREE, 0.2)
    assert safety.decide(0.2).cause is Cause.NONE


def test_without_an_emergency_stop_nothing_waits_for_a_zero_command() -> None:
    safety = SafetyFilter(config(scan=False, estop=False))
    safety.on_command(Twist(0.5, 0.0), 0.0)
    assert safety.decide(0.0).twist == Twist(0.5, 0.0)


def test_a_filter_that_starts_stopped_begins_no_stop() -> None:
    safety = SafetyFilter(config())
    safety.on_command(Twist(0.5, 0.0), 0.0)
    assert safety.begins_stop(safety.decide(0.0)) is False


def test_a_stop_begins_once_and_only_for_a_command_to_move() -> None:
    drive = Twist(0.5, 0.0)
    safety = fed(0.0, ZERO)
    begins = [safety.begins_stop(safety.decide(0.0))]
    fed(0.1, drive, the_filter=safety)
    begins.append(safety.begins_stop(safety.decide(0.1)))
    safety.on_scan(free(ahead_m=0.0), 0.15)
    begins += [safety.begins_stop(safety.decide(0.15)), safety.begins_stop(safety.decide(0.16))]
    fed(0.2, ZERO, the_filter=safety)
    begins += [safety.begins_stop(safety.decide(0.2)), safety.begins_stop(safety.decide(0.45))]
    assert begins == [False, False, True, False, False, False]


numbers = st.floats() | st.floats(-3.0, 3.0) | st.sampled_from([0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 5e-324])
ages_s = st.none() | st.floats(0.0, 1.0) | st.sampled_from([0.2, 0.3, 0.5])
ways_m = st.floats(0.0, 2.0) | st.sampled_from([0.0, 0.1, 0.6, INF])
all_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, numbers, numbers),
    command_age_s=ages_s,
    clearances=st.builds(Clearances, ways_m, ways_m, ways_m),
    scan_age_s=ages_s,
    estop=st.booleans(),
    estop_age_s=ages_s,
    awaits_zero=st.booleans(),
)
moving_inputs = st.builds(
    Inputs,
    command=st.builds(Twist, numbers.filter(math.isfinite), numbers.filter(math.isfinite)),
    command_age_s=st.floats(0.0, 0.2),
    clearances=st.builds(Clearances, ways_m, ways_m, ways_m),
    scan_age_s=st.floats(0.0, 0.3),
    estop=st.just(False),
    estop_age_s=st.floats(0.0, 0.5),
    awaits_zero=st.just(False),
)
configs = st.builds(lambda scan, estop: config(scan=scan, estop=estop), st.booleans(), st.booleans())


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
            abs(ordered) <= abs(asked) and math.copysign(1.0, ordered) == math.copysign(1.0, asked)
        )


@given(inputs=all_inputs, settings=configs)
def test_it_stops_whenever_a_required_input_is_stale_or_the_emergency_stop_holds(
    inputs: Inputs, settings: FilterConfig
) -> None:
    stale = [
        inputs.command_age_s is None or inputs.command_age_s > 0.2,
        settings.safety.scan.required and (inputs.scan_age_s is None or inputs.scan_age_s > 0.3),
        settings.safety.estop.required and (inputs.estop_age_s is None or inputs.estop_age_s > 0.5),
        inputs.estop,
        inputs.awaits_zero,
        not inputs.command.is_finite,
    ]
    decision = decide(inputs, settings)
    assert decision.action is Action.STOP or not any(stale)
    assert decision.twist == ZERO or decision.action is not Action.STOP
    assert (decision.cause is Cause.NONE) == (decision.action is Action.PASS)


@given(inputs=moving_inputs)
def test_from_every_ordered_speed_the_base_can_stand_before_the_stop_distance(inputs: Inputs) -> None:
    order, clearances = decide(inputs, config()).twist, inputs.clearances
    way_m = clearances.ahead_m if order.linear_mps > 0.0 else clearances.behind_m
    speed_mps = abs(order.linear_mps)
    needed_m = speed_mps**2 / (2 * LIMITS.deceleration_mps2)
    assert speed_mps == 0.0 or needed_m <= (way_m - 0.1) * (1 + 1e-9)


@given(inputs=all_inputs, settings=configs)
def test_zero_is_always_allowed(inputs: Inputs, settings: FilterConfig) -> None:
    assert decide(dataclasses.replace(inputs, command=ZERO), settings).twist == ZERO


@given(gap_m=st.floats(-1.0, 10.0), age_s=st.floats(0.0, 0.3))
def test_the_approach_speed_uses_the_gap_up(gap_m: float, age_s: float) -> None:
    speed_mps = approach_speed_mps(gap_m, age_s, 2.0)
    assert speed_mps * age_s + speed_mps**2 / 4.0 == pytest.approx(max(gap_m, 0.0), abs=1e-9)
