"""The emergency stop in the safety filter over time, told as stories with times [s]."""

from __future__ import annotations

import pytest

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_state import SafetyFilter
from canbase_velocity.twist import ZERO, Twist
from support.filter_inputs import config, fed, see


def test_a_filter_that_received_nothing_stops() -> None:
    decision = SafetyFilter(config()).decide(0.0)
    assert (decision.action, decision.cause) == (Action.STOP, StopCause.ESTOP_STALE)


def test_after_the_emergency_stop_is_released_the_command_has_to_be_zero_once() -> None:
    drive = Twist(0.5, 0.0)
    safety = fed(0.0, ZERO)
    assert safety.decide(0.0).cause is StopCause.NONE  # the required topic began with a zero command
    fed(1.0, drive, the_filter=safety)
    assert safety.decide(1.0).twist == drive
    fed(1.1, drive, pressed=True, the_filter=safety)
    assert safety.decide(1.1).cause is StopCause.ESTOP
    fed(1.2, ZERO, pressed=True, the_filter=safety)  # a zero while it is pressed does not count
    assert safety.decide(1.2).cause is StopCause.ESTOP
    fed(1.3, drive, the_filter=safety)  # released, the joystick still pushed
    assert (safety.decide(1.3).cause, safety.decide(1.3).twist) == (StopCause.ESTOP, ZERO)
    fed(1.4, ZERO, the_filter=safety)
    assert (safety.decide(1.4).action, safety.decide(1.4).cause) == (Action.PASS, StopCause.NONE)
    fed(1.5, drive, the_filter=safety)
    assert safety.decide(1.5).twist == drive


def test_a_short_press_between_two_decisions_is_not_missed() -> None:
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    safety.accept_command(Twist(0.5, 0.0), 0.1)
    safety.on_estop(True, 0.101)
    safety.on_estop(False, 0.102)
    assert safety.decide(0.103).cause is StopCause.ESTOP


def test_a_required_emergency_stop_that_was_silent_needs_a_zero_command_too() -> None:
    drive = Twist(0.5, 0.0)
    safety = fed(0.0, ZERO)
    safety.decide(0.0)
    safety.accept_command(drive, 0.51)
    see(safety, 0.51)
    assert safety.decide(0.51).cause is StopCause.ESTOP_STALE
    fed(0.6, drive, the_filter=safety)
    assert safety.decide(0.6).cause is StopCause.ESTOP
    fed(0.7, ZERO, the_filter=safety)
    assert safety.decide(0.7).cause is StopCause.NONE


def test_a_stale_zero_command_does_not_free_the_emergency_stop() -> None:
    safety = fed(0.0, ZERO, pressed=True)
    safety.decide(0.0)
    safety.on_estop(False, 0.3)
    assert safety.decide(0.3).cause is StopCause.ESTOP  # the zero is 0.3 s old, its timeout 0.2 s
    safety.accept_command(Twist(0.5, 0.0), 0.31)
    assert safety.decide(0.31).cause is StopCause.ESTOP


def test_the_zero_command_counts_until_exactly_its_timeout() -> None:
    safety = fed(0.0, ZERO, pressed=True)
    safety.on_estop(False, 0.2)
    see(safety, 0.2)
    assert safety.decide(0.2).cause is StopCause.NONE


def test_without_an_emergency_stop_nothing_waits_for_a_zero_command() -> None:
    safety = SafetyFilter(config(scan=False, estop=False))
    safety.accept_command(Twist(0.5, 0.0), 0.0)
    assert safety.decide(0.0).twist == Twist(0.5, 0.0)


def latched(now_s: float, twist: Twist) -> SafetyFilter:
    """A filter whose emergency stop needs a reset; it was heard released, and `twist` is ordered."""
    safety = fed(now_s, ZERO, the_filter=SafetyFilter(config(latched=True)))
    assert safety.decide(now_s).cause is StopCause.NONE  # at the start nothing has to be reset
    return fed(now_s, twist, the_filter=safety)


def test_without_an_emergency_stop_a_reset_is_refused_too_while_a_source_orders_a_velocity() -> None:
    """The driver hears the zeros behind the filter alone, and a stick may be held that is not followed."""
    done, sentence = latched(0.0, ZERO).reset(("joystick",), 0.0)
    assert (done, sentence.split(";")[0]) == (False, "refused: joystick orders a velocity")


def test_a_latched_emergency_stop_needs_a_reset_after_its_release() -> None:
    safety = latched(0.0, Twist(0.5, 0.0))
    assert safety.reset((), 0.0) == (True, "The emergency stop is not latched: nothing to reset")
    fed(0.1, ZERO, pressed=True, the_filter=safety)
    assert safety.decide(0.1).cause is StopCause.ESTOP
    assert safety.reset((), 0.1) == (False, "refused: the emergency stop on estop_state is pressed")
    fed(0.2, ZERO, the_filter=safety)
    assert (safety.decide(0.2).clears_on, safety.estop) == ("reset", EstopState.AWAITS_RESET)
    fed(0.3, Twist(0.5, 0.0), the_filter=safety)
    assert safety.reset((), 0.3)[0] is False  # the driving source is not zero
    fed(0.4, ZERO, the_filter=safety)
    done, sentence = safety.reset(("navigation",), 0.4)  # another one is not, it would drive next
    assert (done, sentence.split(";")[0]) == (False, "refused: navigation orders a velocity")
    assert safety.decide(0.4).cause is StopCause.ESTOP
    assert safety.reset((), 0.4)[0] is True
    assert safety.decide(0.4).cause is StopCause.NONE
    fed(0.5, Twist(0.5, 0.0), the_filter=safety)
    assert safety.decide(0.5).twist == Twist(0.5, 0.0)


def test_a_silence_of_the_stop_button_is_latched_once_it_was_heard() -> None:
    safety = latched(0.0, ZERO)
    safety.accept_command(ZERO, 0.6)
    see(safety, 0.6)
    assert safety.decide(0.6).cause is StopCause.ESTOP_STALE
    assert safety.reset((), 0.6) == (False, "refused: the emergency stop on estop_state is not published")
    fed(0.7, ZERO, the_filter=safety)
    assert (safety.decide(0.7).cause, safety.estop) == (StopCause.ESTOP, EstopState.AWAITS_RESET)


@pytest.mark.parametrize("state", list(EstopState))
def test_a_press_holds_from_every_state(state: EstopState) -> None:
    safety = latched(0.0, Twist(0.5, 0.0))
    safety._estop.state = state
    fed(0.1, ZERO, pressed=True, the_filter=safety)
    decision = safety.decide(0.1)
    assert (decision.cause, decision.twist, decision.emergency) == (StopCause.ESTOP, ZERO, True)
    assert safety.estop is EstopState.HELD
