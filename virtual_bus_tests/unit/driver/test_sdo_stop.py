"""The last way to stop a motor that takes no setpoints any more: what is written, how often, and when not."""

from __future__ import annotations

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.drives.sdo_stop import PERIOD_S, SdoStop
from canbase_runtime.driver_state import DriverState
from support.chain_world import World, robot_of, world_of
from support.crews import robot_with

QUICK_STOP, OFF = 0x02, 0x00


def shown(stop: SdoStop, words: list[int], count: int) -> list[str]:
    """So many requests, one each PERIOD_S, answered at once."""
    told = []
    for n in range(count):
        for frame in stop.frames(words, 1.0 + n * 1.001 * PERIOD_S):
            told.append(str(frame))
            stop.speed(Frame(frame.cob_id - 0x80, b"\x60" + frame.data[1:4] + bytes(4)))
    return told


def test_each_motor_of_a_node_has_its_own_controlword_written_and_its_speed_read() -> None:
    stop = SdoStop(5, robot_of((5, 0, "left"), (5, 1, "right")).drives)
    assert shown(stop, [QUICK_STOP, OFF], 5) == [
        "605h [2B 40 60 00 02 00 00 00]",
        "605h [2B 40 68 00 00 00 00 00]",
        "605h [40 6C 60 00 00 00 00 00]",
        "605h [40 6C 68 00 00 00 00 00]",
        "605h [2B 40 60 00 02 00 00 00]",
    ]


def test_motors_that_share_one_have_it_written_once() -> None:
    stop = SdoStop(1, robot_with("zlac8015d").drives)
    assert shown(stop, [QUICK_STOP, QUICK_STOP], 4) == [
        "601h [2B 40 60 00 02 00 00 00]",
        "601h [40 6C 60 01 00 00 00 00]",
        "601h [40 6C 60 02 00 00 00 00]",
        "601h [2B 40 60 00 02 00 00 00]",
    ]


# not answered ── the same request again after 0.05 s, not the next one: a busy drive takes each second one
def test_what_is_not_answered_is_asked_again() -> None:
    stop = SdoStop(1, robot_of((1, 0, "left"), (2, 0, "right")).drives[:1])
    word, speed = "601h [2B 40 60 00 02 00 00 00]", "601h [40 6C 60 00 00 00 00 00]"
    sent = [(ms, str(f)) for ms in range(0, 111, 5) for f in stop.frames([QUICK_STOP], 1.0 + ms / 1000)]
    assert sent == [(0, word), (50, word), (100, word)]
    stop.speed(Frame(0x581, bytes.fromhex("436C600005000000")))  # somebody else's answer
    assert stop.frames([QUICK_STOP], 1.125) == []
    stop.speed(Frame(0x581, bytes.fromhex("6040600000000000")))
    assert [str(f) for f in stop.frames([QUICK_STOP], 1.126)] == [speed]


def test_a_drive_that_never_tells_its_speed_gets_its_controlwords_all_the_same() -> None:
    stop = SdoStop(1, robot_of((1, 0, "left"), (2, 0, "right")).drives[:1])
    written = 0
    for ms in range(0, 1000, 5):
        for frame in stop.frames([OFF], 1.0 + ms / 1000):
            if frame.data[0] == 0x2B:
                written += 1
                stop.speed(Frame(0x581, b"\x60" + frame.data[1:4] + bytes(4)))
    assert written >= 12


def test_a_controlword_that_is_never_answered_does_not_keep_that_of_the_other_motor_away() -> None:
    stop = SdoStop(5, robot_of((5, 0, "left"), (5, 1, "right")).drives)
    sent = [frame.data[1:3] for ms in range(0, 400, 5) for frame in stop.frames([OFF, OFF], 1.0 + ms / 1000)]
    assert sent[:6] == [b"\x40\x60"] * 3 + [b"\x40\x68"] * 3


@pytest.mark.parametrize(
    ("frame", "speed"),
    [
        ("585#436C600000FFFFFF", (0, -256)),
        ("585#436C680005000000", (1, 5)),
        ("585#426C680005000000", (1, 5)),  # without its size
        ("586#436C600005000000", None),
        ("585#4364600005000000", None),
        ("585#4364", None),
        ("585#806C600000000206", None),  # an abort
        ("585#606C600000000000", None),  # an answer to a write
        ("585#416C600005000000", None),  # a segmented one
    ],
)
def test_a_speed_is_known_by_its_address(frame: str, speed: tuple[int, int] | None) -> None:
    stop = SdoStop(5, robot_of((5, 0, "left"), (5, 1, "right")).drives)
    cob_id, data = frame.split("#")
    assert stop.speed(Frame(int(cob_id, 16), bytes.fromhex(data))) == speed


def test_a_narrow_speed_has_a_sign_too() -> None:
    drives = robot_with("zlac8015d").drives
    bits = drives[0].kind.layout.velocity_bits
    stop = SdoStop(1, drives)
    data = bytes.fromhex("4B6C6002") + (-3).to_bytes(bits // 8, "little", signed=True)
    assert stop.speed(Frame(0x581, data.ljust(8, b"\0"))) == (1, -3)


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
    assert world.core.finding.cause.value == "drive restarted"
    assert written_by_the_driver(world, cycles) == []
