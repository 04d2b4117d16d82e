"""Stops from their cause to standstill, as they are told: first by hand, then in the whole chain in virtual time."""

from __future__ import annotations

import math

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Pose2D
from canbase_driver.snapshot import DriverSnapshot
from canbase_driver.supervision.stop_history import StopHistory, StopRecord, StopReport
from canbase_runtime.driver_state import DriverState
from support.chain_world import FORWARD, World
from support.snapshots import with_driver

PATIENCE_S = 5.0
TRIP = StopRecord("watchdog", "watchdog tripped", "lease lost", True, "reset", at_s=1000.0)


def seen(
    time_s: float,
    x_m: float = 0.0,
    *,
    yaw_rad: float = 0.0,
    valid: bool = True,
    standstill: bool = False,
    state: DriverState = DriverState.ENABLED,
    silent_s: float = 0.0,
) -> DriverSnapshot:
    """A snapshot on the way straight ahead."""
    return with_driver(
        time_s=time_s,
        state=state,
        standstill=standstill,
        odometry={"pose": Pose2D(x_m, 0.0, yaw_rad), "valid": valid},
        command={"age_s": silent_s, "fresh": silent_s == 0.0},
    )


def held(cause: str, at_s: float) -> StopRecord:
    """A stop by the safety filter that needs no reset."""
    return StopRecord("safety_filter", cause, "", False, "free way", at_s)


def driving() -> StopHistory:
    """A recorder that has seen the base drive at 0.5 m/s until 999.99 s."""
    recorder = StopHistory(PATIENCE_S)
    recorder.note_velocity_command(True, 999.98)
    assert recorder.on_snapshot(seen(999.99), []) == []
    return recorder


def test_a_stop_is_told_once_when_the_base_stands_with_time_and_way() -> None:
    recorder = driving()
    assert recorder.on_snapshot(seen(1000.0, 0.005), [TRIP]) == []
    assert recorder.on_snapshot(seen(1000.2, 0.055, yaw_rad=0.1), []) == []
    (report,) = recorder.on_snapshot(seen(1000.3, 0.065, standstill=True, yaw_rad=0.1), [])
    assert report.record is TRIP
    assert report.standstill
    assert (report.standstill_s, report.distance_m) == pytest.approx((0.3, 0.065))
    assert report.turned_rad == pytest.approx(0.1)
    assert recorder.on_snapshot(seen(1000.4, 0.065, standstill=True), []) == []


def test_a_way_forth_and_back_is_as_long_as_it_was() -> None:
    recorder = driving()
    recorder.on_snapshot(seen(1000.0, 0.1), [TRIP])
    (report,) = recorder.on_snapshot(seen(1000.1, 0.0, standstill=True), [])
    assert report.distance_m == pytest.approx(0.2)


def test_a_base_that_stood_when_the_cause_came_stands_after_nothing() -> None:
    recorder = StopHistory(PATIENCE_S)
    recorder.on_snapshot(seen(999.99, standstill=True), [])
    (report,) = recorder.on_snapshot(seen(1000.01, standstill=True), [TRIP])
    assert (report.standstill, report.standstill_s, report.distance_m) == (True, 0.0, 0.0)


@pytest.mark.parametrize(("after_s", "told"), [(PATIENCE_S - 0.01, 0), (PATIENCE_S + 0.01, 1)])
def test_without_a_standstill_it_is_told_when_patience_ends(after_s: float, told: int) -> None:
    recorder = driving()
    recorder.on_snapshot(seen(1000.0), [TRIP])
    reports = recorder.on_snapshot(seen(1000.0 + after_s, 1.0), [])
    assert [(report.standstill, math.isnan(report.standstill_s)) for report in reports] == [(False, True)] * told


def test_a_way_that_was_not_heard_throughout_is_unknown() -> None:
    recorder = driving()
    recorder.on_snapshot(seen(1000.0, 0.0), [TRIP])
    recorder.on_snapshot(seen(1000.1, 0.05, valid=False), [])
    (report,) = recorder.on_snapshot(seen(1000.2, 0.1, standstill=True), [])
    assert report.standstill_s == pytest.approx(0.2)
    assert (math.isnan(report.distance_m), math.isnan(report.turned_rad)) == (True, True)


def test_two_stops_at_once_are_two_messages() -> None:
    recorder = driving()
    recorder.on_filter(held("estop", 999.995), 999.995)
    recorder.on_snapshot(seen(1000.0), [TRIP])
    reports = recorder.on_snapshot(seen(1000.2, standstill=True), [])
    assert [(each.record.stopped_by, each.record.latched) for each in reports] == [
        ("safety_filter", False),
        ("watchdog", True),
    ]


def test_the_filter_holds_a_base_that_moves_and_is_told_once() -> None:
    recorder = driving()
    recorder.on_filter(None, 999.99)
    for k in range(3):
        recorder.on_filter(held("obstacle", 1000.0 + 0.1 * k), 1000.0 + 0.1 * k)
    (report,) = recorder.on_snapshot(seen(1000.3, standstill=True), [])
    assert report.record == held("obstacle", 1000.0)
    assert report.standstill_s == pytest.approx(0.3)


def test_a_filter_that_holds_a_base_at_rest_without_a_command_is_no_stop() -> None:
    recorder = StopHistory(PATIENCE_S)
    recorder.on_snapshot(seen(1000.0, standstill=True), [])
    recorder.on_filter(held("command_stale", 1000.1), 1000.1)
    assert recorder.on_snapshot(seen(1000.2, standstill=True), []) == []


def test_a_base_that_the_filter_lets_go_before_it_stands_was_not_stopped_to_the_end() -> None:
    recorder = driving()
    recorder.on_filter(held("obstacle", 1000.0), 1000.0)
    recorder.on_filter(None, 1000.1)
    (report,) = recorder.on_snapshot(seen(1000.1, 0.05), [])
    assert not report.standstill
    assert report.distance_m == pytest.approx(0.05)


@pytest.mark.parametrize(("ordered_at", "told"), [(999.95, 1), (999.5, 0)])
def test_a_source_that_is_lost_while_it_orders_motion_is_a_stop_and_one_that_ended_with_zeros_is_none(
    ordered_at: float, told: int
) -> None:
    recorder = StopHistory(PATIENCE_S)
    recorder.note_velocity_command(True, ordered_at)
    recorder.note_velocity_command(False, ordered_at + 0.02)
    recorder.on_snapshot(seen(999.99), [])
    recorder.on_mux("joystick", "", 999.9)
    recorder.on_mux("", "joystick: no message for 0.31 s", 1000.0)
    reports = recorder.on_snapshot(seen(1000.4, standstill=True), [])
    assert [(each.record.stopped_by, each.record.cause) for each in reports] == [("velocity_mux", "no_source")] * told


def test_a_source_that_takes_over_ends_the_stop() -> None:
    recorder = driving()
    recorder.on_mux("", "joystick: no message", 1000.0)
    recorder.on_mux("navigation", "", 1000.1)
    (report,) = recorder.on_snapshot(seen(1000.1, 0.05), [])
    assert not report.standstill


@pytest.mark.parametrize(
    ("state", "moved_at", "told"),
    [(DriverState.ENABLED, 999.9, 1), (DriverState.ENABLED, 999.7, 0), (DriverState.STOPPING, 999.9, 0)],
)
def test_commands_that_end_while_the_base_moves_are_a_stop_of_the_driver(
    state: DriverState, moved_at: float, told: int
) -> None:
    recorder = StopHistory(PATIENCE_S)
    recorder.note_velocity_command(True, moved_at)
    recorder.on_snapshot(seen(999.99), [])
    recorder.on_snapshot(seen(1000.1, state=state, silent_s=0.21), [])
    reports = recorder.on_snapshot(seen(1000.4, standstill=True, silent_s=0.51), [])
    assert [(each.record.stopped_by, each.record.cause) for each in reports] == [
        ("motor_driver", "command_stale")
    ] * told


def test_a_command_that_is_fresh_again_ends_the_stop() -> None:
    recorder = driving()
    recorder.on_snapshot(seen(1000.1, silent_s=0.12), [])
    (report,) = recorder.on_snapshot(seen(1000.2, 0.1), [])
    assert not report.standstill


def test_the_end_of_the_driver_tells_what_is_open() -> None:
    recorder = driving()
    recorder.on_snapshot(seen(1000.1, 0.02), [TRIP])
    (report,) = recorder.end()
    assert not report.standstill
    assert report.distance_m == pytest.approx(0.02)
    assert recorder.end() == []
    assert StopHistory(PATIENCE_S).end() == []


def told_by_the_chain(world: World, seconds: float) -> list[StopReport]:
    """The recorder beside the driver, with a snapshot every 20 ms as in the process."""
    recorder = StopHistory(PATIENCE_S)
    reports: list[StopReport] = []
    for _ in range(round(seconds / 0.02)):
        if world.command is not None:
            recorder.note_velocity_command(world.command != Twist2D.ZERO, world.now_s)
        world.run(0.02)
        stops = list(world.core.stops)
        world.core.stops.clear()
        reports += recorder.on_snapshot(world.snapshot, stops)
    return reports


@pytest.fixture
def world() -> World:
    """At 0.3 m/s."""
    world = World()
    world.drive()
    return world


def test_in_the_chain_time_and_way_of_a_lost_lease_are_those_of_the_ground_truth(world: World) -> None:
    way_m, start = world.truth.path_m, world.now_s
    world.leases = False
    (report,) = told_by_the_chain(world, 3.0)
    tripped_s = report.record.at_s - start
    truth_s = world.now_s - world.truth.standing_s - report.record.at_s
    assert (report.record.stopped_by, report.record.latched, report.standstill) == ("watchdog", True, True)
    assert report.standstill_s == pytest.approx(truth_s, abs=0.05)
    # the truth counts from the last lease on, the report from the trip on, and what came a cycle before it
    assert report.distance_m == pytest.approx(world.truth.path_m - way_m - FORWARD.linear_mps * tripped_s, abs=0.01)


def test_in_the_chain_commands_that_end_are_one_stop_and_those_that_go_to_zero_are_none(world: World) -> None:
    world.command = Twist2D.ZERO
    assert told_by_the_chain(world, 1.5) == []
    world.command = FORWARD
    assert told_by_the_chain(world, 1.0) == []
    recorder = StopHistory(PATIENCE_S)
    recorder.note_velocity_command(True, world.now_s)
    recorder.on_snapshot(world.snapshot, [])
    world.command = None
    reports: list[StopReport] = []
    for _ in range(50):
        world.run(0.02)
        reports += recorder.on_snapshot(world.snapshot, [])
    assert [(each.record.cause, each.standstill) for each in reports] == [("command_stale", True)]
    assert 0.2 < reports[0].standstill_s < 0.6
