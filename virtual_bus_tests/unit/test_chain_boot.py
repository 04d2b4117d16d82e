"""From power on to operation enabled: two drives and eight, drives without STO, with a counter in SYNC."""

from __future__ import annotations

import pytest

from canbase_config.robot import Robot
from canbase_driver.frame import Frame
from canbase_driver.snapshot import DriverState
from unit.chain_world import FORWARD, World, bench_robot, robot_of

EIGHT = tuple((node_id, 0, "left" if node_id % 2 else "right") for node_id in range(1, 9))


def enabled_after(world: World) -> float:
    return world.run_until(DriverState.ENABLED, within_s=5.0)


def test_two_drives_are_enabled_within_a_second_and_eight_within_one_and_a_half_times_that() -> None:
    two_s = enabled_after(World())
    eight_s = enabled_after(World(robot_of(*EIGHT)))  # type: ignore[arg-type]
    assert two_s <= 1.0
    assert eight_s <= 1.5 * two_s


class RightWithoutSto(World):
    """As long as `sto_open`, the right drive gets no controlword but 0: it does not leave switch on disabled."""

    def __init__(self) -> None:
        super().__init__()
        self.sto_open = True
        self._right = self.bench.nodes[2].on_frame
        vars(self.bench.nodes[2])["on_frame"] = self._gate

    def _gate(self, cob_id: int, data: bytes, now: float) -> None:
        is_setpoint = cob_id == 0x202 and self.sto_open
        self._right(cob_id, bytes(2) + data[2:] if is_setpoint else data, now)


def test_a_drive_with_sto_open_is_waited_for_and_enabled_later() -> None:
    world = RightWithoutSto()
    world.run(30.0)
    assert world.core.state is DriverState.DISARMED
    assert world.core.cause.name == "drive not ready"
    assert world.core.cause.detail == "right_wheel (node 2) stays in switch on disabled: STO, main voltage?"
    assert not any(world.powered)
    assert not world.core.stops
    world.sto_open = False
    assert world.run_until(DriverState.ENABLED, within_s=0.3) < 0.3


def test_while_it_is_waited_for_a_command_keeps_the_power_off() -> None:
    world = RightWithoutSto()
    world.run(1.0)
    world.command = FORWARD
    world.run(0.1)
    world.sto_open = False
    world.run(1.0)
    assert world.core.state is DriverState.DISARMED
    assert world.core.cause.name == "command not zero"


@pytest.mark.parametrize("overflow", [2, 240])
def test_sync_counts_where_robot_yaml_says_so(overflow: int) -> None:
    values = bench_robot().model_dump()
    values["bus"]["sync_counter"] = overflow
    core = World(Robot.model_validate(values)).core
    bytes_sent = [next(f for f in core.stop_frames() if f.cob_id == 0x080).data[0] for _ in range(overflow + 2)]
    assert bytes_sent == [*range(1, overflow + 1), 1, 2]


def test_sync_is_empty_without() -> None:
    assert Frame(0x080) in World().core.stop_frames()
