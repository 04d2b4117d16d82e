"""The whole chain in virtual time: what a reset needs, what refuses it, and what breaks it off."""

from __future__ import annotations

import itertools
import re

import pytest

from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.supervision.watchdog_link import ANSWERS
from canbase_runtime.driver_state import DriverState
from canbase_watchdog.watchdog import State as WatchdogState
from canbase_watchdog.watchdog import Watchdog
from support.chain_world import BOOTED_S, FORWARD, World, bench_robot, setpoints, world_of

OVERCURRENT = 0x2310
FAULT_RESET = 0x80


@pytest.fixture
def world(kind: str) -> World:
    """At 0.3 m/s."""
    world = world_of(kind)
    world.drive()
    return world


def test_a_fault_is_reset_by_three_edges_at_most_once_its_cause_is_gone(world: World) -> None:
    world.node.fail(0, OVERCURRENT, holds=True)
    world.run(1.0)
    world.command = Twist2D.ZERO
    world.run(0.1)
    before = len(world.ticks)
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence == (
        "left_wheel (node 1): 2310h over-current: it does not clear; remove its cause, then reset again"
    )
    assert world.core.state is DriverState.LATCHED
    left = [next(setpoints(frames))[0] for frames in world.ticks[before:]]
    right = [list(setpoints(frames))[1][0] for frames in world.ticks[before:]]
    assert left.count(FAULT_RESET) >= 3
    shared = world.robot.drives[0].kind.layout.controlword == "shared"
    assert (FAULT_RESET in right) is shared
    edges = [first for first, second in itertools.pairwise(left) if (first, second) == (0, FAULT_RESET)]
    assert len(edges) == 3
    world.node.heal(0)
    world.run(1.0)
    assert world.core.state is DriverState.LATCHED  # that the cause has gone is not enough
    assert world.recovered()
    assert world.snapshot.drives[0].error_code == 0


def test_an_emergency_message_after_the_reset_is_shown_and_stops_nothing(world: World) -> None:
    world.node.fail(0, OVERCURRENT)
    world.run(1.0)
    assert world.recovered()
    world.inject(0x081, "10 23 02 00 00 00 00 00")
    world.run(0.2)
    assert world.core.state is DriverState.ENABLED
    assert world.snapshot.drives[0].error_text == "over-current"
    world.inject(0x081, "00 00 00 00 00 00 00 00")
    assert world.snapshot.drives[0].error_code == 0


def test_a_fault_without_power_is_latched_too(world: World) -> None:
    world = World()
    world.command = FORWARD  # keeps the power off
    world.run_until(DriverState.DISARMED, within_s=1.0)
    world.run(0.3)  # the watchdog watches
    world.node.fail(0, OVERCURRENT)
    world.run_until(DriverState.LATCHED, within_s=0.05)
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [("drive fault", True)]
    assert world.recovered()


def latched(world: World) -> None:
    """By the stop service, with zero commanded: nothing else is wrong."""
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, within_s=1.0)
    world.command = Twist2D.ZERO
    world.run(0.1)


def test_a_reset_waits_for_a_drive_that_is_switched_on_later(world: World) -> None:
    latched(world)
    world.node.power_cycle(world.now_s, off_s=4.0)
    world.run(0.5)
    start = world.now_s
    outcome = world.reset()
    assert outcome.done, outcome.sentence
    assert 3.5 < world.now_s - start < 3.5 + BOOTED_S
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_a_reset_of_a_drive_that_stays_dead_ends_after_ten_seconds_and_says_so(world: World) -> None:
    latched(world)
    world.node.line.cut = True
    world.run(0.5)
    start = world.now_s
    outcome = world.reset()
    assert not outcome.done
    assert re.match(r"waiting for node 1 \(left_wheel(, right_wheel)?\): the answer to 1000h:0", outcome.sentence)
    assert outcome.sentence.endswith("check its power and its cable; remedy that, then reset again")
    assert 10.0 < world.now_s - start < 11.0


def test_while_a_silent_drive_is_the_watchdogs_cause_its_reset_is_refused(world: World) -> None:
    world.node.line.cut = True
    world.command = Twist2D.ZERO
    world.run(2.5)
    outcome = world.reset()
    assert not outcome.done
    assert "refused: its cause persists" in outcome.sentence


def test_a_drive_that_restarts_during_a_reset_breaks_it_off(world: World) -> None:
    latched(world)
    world.node.fail(0, OVERCURRENT)
    world.run(0.1)
    node_id = world.robot.drives[1].node_id
    world.bench.nodes[node_id].power_cycle(world.now_s, off_s=0.0)  # says so later, while the fault reset bit is high
    outcome = world.reset()
    assert not outcome.done
    assert "broken off: " in outcome.sentence
    assert f"node {node_id} (" in outcome.sentence
    assert "right_wheel)" in outcome.sentence
    assert world.core.state is DriverState.LATCHED
    world.run(1.0)
    assert world.recovered()


def test_a_watchdog_that_dies_during_a_reset_breaks_it_off(world: World) -> None:
    latched(world)
    world.node.fail(0, OVERCURRENT, holds=True)
    world.run(0.1)
    sentences: list[str] = []
    world.core.request_reset(world.now_s, lambda outcome: sentences.append(outcome.sentence))
    world.run(0.1)
    world.watchdog = None
    world.run(0.5)
    assert [sentence[:35] for sentence in sentences] == ["broken off: watchdog: no frame for "]


def test_a_reset_that_was_under_way_while_the_driver_stood_still_is_broken_off(world: World) -> None:
    latched(world)
    world.node.fail(0, OVERCURRENT)
    world.run(0.1)
    sentences: list[str] = []
    world.core.request_reset(world.now_s, lambda outcome: sentences.append(outcome.sentence))
    world.run(0.02)
    world.pause_driver(9.0)
    world.run(1.0)
    assert sentences == ["broken off: motor_driver did not run for 9.0 s; reset again"]
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()


def test_a_second_reset_is_refused_while_one_is_under_way_and_its_own_caller_may_be_gone(world: World) -> None:
    latched(world)
    world.core.request_reset(world.now_s, lambda _outcome: None)
    assert world.reset().sentence == "refused: a reset is under way"
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_a_watchdog_that_died_is_needed_for_the_reset(world: World) -> None:
    world.watchdog = None
    world.command = Twist2D.ZERO
    world.run(2.6)
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence.startswith("refused: watchdog: no frame for")
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now_s)
    world.run(0.1)
    assert world.core.state is DriverState.LATCHED
    assert world.reset().sentence == "refused: watchdog: still starting"
    world.run(0.5)
    assert world.recovered()


def test_after_a_lost_lease_the_watchdog_is_reset_only_when_zero_is_ordered(world: World) -> None:
    world.leases = False
    world.run_until(DriverState.LATCHED, within_s=1.0)
    world.leases = True
    world.run(0.1)
    assert world.reset().sentence.startswith("refused: cmd_vel orders")
    world.command = None  # cmd_vel ends, but the filter goes on to order 0.3 m/s
    world.run(0.3)
    outcome = world.reset()
    assert outcome.sentence.endswith(f" refused: {ANSWERS[3]}")
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()
    assert world.watchdog is not None
    assert world.watchdog.status.state is WatchdogState.WATCHING


def test_a_bus_that_fails_and_comes_back_shows_offline_or_latched_and_drives_again_after_a_reset(world: World) -> None:
    world.cable = False
    world.run_until(DriverState.LATCHED, within_s=2.5)
    world.command = Twist2D.ZERO
    world.run(0.05)
    assert world.reset().sentence == "refused: the cable is cut"
    world.cable = True
    world.run(1.0)
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()


def test_a_bus_that_fails_without_power_is_offline_and_goes_on_by_itself() -> None:
    world = World()
    world.command = FORWARD
    world.run_until(DriverState.DISARMED, within_s=1.0)
    world.cable = False
    world.run_until(DriverState.OFFLINE, within_s=0.02)
    assert (world.core.finding.cause.value, world.core.finding.detail) == ("bus failed", "the cable is cut")
    world.cable = True
    world.run_until(DriverState.BOOTING, within_s=0.02)
    world.command = Twist2D.ZERO
    world.run_until(DriverState.ENABLED, within_s=1.5)


def test_an_emergency_message_that_its_drive_never_takes_back_goes_with_the_reset(world: World) -> None:
    latched(world)
    world.inject(0x081, "10 23 02 00 00 00 00 00")
    assert world.snapshot.drives[0].error_code == OVERCURRENT
    assert world.recovered()
    assert world.snapshot.drives[0].error_code == 0


def hold_node_1(world: World, seconds: float) -> None:
    """A watchdog on the second rung of its ladder: node 1 is kept pre-operational."""
    for _ in range(round(seconds / 0.05)):
        world.inject(0x77E, "05")
        world.inject(0x1FE, "02 03 02 01 14 00 00 00")
        world.inject(0x000, "80 01")
        world.run(0.05)


def test_a_node_that_the_watchdog_keeps_pre_operational_is_not_booted_against_it(world: World) -> None:
    world.watchdog = None
    start = world.now_s
    hold_node_1(world, 3.0)
    assert world.core.state is DriverState.LATCHED
    assert world.sent(0x601, since=start) == []
    hold_node_1(world, 0.05)
    released = world.now_s
    world.run(BOOTED_S)
    started = None if world.is_guarded else NmtState.OPERATIONAL  # without a watchdog nobody requests its NMT state
    assert released + 0.1 < next(at for at, frame in world.log if frame.cob_id == 0x601 and at > start) < released + 0.3
    assert world.snapshot.drives[0].nmt_state is started


def test_a_watchdog_that_forgets_its_trip_in_a_restart_leaves_the_latch_to_the_driver(world: World) -> None:
    world.leases = False
    world.run_until(DriverState.LATCHED, within_s=1.5)
    world.command, world.leases = Twist2D.ZERO, True
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now_s)
    world.run(2.0)
    assert world.watchdog.status.state is WatchdogState.WATCHING
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.LATCHED, "watchdog tripped")
    assert world.recovered()


def test_a_trip_that_a_new_driver_found_is_latched_by_it_though_the_watchdog_restarts_too(world: World) -> None:
    world.kill_driver()
    world.run(1.0)
    world.start_driver()
    world.command = Twist2D.ZERO
    world.run(0.2)  # the drives are not even booted
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now_s)
    world.run(2.0)
    assert world.core.state is DriverState.LATCHED
    assert [(stop.stopped_by, stop.latched) for stop in world.core.stops] == [("watchdog", True)]
    assert world.recovered()


LOST_HEARTBEAT = 0x8130


@pytest.mark.parametrize(
    ("profile", "code", "resets"),
    [("epos4", LOST_HEARTBEAT, 1), ("epos4", OVERCURRENT, 0), ("generic", LOST_HEARTBEAT, 0)],
)
def test_a_lost_heartbeat_needs_an_nmt_reset_where_the_profile_says_so(profile: str, code: int, resets: int) -> None:
    values = bench_robot().model_dump()
    values["drives"] = [drive | {"profile": profile, "velocity_unit": "rpm"} for drive in values["drives"]]
    world = World(Robot.model_validate(values))
    world.enable()
    world.node.emcy.raise_error(code)
    world.node.fail(0, code)
    world.run(0.5)
    world.node.emcy.clear_error(code)  # the heartbeat is back, and the fault stays
    world.run(0.5)
    since = world.now_s
    assert world.recovered()
    reset = bytes.fromhex("82 01")
    assert [frame.data for at, frame in world.log if at > since and frame.cob_id == 0].count(reset) == resets


def test_a_drive_that_is_missing_at_the_start_is_an_error_after_boot_s_and_welcome_when_it_comes() -> None:
    world = World()
    world.bench.nodes[2].line.cut = True
    world.run(9.9)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.BOOTING, "booting")
    world.run(0.2)
    assert (world.core.state, world.core.finding.cause.value) == (DriverState.BOOTING, "drive missing")
    assert world.core.finding.detail.startswith("node 2 (right_wheel) is missing since 10 s: ")
    world.bench.nodes[2].line.cut = False
    world.run_until(DriverState.ENABLED, within_s=5.0)
