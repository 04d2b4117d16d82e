"""The table of checks: each row trips just when its time is over, and only while somebody could move."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from canbase_base.latch_record import Defect, Found, Mark, Record
from canbase_watchdog.envelope import Bounds
from canbase_watchdog.frames import DriveState
from canbase_watchdog.lease import Lease
from canbase_watchdog.policy import CHECKS, Check, decide, next_expiry, stands
from canbase_watchdog.power_and_motion import commanded, in_motion, is_off, moving, near_power, velocity_ordered
from canbase_watchdog.trip_cause import (
    FINE,
    SENSOR_CAUSES,
    TripCause,
    Verdict,
    before_the_start,
    code_of,
    has_opened,
)
from canbase_watchdog.view import NEVER, Node, View
from support.watchdog_views import AT_REST, CONFIG, LEFT, NOW, OFF, RIGHT, WELL, cause, of, well


def test_ordinary_driving_does_not_trip() -> None:
    assert decide(WELL, CONFIG, NOW) == FINE


def test_one_row_for_each_cause_that_the_bus_can_show() -> None:
    assert sorted(check.cause for check in CHECKS) == [*range(1, 11), *range(12, 19)]


def test_causes_have_the_numbers_of_the_state_frame() -> None:
    """docs/bus.md, byte 1 of 1FEh. What is not in CHECKS: none, and a watchdog that ended."""
    others = {cause.name: cause.value for cause in TripCause if cause not in {check.cause for check in CHECKS}}
    assert others == {"NONE": 0, "ENDED": 11, "POWER_AT_END": 20, "RECORD_UNUSABLE": 21}


def test_a_node_is_found_by_its_id_wherever_it_stands() -> None:
    one, two = Node(1, 99.0), Node(2, 98.0)
    assert well(nodes=(two, one)).node(1) is one
    with pytest.raises(StopIteration):
        WELL.node(3)


@pytest.mark.parametrize("check", [check for check in CHECKS if check.by_bus], ids=lambda check: check.cause.name)
def test_what_is_judged_once_a_frame_depends_on_the_bus_alone(check: Check) -> None:
    """Otherwise it would be found late."""
    bad = {"overspeed_samples": 9, "outside_samples": 9, "implausible_samples": 9}
    axis = replace(
        LEFT,
        feedback=replace(LEFT.feedback, **bad),
        evidence=replace(LEFT.evidence, unseen=True),
        torque=replace(LEFT.torque, overdue_s=9.0),
        missed_setpoints=1e6,
        double_answers=1e6,
    )
    seen = of(axis, RIGHT)
    changes: dict[str, Any] = {"lease_at": NEVER, "bus_failed_since": 0.0, "tick_gap_s": 9.0, "twist": "far off"}
    causes = {
        check.trips(view, CONFIG, now_s).cause
        for view in (seen, replace(seen, bounds=Bounds(0.0, 0.0, 0.0, 0.0), **changes))
        for now_s in (0.0, NOW, NOW + 100.0)
    }
    assert causes == {check.cause}
    assert check.trips(WELL, CONFIG, NOW + 100.0) == FINE


def test_a_bus_that_was_fine_is_judged_again_by_what_depends_on_more() -> None:
    fast = of(replace(LEFT, feedback=replace(LEFT.feedback, overspeed_samples=9)), RIGHT)
    assert decide(fast, CONFIG, NOW, WELL.bus).cause is TripCause.OVERSPEED, "another bus"
    assert decide(fast, CONFIG, NOW, fast.bus) == FINE
    late = replace(fast, lease_at=NOW - 1.0)
    assert decide(late, CONFIG, NOW, late.bus).cause is TripCause.LEASE_LOST


def test_what_has_not_ticked_yet_is_not_late() -> None:
    assert WELL.tick_gap_s == 0.0


# --- lease lost


@pytest.mark.parametrize(("age_s", "trips"), [(0.249, 0), (0.2499, 0), (0.2501, 1), (0.251, 1), (math.inf, 1)])
def test_a_moving_wheel_needs_a_lease_no_older_than_the_timeout(age_s: float, trips: int) -> None:
    assert cause(well(lease_at=NOW - age_s)) == trips


@pytest.mark.parametrize(("listening_s", "trips"), [(0.249, 0), (0.251, 1)])
def test_a_watchdog_that_just_started_gives_the_first_lease_as_long(listening_s: float, trips: int) -> None:
    assert cause(well(lease_at=NEVER, started_at=NOW - listening_s)) == trips


@pytest.mark.parametrize(
    ("velocity_mps", "target_mps", "trips"),
    [
        (0.0, 0.0, 0),
        (0.00499, 0.0, 0),
        (0.00501, 0.0, 1),
        (-0.00499, 0.0, 0),
        (-0.00501, 0.0, 1),
        (0.0, 0.001, 1),  # one bit is an order
        (0.0, -0.001, 1),
    ],
)
def test_what_counts_as_motion(velocity_mps: float, target_mps: float, trips: int) -> None:
    standing = abs(velocity_mps) <= CONFIG.standstill_mps
    axis = replace(LEFT, velocity_mps=velocity_mps, target_mps=target_mps, standing=standing)
    assert cause(of(axis, lease_at=90.0)) == trips


@pytest.mark.parametrize(
    ("state", "turns"),
    [
        (DriveState.NOT_READY_TO_SWITCH_ON, False),
        (DriveState.SWITCH_ON_DISABLED, False),
        (DriveState.READY_TO_SWITCH_ON, False),
        (DriveState.SWITCHED_ON, False),
        (DriveState.OPERATION_ENABLED, True),
        (DriveState.QUICK_STOP_ACTIVE, True),
        (DriveState.FAULT_REACTION_ACTIVE, True),
        (DriveState.FAULT, False),
        (None, False),
    ],
)
def test_only_a_wheel_under_power_moves_by_itself(state: DriveState | None, turns: bool) -> None:
    assert moving(replace(LEFT, state=state), CONFIG) is turns


@pytest.mark.parametrize(
    ("state", "asks", "silence_s", "counts"),
    [
        (DriveState.OPERATION_ENABLED, False, 0.0, True),
        (DriveState.QUICK_STOP_ACTIVE, True, 0.0, False),
        (DriveState.SWITCH_ON_DISABLED, True, 0.099, False),
        (DriveState.SWITCH_ON_DISABLED, True, 0.101, True),  # told to be on, and says nothing: it may be
        (DriveState.SWITCH_ON_DISABLED, False, 0.101, False),
        (None, True, math.inf, True),
    ],
)
def test_orders_count_for_a_drive_that_is_enabled_or_may_be(
    state: DriveState | None, asks: bool, silence_s: float, counts: bool
) -> None:
    axis = replace(LEFT, state=state, asks_for_power=asks, status_at=LEFT.command_at - silence_s)
    assert commanded(axis, CONFIG) is counts
    assert not commanded(replace(axis, target_mps=0.0), CONFIG)


def test_in_motion_names_the_wheel() -> None:
    view = of(AT_REST, RIGHT)
    assert in_motion(view, CONFIG) is RIGHT
    assert in_motion(of(AT_REST), CONFIG) is None


def test_the_sentence_has_the_values() -> None:
    verdict = decide(well(lease_at=99.7), CONFIG, NOW)
    assert verdict.detail == (
        "no valid lease for 0.300 s (allowed 0.250 s) while wheel_1_0 turns at 0.300 m/s, ordered 0.300 m/s"
    )


def test_the_sentences_about_silence_have_the_ages() -> None:
    verdict = decide(of(AT_REST, driver_at=99.5, sync_at=99.25), CONFIG, NOW)
    assert verdict.detail == (
        "driver's heartbeat is 0.500 s old, its SYNC 0.750 s (allowed 0.300 s) while wheel_1_0 has power"
    )
    verdict = decide(of(replace(AT_REST, fed_at=99.75), nodes=(Node(1, 99.5, 99.99), Node(2))), CONFIG, NOW)
    assert verdict.detail == (
        "wheel_1_0 is enabled, its feedback is 0.250 s old (allowed 0.100 s), its heartbeat 0.500 s (allowed 0.300 s)"
    )


# --- driver silent


@pytest.mark.parametrize(("age_s", "trips"), [(0.299, 0), (0.301, 2), (math.inf, 2)])
def test_an_enabled_drive_needs_the_drivers_heartbeat_and_its_sync(age_s: float, trips: int) -> None:
    assert cause(of(AT_REST, driver_at=NOW - age_s)) == trips
    assert cause(of(AT_REST, sync_at=NOW - age_s)) == trips


@pytest.mark.parametrize(("enabled_s", "trips"), [(0.299, 0), (0.301, 2)])
def test_the_driver_has_the_heartbeat_time_from_when_the_drive_was_enabled(enabled_s: float, trips: int) -> None:
    assert cause(of(replace(AT_REST, enabled_since=NOW - enabled_s), driver_at=NEVER)) == trips


@pytest.mark.parametrize(("listening_s", "trips"), [(0.299, 0), (0.301, 2)])
def test_a_watchdog_that_just_started_gives_the_driver_as_long(listening_s: float, trips: int) -> None:
    assert cause(of(AT_REST, driver_at=NEVER, started_at=NOW - listening_s)) == trips


def test_without_an_enabled_drive_nobody_needs_the_driver() -> None:
    assert cause(of(OFF, driver_at=NEVER, sync_at=NEVER)) == 0
    assert cause(of(replace(AT_REST, state=DriveState.QUICK_STOP_ACTIVE), driver_at=NEVER)) == 0


# --- an enabled drive starts anew


@pytest.mark.parametrize(("age_s", "trips"), [(0.0, 18), (0.999, 18), (1.0, 0)])
def test_a_boot_up_of_an_enabled_drive_trips_and_keeps_a_reset_away_for_a_second(age_s: float, trips: int) -> None:
    nodes = (Node(1, 99.95, 99.99), Node(2, 99.95, 99.99, NOW - age_s))
    verdict = decide(of(AT_REST, nodes=nodes), CONFIG, NOW)
    assert verdict.cause == trips
    assert cause(of(OFF, replace(OFF, drive=RIGHT.drive), nodes=nodes)) == 0
    if trips:
        assert verdict.node_id == 2
        assert verdict.detail == (
            "node 2 (wheel_2_0) sends a boot-up while it is enabled: it has restarted (supply?), "
            "or two drives have this node id"
        )
        assert stands(verdict, of(OFF, nodes=nodes), CONFIG, NOW)
        assert not stands(verdict, of(OFF, nodes=nodes), CONFIG, NOW + 1.0)


# --- drive silent


@pytest.mark.parametrize(("age_s", "trips"), [(0.099, 0), (0.101, 3)])
def test_an_enabled_drive_answers_the_syncs_with_state_and_velocity(age_s: float, trips: int) -> None:
    assert cause(of(replace(AT_REST, fed_at=NOW - age_s))) == trips


def test_feedback_may_be_old_when_syncs_are_or_have_just_begun_or_the_drive_was_just_enabled() -> None:
    unfed = replace(AT_REST, fed_at=99.8)
    assert cause(of(unfed)) == 3
    assert cause(of(unfed, sync_at=99.899)) == 0
    assert cause(of(unfed, sync_at=99.901)) == 3
    assert cause(of(unfed, sync_since=99.901)) == 0
    assert cause(of(unfed, sync_since=99.899)) == 3
    assert cause(of(replace(unfed, enabled_since=99.901))) == 0


@pytest.mark.parametrize(("age_s", "trips"), [(0.299, 0), (0.301, 3), (math.inf, 3)])
def test_an_enabled_drive_beats(age_s: float, trips: int) -> None:
    nodes = (Node(1, NOW - age_s, 99.99), Node(2, 99.95, 99.99))
    assert cause(of(AT_REST, nodes=nodes)) == trips
    assert cause(of(replace(AT_REST, enabled_since=99.701), nodes=nodes)) == 0


@pytest.mark.parametrize(("standing", "trips"), [(False, TripCause.DRIVER_SILENT), (True, TripCause.NONE)])
@pytest.mark.parametrize("state", [DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE])
def test_a_drive_that_brakes_by_itself_needs_the_driver_as_long_as_its_wheel_turns(
    state: DriveState, standing: bool, trips: TripCause
) -> None:
    """The driver dies in its own quick stop: nobody else would see whether the wheel brakes."""
    axis = replace(LEFT, state=state, standing=standing, target_mps=0.0)
    assert cause(of(axis, driver_at=NOW - 0.301)) == trips
    assert cause(of(axis, driver_at=NOW - 0.299)) == TripCause.NONE


def test_a_silent_drive_is_named() -> None:
    view = of(LEFT, replace(RIGHT, fed_at=99.0))
    assert decide(view, CONFIG, NOW).node_id == 2


def test_a_drive_that_is_off_may_be_silent() -> None:
    assert cause(of(replace(OFF, status_at=NEVER), nodes=(Node(1), Node(2)))) == 0


# --- power: near it the record on disk says so, and it is over only when fresh feedback says so


@pytest.mark.parametrize(
    ("state", "near"),
    [
        (DriveState.NOT_READY_TO_SWITCH_ON, False),
        (DriveState.SWITCH_ON_DISABLED, False),
        (DriveState.READY_TO_SWITCH_ON, False),
        (DriveState.SWITCHED_ON, True),  # the next controlword gives it power
        (DriveState.OPERATION_ENABLED, True),
        (DriveState.QUICK_STOP_ACTIVE, True),
        (DriveState.FAULT_REACTION_ACTIVE, True),
        (DriveState.FAULT, False),
        (None, False),
    ],
)
def test_near_power_is_power_the_step_before_it_and_the_order_to_have_it(state: DriveState | None, near: bool) -> None:
    axis = replace(OFF, state=state)
    assert near_power(axis) is near
    assert near_power(replace(axis, asks_for_power=True))
    assert is_off(axis, of(axis), CONFIG, NOW) is (not near and state is not None)
    assert not is_off(replace(axis, asks_for_power=True), of(axis), CONFIG, NOW)


@pytest.mark.parametrize(("age_s", "off"), [(0.0, True), (0.099, True), (0.101, False), (math.inf, False)])
def test_old_feedback_does_not_say_that_the_power_is_off(age_s: float, off: bool) -> None:
    axis = replace(OFF, status_at=NOW - age_s)
    assert is_off(axis, of(axis), CONFIG, NOW) is off


def test_a_drive_that_was_never_heard_of_is_not_there_unless_it_is_told_to_have_power() -> None:
    axis = replace(OFF, state=None, status_at=NEVER)
    nobody, silent = (Node(1), Node(2)), (Node(1, NEVER, 90.0), Node(2))
    assert is_off(axis, of(axis, nodes=nobody), CONFIG, NOW)
    assert not is_off(axis, of(axis, nodes=silent), CONFIG, NOW)
    assert not is_off(replace(axis, asks_for_power=True), of(axis, nodes=nobody), CONFIG, NOW)


# --- what was before the start


@pytest.mark.parametrize(
    ("past", "verdict"),
    [
        (Found(), FINE),
        (Found(Record(Mark.CLEAR, 0x0206, "", "too fast")), FINE),
        (
            Found(Record(Mark.LIVE, 0x0206, "", "too fast")),
            Verdict(TripCause.POWER_AT_END, 0, "it ended while a drive had power, or the computer lost its supply"),
        ),
        (
            Found(Record(Mark.LATCHED, 0x0206, "", "too fast")),
            Verdict(TripCause.OVERSPEED, 2, "since before the start: too fast"),
        ),
        (
            Found(Record(Mark.LATCHED, 0x0206, "", "since before the start: too fast")),
            Verdict(TripCause.OVERSPEED, 2, "since before the start: too fast"),
        ),
        (
            Found(Record(Mark.LATCHED, 0x0200, "", "?")),
            Verdict(TripCause.RECORD_UNUSABLE, 2, "since before the start: ?"),
        ),
        (
            Found(Record(Mark.LATCHED, 0x0213, "", "?")),
            Verdict(TripCause.RECORD_UNUSABLE, 2, "since before the start: ?"),
        ),
        (
            Found(Record(Mark.LIVE, 0x0206, "", "too fast"), Defect.GARBAGE, "/x"),
            Verdict(
                TripCause.RECORD_UNUSABLE,
                0,
                "the record of its last trip cannot be used: the record of stops is damaged (/x)",
            ),
        ),
    ],
)
def test_it_starts_with_what_the_record_says_and_with_a_trip_when_it_says_nothing(
    past: Found, verdict: Verdict
) -> None:
    assert before_the_start(past) == verdict


def test_each_cause_that_can_be_written_is_the_same_after_the_start() -> None:
    for each in set(TripCause) - {TripCause.NONE}:
        assert before_the_start(Found(Record(Mark.LATCHED, int(each)))).cause is each


@pytest.mark.parametrize("opened", [False, True])
@pytest.mark.parametrize("node_id", [0, 1, 127])
@pytest.mark.parametrize("cause", set(TripCause) - {TripCause.NONE})
def test_a_trip_has_its_cause_its_node_and_the_relay_in_its_code(cause: TripCause, node_id: int, opened: bool) -> None:
    record = Record(Mark.LATCHED, code_of(Verdict(cause, node_id), opened=opened), "", "why")
    assert before_the_start(Found(record)) == Verdict(cause, node_id, "since before the start: why")
    assert has_opened(record) is opened
    assert record.code < 1 << 16


def test_causes_after_which_a_sensor_is_no_evidence() -> None:
    assert sorted(SENSOR_CAUSES) == [12, 13, 17]


# --- own loop late


@pytest.mark.parametrize(("gap_s", "trips"), [(0.005, 0), (0.0999, 0), (0.1, 0), (0.1001, 10), (5.0, 10)])
def test_the_own_loop_may_not_stand_still_while_a_drive_is_enabled(gap_s: float, trips: int) -> None:
    assert cause(of(AT_REST, tick_gap_s=gap_s)) == trips
    assert cause(of(OFF, tick_gap_s=gap_s)) == 0


# --- what keeps a reset away


@pytest.mark.parametrize(
    ("tripped_by", "changes", "still"),
    [
        (TripCause.LEASE_LOST, {"lease_at": NOW - 0.249}, False),
        (TripCause.LEASE_LOST, {"lease_at": NOW - 0.251}, True),
        (TripCause.DRIVER_SILENT, {"driver_at": NOW - 0.299}, False),
        (TripCause.DRIVER_SILENT, {"driver_at": NOW - 0.301}, True),
        (TripCause.DRIVER_SILENT, {"sync_at": NEVER}, False),  # it boots the drives first
        (TripCause.DRIVE_SILENT, {"nodes": (Node(1, NEVER, NOW - 0.299),)}, False),
        (TripCause.DRIVE_SILENT, {"nodes": (Node(1, NEVER, NOW - 0.301),)}, True),
        (TripCause.LOOP_LATE, {"tick_gap_s": 5.0}, False),
        (TripCause.ENDED, {}, False),
    ],
)
def test_a_cause_stands_even_while_nothing_moves(tripped_by: TripCause, changes: dict[str, Any], still: bool) -> None:
    assert stands(Verdict(tripped_by, 1), of(OFF, **changes), CONFIG, NOW) is still


@pytest.mark.parametrize(
    ("target_mps", "command_at", "linear", "lease_at", "ordered"),
    [
        (0.0, 99.99, 0.0, 99.99, False),
        (0.001, 99.751, 0.0, 99.99, True),
        (0.001, 99.749, 0.0, 99.99, False),  # nobody sends that any more
        (0.0, 99.99, 0.1, 99.751, True),
        (0.0, 99.99, 0.1, 99.749, False),
    ],
)
def test_orders_of_the_last_moments(
    target_mps: float, command_at: float, linear: float, lease_at: float, ordered: bool
) -> None:
    axis = replace(OFF, target_mps=target_mps, command_at=command_at)
    view = of(axis, lease=Lease(1, 1, linear, 0.0, 0), lease_at=lease_at)
    assert velocity_ordered(view, CONFIG, NOW) is ordered


def test_without_any_lease_the_filter_orders_nothing() -> None:
    assert not velocity_ordered(of(OFF, lease=None, lease_at=NEVER), CONFIG, NOW)


def test_the_loop_wakes_when_the_first_timeout_runs_out() -> None:
    assert next_expiry(99.99, 99.95, CONFIG, NOW) == pytest.approx(100.24)  # the lease
    assert next_expiry(99.99, 99.71, CONFIG, NOW) == pytest.approx(100.01)  # the driver
    assert next_expiry(90.0, 99.95, CONFIG, NOW) == pytest.approx(100.25)
    assert next_expiry(NEVER, NEVER, CONFIG, NOW) == pytest.approx(100.25)


# --- the very moment: a time that is just over is over. Binary fractions, so that nothing is rounded.

EXACT = replace(CONFIG, lease_timeout_s=0.25, drive_heartbeat_s=0.5, feedback_timeout_s=0.125, standstill_mps=0.0078125)


def exactly(view: View) -> TripCause:
    return decide(view, EXACT, NOW).cause


def test_at_the_very_moment_it_trips() -> None:
    assert exactly(well(lease_at=99.75)) is TripCause.LEASE_LOST
    assert exactly(of(AT_REST, driver_at=99.5)) is TripCause.DRIVER_SILENT
    assert exactly(of(replace(AT_REST, fed_at=99.875))) is TripCause.DRIVE_SILENT
    assert exactly(of(AT_REST, nodes=(Node(1, 99.5, 99.99), Node(2, 99.95, 99.99)))) is TripCause.DRIVE_SILENT


def test_at_the_very_moment_syncs_have_stopped() -> None:
    assert exactly(of(replace(AT_REST, fed_at=99.0), sync_at=99.875)) is TripCause.NONE


def test_at_the_very_moment_feedback_is_too_old_to_say_that_the_power_is_off() -> None:
    axis = replace(OFF, status_at=99.875)
    assert not is_off(axis, of(axis), EXACT, NOW)


@pytest.mark.parametrize("velocity_mps", [0.0, 0.02, 0.3])
def test_whether_a_wheel_stands_is_not_for_its_velocity_alone_to_say(velocity_mps: float) -> None:
    assert not moving(replace(LEFT, velocity_mps=velocity_mps, standing=True), EXACT)
    assert moving(replace(LEFT, velocity_mps=velocity_mps, standing=False), EXACT)


def test_at_the_very_moment_a_drive_that_says_nothing_may_be_on() -> None:
    assert commanded(replace(LEFT, state=None, status_at=90.0, command_at=90.125), EXACT)


def test_at_the_very_moment_a_cause_stands_and_an_order_is_over() -> None:
    assert stands(Verdict(TripCause.LEASE_LOST), of(OFF, lease_at=99.75), EXACT, NOW)
    assert stands(Verdict(TripCause.DRIVER_SILENT), of(OFF, driver_at=99.5), EXACT, NOW)
    assert stands(Verdict(TripCause.DRIVE_SILENT, 1), of(OFF, nodes=(Node(1, NEVER, 99.5),)), EXACT, NOW)
    old_target = of(replace(OFF, target_mps=0.1, command_at=99.75), lease=None)
    assert not velocity_ordered(old_target, EXACT, NOW)
    old_lease = of(OFF, lease=Lease(1, 1, 0.3, 0.0, 0), lease_at=99.75)
    assert not velocity_ordered(old_lease, EXACT, NOW)


def test_what_ends_just_now_is_not_waited_for() -> None:
    assert next_expiry(99.75, 99.5, EXACT, NOW) == 100.25
