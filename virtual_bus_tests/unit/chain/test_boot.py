"""From power on to operation enabled: two drives and eight, drives without STO, with a counter in SYNC."""

from __future__ import annotations

import itertools

import pytest

from canbase_config.robot import Robot
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtCommand
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import apply
from support.chain_world import FORWARD, World, bench_robot, robot_of
from support.timed_bus import TimedBus, on_a_wire

EIGHT = tuple((node_id, 0, "left" if node_id % 2 else "right") for node_id in range(1, 9))


def enabled_after(world: World) -> float:
    return world.run_until(DriverState.ENABLED, within_s=5.0)


def test_two_drives_are_enabled_within_a_second_and_eight_within_one_and_a_half_times_that() -> None:
    two_s = enabled_after(World())
    eight_s = enabled_after(World(robot_of(*EIGHT)))  # type: ignore[arg-type]
    assert two_s <= 1.0
    assert eight_s <= 1.5 * two_s


@pytest.mark.parametrize(
    ("robot", "bitrate", "within_s"),
    [
        (bench_robot(), 500_000, 0.5),
        (bench_robot(), 125_000, 0.7),
        (robot_of(*EIGHT), 1_000_000, 0.5),  # type: ignore[arg-type]
        (robot_of(*EIGHT), 500_000, 0.66),  # type: ignore[arg-type]
    ],
    ids=["two, 500 kbit/s", "two, 125 kbit/s", "eight, 1 Mbit/s", "eight, 500 kbit/s"],
)
def test_boots_beside_each_other_leave_room_for_heartbeats_on_a_bus_with_a_bit_rate(
    robot: Robot, bitrate: int, within_s: float
) -> None:
    """Each node is reset and started once: none was lost meanwhile, and no drive missed a heartbeat."""
    bus = TimedBus(on_a_wire(robot, bitrate))
    assert bus.enabled_after(within_s) <= within_s
    nodes = {drive.node_id for drive in robot.drives}
    for command in (NmtCommand.RESET_COMMUNICATION, NmtCommand.START):
        sent = [frame.data[1] for _, frame in bus.heard if frame.cob_id == 0 and frame.data[0] == command]
        assert sorted(sent) == sorted(nodes)
    starts = [at for at, frame in bus.heard if frame.cob_id == 0 and frame.data[0] == NmtCommand.START]
    setpoints = [at for at, frame in bus.heard if 0x201 <= frame.cob_id <= 0x208]
    requests = [at for at, frame in bus.heard if 0x600 < frame.cob_id < 0x680 and at < max(starts)]
    assert max(requests) <= min(setpoints)  # PDOs, which go before SDOs, begin when all are configured
    beats = [at for at, frame in bus.heard if frame.cob_id == 0x77F]
    assert max(b - a for a, b in itertools.pairwise(beats)) < 0.6 * robot.timeouts.drive_heartbeat_s
    assert [frame for _, frame in bus.heard if 0x081 <= frame.cob_id <= 0x0FF] == []


WAITED_FOR = {
    "sto": "right_wheel (node 2) is in switch on disabled; if it stays: STO, main voltage, RPDO1?",
    "no_mains": "right_wheel (node 2) is in ready to switch on; if it stays: STO, main voltage, RPDO1?",
}


def without(supply: str) -> World:
    """The right drive starts without it."""
    world = World()
    apply(world.bench.nodes, 2, supply, world.now_s, {})
    return world


@pytest.mark.parametrize(("supply", "sentence"), WAITED_FOR.items())
def test_a_drive_without_sto_or_main_voltage_is_waited_for_and_enabled_later(supply: str, sentence: str) -> None:
    world = without(supply)
    world.run(10.0)
    assert world.core.state is DriverState.DISARMED
    assert (world.core.finding.cause.value, world.core.finding.detail) == ("drive not ready", sentence)
    assert not any(world.powered)
    assert not world.core.stops
    apply(world.bench.nodes, 2, "heal", world.now_s, {})
    assert world.run_until(DriverState.ENABLED, within_s=0.3) < 0.3


@pytest.mark.parametrize("supply", WAITED_FOR)
def test_while_it_is_waited_for_a_command_keeps_the_power_off(supply: str) -> None:
    world = without(supply)
    world.run(1.0)
    world.command = FORWARD
    world.run(0.1)
    apply(world.bench.nodes, 2, "heal", world.now_s, {})
    world.run(1.0)
    assert world.core.state is DriverState.DISARMED
    assert world.core.finding.cause.value == "command not zero"


@pytest.mark.parametrize("supply", WAITED_FOR)
def test_a_supply_that_is_lost_in_motion_stops_the_base_and_needs_a_reset(supply: str) -> None:
    world = World()
    world.drive()
    apply(world.bench.nodes, 2, supply, world.now_s, {})
    world.run_until(DriverState.LATCHED, within_s=2.0)
    assert world.core.finding.cause.value == "drive disabled"
    assert world.stands_after() < 2.0
    apply(world.bench.nodes, 2, "heal", world.now_s, {})
    world.command = Twist2D.ZERO
    world.run(1.0)
    assert not any(world.powered)
    assert world.recovered()


@pytest.mark.parametrize("overflow", [2, 240])
def test_sync_counts_where_robot_yaml_says_so(overflow: int) -> None:
    values = bench_robot().model_dump()
    values["bus"]["sync_counter"] = overflow
    core = World(Robot.model_validate(values)).core
    bytes_sent = [next(f for f in core.stop_frames() if f.cob_id == 0x080).data[0] for _ in range(overflow + 2)]
    assert bytes_sent == [*range(1, overflow + 1), 1, 2]


def test_sync_is_empty_without() -> None:
    assert Frame(0x080) in World().core.stop_frames()
