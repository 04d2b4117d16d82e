"""The table of causes: each row alone, the order among them, and which of them count during a stop."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from canbase.action import DriveDistance

from canbase_action_server.causes import ARRIVED, TABLE, EndCause, Situation, cause_while_driving, cause_while_stopping
from canbase_action_server.inputs import Inputs
from canbase_action_server.outcome import ErrorCode, Status
from canbase_action_server.state_topics import States
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import Received
from canbase_runtime.stop_cause import StopCause
from canbase_runtime.watchdog_view import WatchdogView
from support.action_plant import GOOD_DRIVER, GOOD_MUX, GOOD_SAFETY, Plant, bench_robot, good_inputs, replaced, value

ROBOT = bench_robot()
READY = good_inputs(Plant().odometry(10.0))
GOOD = Situation(
    robot=ROBOT,
    inputs=READY,
    states=States.at(ROBOT, READY, 10.0),
    now_s=10.0,
    own_source="action",
    gap_s=0.02,
    odometry_jumped=False,
    pose_was_reset=False,
    off_course="",
    stopped_s=0.0,
    stopped_patience_s=0.3,
    no_progress_s=0.0,
    progress_timeout_s=2.0,
    running_s=0.0,
    overall_timeout_s=20.0,
)


def with_inputs(situation: Situation, **changes: object) -> Situation:
    return at(situation, replaced(situation.inputs, 10.0, **changes))


def at(situation: Situation, inputs: Inputs, now_s: float = 10.0) -> Situation:
    return replace(situation, inputs=inputs, states=States.at(ROBOT, inputs, now_s), now_s=now_s)


def aged(situation: Situation, name: str, age_s: float) -> Situation:
    """Its last message is so old."""
    return with_inputs(situation, **{name: replace(getattr(situation.inputs, name), received_at_s=10.0 - age_s)})


Provoke = Callable[[Situation], Situation]
PROVOKED: dict[ErrorCode, Provoke] = {
    ErrorCode.ESTOP: lambda s: with_inputs(s, safety=replace(GOOD_SAFETY, estop=True)),
    ErrorCode.WATCHDOG: lambda s: with_inputs(s, driver=replace(value(s.inputs.driver), watchdog=WatchdogView.TRIPPED)),
    ErrorCode.DRIVE_FAULT: lambda s: with_inputs(s, driver=replace(value(s.inputs.driver), state=DriverState.LATCHED)),
    ErrorCode.ODOMETRY_LOST: lambda s: aged(s, "odometry", 0.21),
    ErrorCode.TAKEN_OVER: lambda s: with_inputs(s, mux=replace(GOOD_MUX, active="joystick")),
    ErrorCode.SCAN_LOST: lambda s: with_inputs(s, safety=replace(GOOD_SAFETY, cause=StopCause.SCAN_STALE)),
    ErrorCode.BLOCKED: lambda s: replace(s, stopped_s=0.3),
    ErrorCode.CANCELED: lambda s: with_inputs(s, cancel_requested=True),
    ErrorCode.PREEMPTED: lambda s: with_inputs(s, preempted=True),
    ErrorCode.CLIENT_LOST: lambda s: with_inputs(s, client_lost=True),
    ErrorCode.SHUTDOWN: lambda s: with_inputs(s, shutdown=True),
    ErrorCode.NO_PROGRESS: lambda s: replace(s, no_progress_s=2.01),
    ErrorCode.TIMEOUT: lambda s: replace(s, running_s=20.01),
}


OFF_COURSE = "0.061 m beside the line and turned away by 0.210 rad"
ROWS: list[tuple[ErrorCode, Provoke]] = list(PROVOKED.items())
ROWS[5:5] = [
    (ErrorCode.DRIVE_FAULT, lambda s: replace(s, off_course=OFF_COURSE)),
    (ErrorCode.DRIVE_FAULT, lambda s: aged(s, "driver", 0.31)),
    (ErrorCode.ESTOP, lambda s: aged(s, "safety", 0.31)),
    (ErrorCode.TAKEN_OVER, lambda s: aged(s, "mux", 0.31)),
]
"""One way to provoke each row, in the order of the table."""


def row(place: int) -> EndCause:
    """The cause so far is this row."""
    return EndCause(TABLE[place].code, "so far", place)


def test_nothing_wrong_is_no_cause() -> None:
    assert cause_while_driving(GOOD) is None
    almost = replace(GOOD, gap_s=0.2, stopped_s=0.299, no_progress_s=2.0, running_s=20.0)
    for name, age_s in (("odometry", 0.2), ("driver", 0.3), ("safety", 0.3), ("mux", 0.3)):
        almost = aged(almost, name, age_s - 1e-9)
    assert cause_while_driving(almost) is None
    assert cause_while_driving(with_inputs(GOOD, mux=replace(GOOD_MUX, active="action"))) is None
    assert cause_while_driving(with_inputs(GOOD, mux=replace(GOOD_MUX, active=""))) is None


@pytest.mark.parametrize(("code", "provoke"), ROWS)
def test_each_row_alone(code: ErrorCode, provoke: Provoke) -> None:
    cause = cause_while_driving(provoke(GOOD))
    assert cause is not None
    assert cause.code is code
    assert len(cause.message) > 15


def test_the_table_is_in_this_order() -> None:
    assert [row.code for row in TABLE] == [code for code, _ in ROWS]


@pytest.mark.parametrize("place", range(len(TABLE) - 1))
def test_of_two_that_hold_the_upper_one_wins(place: int) -> None:
    (upper, provoke), (_, provoke_lower) = ROWS[place], ROWS[place + 1]
    cause = cause_while_driving(provoke(provoke_lower(GOOD)))
    assert cause is not None
    assert cause.code is upper


def test_a_pose_that_was_set_anew_is_a_loss_of_odometry_and_not_a_way_off_the_course() -> None:
    cause = cause_while_driving(replace(GOOD, pose_was_reset=True, off_course=OFF_COURSE))
    assert cause is not None
    assert cause.code is ErrorCode.ODOMETRY_LOST
    assert "was reset" in cause.message


def test_a_lock_of_the_mux_ends_a_goal_at_once_and_names_the_lock() -> None:
    cause = cause_while_driving(with_inputs(GOOD, mux=replace(GOOD_MUX, held_back="locked: pause holds")))
    assert cause is not None
    assert cause.code is ErrorCode.BLOCKED
    assert cause.message == ("velocity_mux holds action back: locked: pause holds; unlock it and send a new goal")


def test_a_base_off_its_course_is_still_stopped_by_a_trip() -> None:
    tripped = replace(PROVOKED[ErrorCode.WATCHDOG](GOOD), off_course=OFF_COURSE)
    cause = cause_while_stopping(tripped, row(5))
    assert cause is not None
    assert cause.code is ErrorCode.WATCHDOG
    assert cause_while_stopping(replace(GOOD, off_course=OFF_COURSE), row(5)) is None


@pytest.mark.parametrize(
    ("status_at_s", "leads_to"), [(9.88, "hangs, has ended"), (9.91, "the feedback of the drives")]
)
def test_lost_odometry_leads_to_the_driver_or_to_its_drives(status_at_s: float, leads_to: str) -> None:
    """odom came at 9.79 s; a status that came well after it shows that the driver runs."""
    lost = PROVOKED[ErrorCode.ODOMETRY_LOST](with_inputs(GOOD, driver=Received(GOOD_DRIVER, status_at_s)))
    cause = cause_while_driving(lost)
    assert cause is not None
    assert leads_to in cause.message
    assert "`canbase doctor`" in cause.message


def test_a_jump_of_the_odometry_is_a_loss_of_it() -> None:
    cause = cause_while_driving(replace(GOOD, odometry_jumped=True))
    assert cause is not None
    assert cause.code is ErrorCode.ODOMETRY_LOST


@pytest.mark.parametrize(("gap_s", "lost"), [(0.2, False), (0.201, True), (3.0, True)])
def test_a_server_that_stood_still_trusts_no_fresh_odometry(gap_s: float, lost: bool) -> None:
    cause = cause_while_driving(replace(GOOD, gap_s=gap_s))
    assert (cause is not None) == lost
    assert [found.code for found in (cause,) if found] == [ErrorCode.ODOMETRY_LOST] * lost


STOPPING = {ErrorCode.ESTOP, ErrorCode.WATCHDOG, ErrorCode.DRIVE_FAULT, ErrorCode.ODOMETRY_LOST, ErrorCode.TAKEN_OVER,
            ErrorCode.CANCELED, ErrorCode.SHUTDOWN}  # fmt: skip


@pytest.mark.parametrize(("code", "provoke"), ROWS)
def test_during_the_stop_of_a_goal_that_arrived_only_some_rows_count(code: ErrorCode, provoke: Provoke) -> None:
    cause = cause_while_stopping(provoke(GOOD), ARRIVED)
    assert (cause is not None) == (code in STOPPING)


def test_during_a_stop_only_an_upper_row_replaces_the_cause() -> None:
    tripped = PROVOKED[ErrorCode.WATCHDOG](PROVOKED[ErrorCode.DRIVE_FAULT](GOOD))
    cause = cause_while_stopping(tripped, row(5))
    assert cause is not None
    assert cause.code is ErrorCode.WATCHDOG
    assert cause_while_stopping(tripped, row(1)) is None
    assert cause_while_stopping(PROVOKED[ErrorCode.CANCELED](GOOD), row(10)) is None


def test_codes_are_those_of_the_interface() -> None:
    assert {code.name: code.value for code in ErrorCode} == {
        code.name: getattr(DriveDistance.Result, code.name) for code in ErrorCode
    }


def test_only_arriving_succeeds_and_only_a_cancel_is_canceled() -> None:
    assert {code for code in ErrorCode if code.status is Status.SUCCEEDED} == {ErrorCode.OK}
    assert {code for code in ErrorCode if code.status is Status.CANCELED} == {ErrorCode.CANCELED}
