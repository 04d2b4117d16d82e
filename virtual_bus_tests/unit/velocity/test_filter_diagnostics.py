"""The entry of safety_filter in /diagnostics: levels and sentences."""

from __future__ import annotations

import math

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus

from canbase_runtime.stop_cause import StopCause
from canbase_velocity.decision import Action, Decision
from canbase_velocity.estop import EstopState
from canbase_velocity.filter_diagnostics import diagnostics
from canbase_velocity.safety_filter import Inputs
from canbase_velocity.twist import Twist
from support.filter_inputs import given_that, scanned

STAMP = Time(sec=1_700_000_000)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
PASS = Decision(Action.PASS, StopCause.NONE, "", "", Twist(0.4, 0.1))


def entry(decision: Decision = PASS, known: Inputs | None = None, *, lost: int = 0, new: int = 0) -> DiagnosticStatus:
    (status,) = diagnostics(decision, known or given_that(), "r1", lost, new, STAMP).status
    return status


def test_commands_that_pass_are_fine() -> None:
    status = entry()
    assert (status.name, status.hardware_id) == ("r1: safety_filter", "r1")
    assert (status.level, status.message) == (OK, "Commands pass.")
    values = {pair.key: pair.value for pair in status.values}
    assert values["ordered [m/s]"] == "0.4"
    assert values["emergency stop"] == "free"
    assert values["scanner scan"].startswith("last scan ")


@pytest.mark.parametrize(
    ("action", "cause", "level"),
    [
        (Action.LIMIT, StopCause.SPEED, OK),
        (Action.SLOW, StopCause.OBSTACLE_NEAR, OK),
        (Action.STOP, StopCause.OBSTACLE, WARN),
        (Action.STOP, StopCause.ESTOP, WARN),
        (Action.STOP, StopCause.SHUTDOWN, WARN),
        (Action.STOP, StopCause.ESTOP_STALE, ERROR),
        (Action.STOP, StopCause.COMMAND_STALE, ERROR),
        (Action.STOP, StopCause.SCAN_STALE, ERROR),
        (Action.STOP, StopCause.SCAN_BLIND, ERROR),
    ],
)
def test_a_stop_that_is_right_warns_and_what_does_not_work_is_an_error(
    action: Action, cause: StopCause, level: bytes
) -> None:
    status = entry(Decision(action, cause, "with values.", "its end", Twist(0.0, 0.0)))
    assert status.level == level
    assert status.message.endswith(f" ({cause.value}): with values. It ends with: its end.")


def test_a_required_scanner_that_died_is_an_error_also_while_nothing_is_ordered() -> None:
    for dead in (scanned(0.9), scanned(math.inf), scanned(0.1, problem="tf_static does not know laser")):
        assert entry(known=given_that(scans=dead)).level == ERROR
    assert "tf_static does not know laser" in entry(known=given_that(scans=dead)).message
    assert entry(known=given_that(scans=scanned(0.9, required=False))).level == OK


def test_an_emergency_stop_that_waits_is_a_warning_whatever_the_order_is() -> None:
    status = entry(known=given_that(estop=EstopState.AWAITS_RESET))
    assert (status.level, status.message) == (
        WARN,
        "Commands pass. The emergency stop is released, waits for a reset.",
    )


def test_a_stop_button_that_cannot_be_trusted_is_a_warning() -> None:
    assert entry(known=given_that(estop_crowd="2 nodes publish it")).message == "Commands pass. 2 nodes publish it."
    assert entry(known=given_that(estop_unarmed="the disk is full")).level == WARN


def test_leases_that_are_lost_warn_while_their_count_grows() -> None:
    assert entry(lost=3, new=2).level == WARN
    assert entry(lost=3, new=2).message.endswith("2 more leases that the watchdog did not get.")
    assert entry(lost=3).level == OK
