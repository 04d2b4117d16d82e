"""The last way to stop a motor that takes no setpoints any more: what is written, how often, and when not."""

from __future__ import annotations

import pytest

from bus.crews import robot_with
from canbase_driver.sdo_stop import PERIOD_S, SdoStop
from canbase_driver.snapshot import DriverState
from unit.chain_world import World, robot_of, world_of

QUICK_STOP, OFF = 0x02, 0x00


def shown(stop: SdoStop, words: list[int], now: float) -> list[str]:
    return [str(frame) for frame in stop.frames(words, now)]


def test_each_motor_of_a_node_has_its_own_controlword_written() -> None:
    stop = SdoStop(5, robot_of((5, 0, "left"), (5, 1, "right")).drives)
    assert shown(stop, [QUICK_STOP, OFF], 1.0) == ["605h [2B 40 60 00 02 00 00 00]", "605h [2B 40 68 00 00 00 00 00]"]


def test_motors_that_share_one_have_it_written_once() -> None:
    stop = SdoStop(1, robot_with("zlac8015d").drives)
    assert shown(stop, [QUICK_STOP, QUICK_STOP], 1.0) == ["601h [2B 40 60 00 02 00 00 00]"]


def test_it_is_written_again_as_an_answer_may_be_lost_but_not_in_every_cycle() -> None:
    stop = SdoStop(1, robot_of((1, 0, "left"), (2, 0, "right")).drives[:1])
    sent = [bool(stop.frames([QUICK_STOP], 1.0 + i * PERIOD_S / 5)) for i in range(11)]
    assert sent == [True, *[False] * 4, True, *[False] * 4, True]


def written_by_the_driver(world: World, since: int) -> list[str]:
    """Controlwords by SDO in the driver's cycles from that one on."""
    return [str(f) for cycle in world.ticks[since:] for f in cycle if f.cob_id == 0x601 and f.data[1:3] == b"\x40\x60"]


@pytest.mark.parametrize("kind", ["generic", "roboteq"])
def test_beside_a_live_watchdog_it_is_left_to_its_ladder(kind: str) -> None:
    """Its SDO would be one more sign of another master: docs/bus.md."""
    world = world_of(kind)
    world.drive()
    cycles = len(world.ticks)
    world.inject(0x701, "7f")
    assert world.core.state is DriverState.ENABLED
    world.run(0.3)
    assert world.core.cause.name == "drive restarted"
    assert written_by_the_driver(world, cycles) == []
