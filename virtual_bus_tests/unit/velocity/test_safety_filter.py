"""What the safety filter lets through: reasons to stop, and which of them is told."""

from __future__ import annotations

import math
from typing import Any

import pytest
from canbase.msg import SafetyState

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action
from canbase_velocity.estop import EstopState
from canbase_velocity.safety_filter import decide
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import GOOD, HELD, INF, NAN, config, free, given_that, scanned


def test_with_all_well_a_command_goes_through_as_it_came() -> None:
    decision = decide(GOOD, config())
    assert decision.twist == GOOD.command
    assert (decision.action, decision.cause, decision.detail, decision.clears_on) == (
        Action.PASS,
        StopCause.NONE,
        "",
        "",
    )


def test_actions_and_causes_are_those_of_the_message() -> None:
    assert [action.value for action in Action] == [
        SafetyState.PASS,
        SafetyState.LIMIT,
        SafetyState.SLOW,
        SafetyState.STOP,
    ]
    constants = {getattr(SafetyState, name) for name in dir(SafetyState) if name.startswith("CAUSE_")}
    assert {cause.value for cause in StopCause} - {StopCause.UNKNOWN.value} == constants


@pytest.mark.parametrize(
    ("changes", "cause", "words"),
    [
        ({"command_age_s": math.inf}, StopCause.COMMAND_STALE, "nothing received on cmd_vel_mux yet"),
        ({"command_age_s": 0.25}, StopCause.COMMAND_STALE, "no message on cmd_vel_mux for 0.25 s (timeout 0.20 s)"),
        ({"command": Twist(NAN, 0.0)}, StopCause.COMMAND_INVALID, "cmd_vel_mux carries"),
        ({"command": Twist(0.0, INF)}, StopCause.COMMAND_INVALID, "cmd_vel_mux carries"),
        ({"scans": scanned(math.inf)}, StopCause.SCAN_STALE, "nothing received on scan yet"),
        ({"scans": scanned(0.35)}, StopCause.SCAN_STALE, "no message on scan for 0.35 s (timeout 0.30 s)"),
        ({"scans": scanned(0.0, problem="tf_static is empty")}, StopCause.SCAN_UNPLACED, "scan: tf_static is empty"),
        (HELD | {"pressed": True}, StopCause.ESTOP, "the emergency stop is pressed"),
        (HELD | {"estop_age_s": math.inf}, StopCause.ESTOP_STALE, "nothing received on estop_state yet"),
        (HELD | {"estop_age_s": 0.6}, StopCause.ESTOP_STALE, "no message on estop_state for 0.60 s (timeout 0.50 s)"),
        ({"estop": EstopState.AWAITS_ZERO}, StopCause.ESTOP, "has not been zero since"),
        ({"estop": EstopState.AWAITS_RESET}, StopCause.ESTOP, "waits for a reset"),
        ({"sight": free(ahead_m=0.05)}, StopCause.OBSTACLE, "0.05 m free ahead, stop distance 0.10 m"),
    ],
)
def test_each_reason_to_stop_has_its_cause_and_says_what_ends_it(
    changes: dict[str, Any], cause: StopCause, words: str
) -> None:
    decision = decide(given_that(**changes), config())
    assert (decision.action, decision.cause, decision.twist) == (Action.STOP, cause, ZERO)
    assert words in decision.detail
    assert decision.clears_on != ""


@pytest.mark.parametrize(
    ("changes", "timeout_s", "cause"),
    [
        (lambda age_s: {"command_age_s": age_s}, 0.2, StopCause.COMMAND_STALE),
        (lambda age_s: {"scans": scanned(age_s)}, 0.3, StopCause.SCAN_STALE),
    ],
)
def test_an_input_is_fresh_until_exactly_its_timeout(changes: Any, timeout_s: float, cause: StopCause) -> None:
    assert decide(given_that(**changes(timeout_s)), config()).cause is StopCause.NONE
    assert decide(given_that(**changes(math.nextafter(timeout_s, INF))), config()).cause is cause


def test_what_is_not_required_may_be_silent() -> None:
    silent = given_that(scans=scanned(math.inf, required=False), estop_age_s=math.inf)
    assert decide(silent, config(scan=False, estop=False)).twist == GOOD.command
    unplaced = given_that(scans=scanned(math.inf, required=False, problem="tf_static is empty"))
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
        StopCause.ESTOP,
        StopCause.ESTOP_STALE,
        StopCause.COMMAND_STALE,
        StopCause.COMMAND_INVALID,
        StopCause.SCAN_STALE,
    ]
    assert decide(given_that(**everything), config()).cause is StopCause.SPEED


def test_only_a_held_emergency_stop_brakes_hard_of_the_reasons_to_stop() -> None:
    moving = {"motion": Twist(1.0, 0.0)}
    assert decide(given_that(**HELD, **moving), config()).emergency is True
    assert decide(given_that(scans=scanned(9.0), **moving), config()).emergency is False
    assert decide(given_that(estop=EstopState.AWAITS_RESET, **moving), config()).emergency is False
