"""The whole chain in virtual time: what goes wrong at 0.3 m/s, how long until the base stands, what a reset then needs.

order to move ──►│ the fault        standstill │◄── measured by the simulator's ground truth
                 │◄────── bounded here ───────►│
"""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest

from canbase_bench.world.bench import BenchParameters
from canbase_config.derive import watchdog_config
from canbase_config.robot import Robot
from canbase_driver.kinematics import Twist2D
from canbase_driver.snapshot import DriverState
from canbase_watchdog.watchdog import State as WatchdogState
from canbase_watchdog.watchdog import Watchdog
from unit.chain_world import FORWARD, World, robot_of, setpoints

OVERCURRENT = 0x2310
QUICK_STOP = 0x02
FAULT_RESET = 0x80


@pytest.fixture
def world() -> World:
    """At 0.3 m/s."""
    world = World()
    world.drive()
    return world


def lose_leases(world: World) -> None:
    world.leases = False


def lose_filter(world: World) -> None:
    world.leases, world.command = False, None


def lose_watchdog(world: World) -> None:
    world.watchdog = None


def cut_the_drivers_cable(world: World) -> None:
    world.cable = False


def drive_fault(world: World) -> None:
    world.node.fail(0, OVERCURRENT)


def power_cycle(world: World) -> None:
    world.node.power_cycle(world.now, off_s=0.5)


def silence_a_drive(world: World) -> None:
    world.node.silent = True


def cut_a_drive(world: World) -> None:
    world.node.cut = True


def request_stop(world: World) -> None:
    world.core.request_stop()


Act = Callable[[World], None]
STOPS: tuple[tuple[Act, float, str], ...] = (
    (lose_leases, 0.45, "watchdog tripped"),
    (lose_filter, 0.45, "watchdog tripped"),
    (lose_watchdog, 0.45, "watchdog missing"),
    (cut_the_drivers_cable, 0.5, "bus failed"),
    (drive_fault, 0.2, "drive fault"),
    (power_cycle, 0.85, "drive silent"),  # that wheel coasts, the other one brakes
    (silence_a_drive, 0.35, "drive silent"),
    (cut_a_drive, 0.5, "drive silent"),
    (request_stop, 0.4, "stop requested"),
)


@pytest.mark.parametrize(("act", "within_s", "cause"), STOPS, ids=lambda value: getattr(value, "__name__", ""))
def test_at_03_mps_the_base_stands_within_half_a_second_and_is_latched(
    world: World, act: Act, within_s: float, cause: str
) -> None:
    act(world)
    assert world.stands_after() < within_s
    assert (world.core.state, world.core.cause.name) == (DriverState.LATCHED, cause)
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [(cause, True)]
    way_m = world.truth.path_m
    world.command = FORWARD
    world.run(1.0)
    assert world.truth.path_m == pytest.approx(way_m, abs=1e-6)


def test_a_driver_that_is_killed_is_stopped_by_the_watchdog(world: World) -> None:
    world.kill_driver()
    assert world.stands_after() < 0.5
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause.name == "DRIVER_SILENT"


def test_driver_and_watchdog_both_killed_the_drives_stop_by_themselves(world: World) -> None:
    world.kill_driver()
    world.watchdog = None
    assert world.stands_after() < 0.6


def test_a_new_driver_takes_over_after_a_kill_and_needs_a_reset(world: World) -> None:
    world.kill_driver()
    world.run(0.6)
    world.start_driver()
    world.command = Twist2D.ZERO
    world.run_until(DriverState.DISARMED, within_s=1.5)
    assert world.recovered()


def test_a_fault_of_one_wheel_stops_both_within_one_cycle_of_knowing(world: World) -> None:
    world.node.fail(0, OVERCURRENT)
    failed_at = world.now
    # fault → answer to the next SYNC (10 ms) → next cycle (10 ms)
    world.run(0.022)
    assert [word for word, _ in setpoints(world.ticks[-1])] == [QUICK_STOP, QUICK_STOP]
    assert world.now - failed_at < 0.025
    assert world.core.cause.detail == "left_wheel (node 1): 2310h over-current"


def test_a_fault_is_reset_by_one_edge_alone_once_its_cause_is_gone(world: World) -> None:
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
    assert FAULT_RESET not in right
    edges = [first for first, second in itertools.pairwise(left) if (first, second) == (0, FAULT_RESET)]
    assert len(edges) == 1
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
    world.node.fail(0, OVERCURRENT)
    world.run_until(DriverState.LATCHED, within_s=0.05)
    assert [(stop.cause, stop.latched) for stop in world.core.stops] == [("drive fault", True)]
    assert world.recovered()


def test_a_drive_that_was_switched_off_and_on_is_booted_again_and_waits_for_a_reset(world: World) -> None:
    world.node.power_cycle(world.now, off_s=0.5)
    world.run(1.5)
    before = world.snapshot
    assert not before.odometry_valid
    world.run(1.5)
    after = world.snapshot
    assert after.state is DriverState.LATCHED
    assert after.odometry_valid
    assert after.drives[0].nmt_state == "operational"
    assert world.powered == [False, False]
    # its encoder starts anew elsewhere: no jump of the pose, and the way that nobody could measure is reported
    assert (after.x_m, after.y_m, after.yaw_rad) == pytest.approx((before.x_m, before.y_m, before.yaw_rad), abs=1e-3)
    assert after.travel_losses >= 1
    assert world.recovered()
    assert world.snapshot.yaw_rad == pytest.approx(before.yaw_rad, abs=0.01)


def test_the_pose_never_jumps_while_a_drive_is_switched_off_and_on(world: World) -> None:
    world.node.power_cycle(world.now, off_s=0.3)
    poses = []
    for _ in range(300):
        world.run(0.01)
        poses.append(world.snapshot)
    steps = [abs(b.x_m - a.x_m) + abs(b.yaw_rad - a.yaw_rad) for a, b in itertools.pairwise(poses)]
    assert max(steps) < 0.3 * 0.01 * 1.5 + 0.01


def latched(world: World) -> None:
    """By the stop service, with zero commanded: nothing else is wrong."""
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, within_s=1.0)
    world.command = Twist2D.ZERO
    world.run(0.1)


def test_a_reset_waits_for_a_drive_that_is_switched_on_later(world: World) -> None:
    latched(world)
    world.node.power_cycle(world.now, off_s=4.0)
    world.run(0.5)
    start = world.now
    outcome = world.reset()
    assert outcome.done, outcome.sentence
    assert 3.5 < world.now - start < 4.5
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_a_reset_of_a_drive_that_stays_dead_ends_after_ten_seconds_and_says_so(world: World) -> None:
    latched(world)
    world.node.cut = True
    world.run(0.5)
    start = world.now
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence.startswith("node 1 (left_wheel): no status for 10.")
    assert outcome.sentence.endswith("check its power and its cable, then reset again")
    assert 10.0 < world.now - start < 11.0


def test_while_a_silent_drive_is_the_watchdogs_cause_its_reset_is_refused(world: World) -> None:
    world.node.cut = True
    world.command = Twist2D.ZERO
    world.run(2.5)
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence == "the watchdog refused: the cause stands"


def test_a_drive_that_restarts_during_a_reset_breaks_it_off(world: World) -> None:
    latched(world)
    world.node.fail(0, OVERCURRENT)
    world.run(0.1)
    world.bench.nodes[2].power_cycle(world.now, off_s=0.0)  # says so 0.1 s later, while the fault reset bit is high
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence.startswith("broken off: waiting for node 2 (right_wheel)")
    assert world.core.state is DriverState.LATCHED
    world.run(1.0)
    assert world.recovered()


def test_a_watchdog_that_dies_during_a_reset_breaks_it_off(world: World) -> None:
    latched(world)
    world.node.fail(0, OVERCURRENT, holds=True)
    world.run(0.1)
    sentences: list[str] = []
    world.core.request_reset(world.now, lambda outcome: sentences.append(outcome.sentence))
    world.run(0.1)
    world.watchdog = None
    world.run(0.5)
    assert [sentence[:33] for sentence in sentences] == ["broken off: watchdog: silent for "]


def test_a_second_reset_is_refused_while_one_is_under_way_and_its_own_caller_may_be_gone(world: World) -> None:
    latched(world)
    world.core.request_reset(world.now, lambda _outcome: None)
    assert world.reset().sentence == "refused: a reset is under way"
    world.run_until(DriverState.ENABLED, within_s=0.5)


def test_a_watchdog_that_died_is_needed_for_the_reset(world: World) -> None:
    world.watchdog = None
    world.command = Twist2D.ZERO
    world.run(2.6)
    outcome = world.reset()
    assert not outcome.done
    assert outcome.sentence.startswith("refused: watchdog: silent for")
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now)
    world.run(0.1)
    assert world.core.state is DriverState.LATCHED
    assert world.reset().sentence == "refused: watchdog: still starting"
    world.run(0.5)
    assert world.recovered()


def test_a_watchdog_that_restarts_unnoticed_stops_the_base_while_it_is_starting(world: World) -> None:
    world.watchdog = Watchdog(watchdog_config(world.robot), world.now)
    world.run(0.05)
    assert (world.core.state, world.core.cause.name) == (DriverState.STOPPING, "watchdog missing")


def test_after_a_lost_lease_the_watchdog_is_reset_only_when_zero_is_ordered(world: World) -> None:
    world.leases = False
    world.run_until(DriverState.LATCHED, within_s=1.0)
    world.leases = True
    world.run(0.1)
    assert world.reset().sentence.startswith("refused: cmd_vel orders")
    world.command = None  # cmd_vel ends, but the filter goes on to order 0.3 m/s
    world.run(0.3)
    outcome = world.reset()
    assert outcome.sentence == "the watchdog refused: a velocity is ordered"
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()
    assert world.watchdog is not None
    assert world.watchdog.status.state is WatchdogState.WATCHING


def test_a_wheel_that_does_not_stop_is_quick_stopped_and_latched(world: World) -> None:
    world.node.axes[0].faults.ignores_setpoints = True
    world.command = Twist2D.ZERO
    world.run(3.2)
    assert not world.core.stops
    assert world.truth.v_left_mps > 0.1
    world.run(0.3)
    assert world.core.cause.name == "did not stop"
    assert world.core.cause.detail.startswith("left_wheel turns at 0.3")
    world.run(2.0)
    assert world.core.state is DriverState.LATCHED
    assert world.truth.standing_s > 1.0


def test_a_push_against_the_standing_base_is_held_and_no_reason_to_stop(world: World) -> None:
    world.command = Twist2D.ZERO
    world.run(5.0)
    world.node.axes[0].faults.stuck_velocity = 300  # 16 mm/s for a moment
    world.run(0.5)
    assert world.core.state is DriverState.ENABLED
    assert not world.snapshot.standstill
    world.node.axes[0].faults.stuck_velocity = None
    world.run(3.5)
    assert world.core.state is DriverState.ENABLED


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
    assert (world.core.cause.name, world.core.cause.detail) == ("bus failed", "the cable is cut")
    world.cable = True
    world.run_until(DriverState.BOOTING, within_s=0.02)
    world.command = Twist2D.ZERO
    world.run_until(DriverState.ENABLED, within_s=1.5)


@pytest.mark.parametrize(
    "robot",
    [
        robot_of((1, 0, "left"), (1, 1, "right")),
        robot_of((1, 0, "right"), (1, 1, "left")),
        robot_of((1, 0, "left"), (2, 0, "right"), (3, 0, "left"), (4, 0, "right")),
        robot_of((1, 0, "left"), (1, 1, "right"), (2, 0, "left"), (2, 1, "right")),
    ],
    ids=["two axes on a node", "the other way round", "four wheels", "four wheels on two nodes"],
)
def test_other_robots_drive_their_arc_and_stop_all_wheels_for_the_fault_of_one(robot: Robot) -> None:
    world = World(robot)
    world.drive(Twist2D(0.3, 0.5), seconds=1.0)
    truth, snapshot = world.truth, world.snapshot
    assert (truth.linear_mps, truth.angular_radps) == pytest.approx((0.3, 0.5), abs=0.01)
    assert (snapshot.x_m, snapshot.y_m, snapshot.yaw_rad) == pytest.approx(
        (truth.x_m, truth.y_m, truth.yaw_rad), abs=1e-3
    )
    world.node.fail(0, OVERCURRENT)
    assert world.stands_after() < 0.25
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()


@pytest.mark.parametrize("offset", [2**31 - 2000, -(2**31) + 2000])
def test_the_encoder_goes_round_at_32_bits_while_driving_and_nobody_sees_it(offset: int) -> None:
    world = World(parameters=BenchParameters(encoder_offset=offset))
    first = world.node.axes[0].position()
    world.drive(Twist2D(0.3 if offset > 0 else -0.3, 0.0), seconds=1.0)
    assert world.node.axes[0].position() * first < 0  # it went round
    world.command = Twist2D.ZERO
    world.run(1.0)
    assert world.snapshot.x_m == pytest.approx(world.truth.x_m, abs=1e-4)
    assert world.snapshot.travel_losses == 0


def test_an_encoder_that_jumps_for_good_is_no_motion_of_the_base_and_is_reported(world: World) -> None:
    before = world.snapshot
    world.node.axes[0].encoder_offset += 1_000_000  # 7.7 m at the rim
    world.run(0.5)
    after = world.snapshot
    assert after.x_m == pytest.approx(before.x_m + 0.15, abs=0.02)
    assert after.yaw_rad == pytest.approx(before.yaw_rad, abs=0.01)
    assert after.travel_losses == 1
    assert after.odometry_valid
