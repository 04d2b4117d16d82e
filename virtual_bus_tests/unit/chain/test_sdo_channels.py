"""A drive with further SDO channels (1201h to 127Fh): nobody watches their identifiers, so none of them may be open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_sim.personality import GENERIC, PERSONALITIES, Extra, sdo_channel
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import World

MONITORED = key(0x1016, 1)
UNMONITORED = "23 16 10 01 00 00 00 00"
REQUESTS, ANSWERS = 0x6A1, 0x6C1
OPEN = sdo_channel(0x1201, REQUESTS, ANSWERS)
FORWARD = Twist2D(0.3, 0.0)


def world_with(monkeypatch: pytest.MonkeyPatch, *extras: Mapping[int, Extra]) -> World:
    """Its drives have these objects after each power on and NMT reset."""
    joined = {place: extra for each in extras for place, extra in each.items()}
    monkeypatch.setitem(PERSONALITIES, "generic", replace(GENERIC, extras=joined))
    return World()


def value(world: World, place: int) -> int:
    """Of the left drive."""
    return int(world.node.dictionary.values[place])


# power on, 1201h open as the drive was delivered ── closed by the boot ── 0.3 m/s ── 1016h:1 = 0 over 6A1h: not taken
@pytest.mark.parametrize("requests", [(UNMONITORED,), ("21 16 10 01 04 00 00 00", "07 00 00 00 00 00 00 00")])
def test_a_channel_that_is_open_from_the_start_is_closed(
    requests: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_with(monkeypatch, OPEN)
    world.drive(FORWARD, seconds=1.2)
    before = value(world, MONITORED)
    for data in requests:
        world.inject(REQUESTS, data)
        world.run(0.05)
    assert (value(world, MONITORED), world.sent(ANSWERS)) == (before, [])
    assert world.core.state is DriverState.ENABLED


# the same with a second open channel behind the first one, and with one that a tool has stored open (1010h)
@pytest.mark.parametrize("stored", [False, True])
def test_further_channels_are_closed_too(stored: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    second = sdo_channel(0x1202) if stored else sdo_channel(0x1202, 0x6A2, 0x6C2)
    world = world_with(monkeypatch, OPEN, second)
    if stored:
        world.node.dictionary.values |= {key(0x1202, 1): 0x6A2, key(0x1202, 2): 0x6C2}
        world.node.dictionary.save()
    world.enable()
    before = value(world, MONITORED)
    world.inject(0x6A2, UNMONITORED)
    world.run(0.05)
    assert (value(world, MONITORED), world.sent(0x6C2)) == (before, [])


# power on ── neither identifier can be changed: the drive never gets power, and the message names it
def test_a_drive_that_keeps_its_channel_open_gets_no_power(monkeypatch: pytest.MonkeyPatch) -> None:
    fixed = {place: replace(extra, writable=False) for place, extra in OPEN.items()}
    world = world_with(monkeypatch, fixed)
    assert not world.run(5.0, lambda: any(world.powered))
    told = " ".join(node.boot_error for node in world.core._drives.nodes)
    assert "1201h:1 stays at 000006A1h" in told
    assert "manufacturer's tool" in told


# 0.3 m/s ── another client opens the channel: expedited, in segments, in a block ── trip ── closed before a reset
@pytest.mark.parametrize(
    "requests",
    [
        ("23 01 12 01 A1 06 00 00",),
        ("23 01 12 02 C1 06 00 00",),
        ("21 01 12 01 04 00 00 00", "07 A1 06 00 00 00 00 00"),
        ("C2 01 12 01 04 00 00 00", "81 A1 06 00 00 00 00 00", "CD 00 00 00 00 00 00 00"),
    ],
)
def test_opening_one_on_a_drive_with_power_is_a_sign_of_another_master(
    requests: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_with(monkeypatch, OPEN)
    world.drive(FORWARD, seconds=1.2)
    for data in requests:
        world.inject(0x601, data)
        world.run(0.01)
    assert world.watchdog is not None
    assert world.watchdog.status.verdict.cause is TripCause.FOREIGN_MASTER
    assert "an SDO that writes 1201h" in world.watchdog.status.verdict.detail
    world.command = Twist2D.ZERO
    world.run(3.0)
    assert not any(world.powered)
    assert is_closed(world)
    assert world.reset().done
    world.run_until(DriverState.ENABLED, 3.0)


def is_closed(world: World) -> bool:
    """1201h of the left drive."""
    return (value(world, key(0x1201, 1)) | value(world, key(0x1201, 2))) >> 31 == 1


def open_by(world: World) -> None:
    """Another client opens 1201h of the left drive by its default channel."""
    for data in ("23 01 12 01 A1 06 00 00", "23 01 12 02 C1 06 00 00"):
        world.inject(0x601, data)
        world.run(0.004)


# latched, no power ── opened from elsewhere: no trip, nothing has power ── booted anew, closed
def test_opening_one_while_there_is_no_power_is_undone(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_with(monkeypatch, OPEN)
    world.drive(FORWARD, seconds=1.2)
    world.core.request_stop()
    world.command = Twist2D.ZERO
    world.run(2.0)
    open_by(world)
    assert not is_closed(world)
    world.run(3.0)
    assert is_closed(world)


# power on ── the boot closes it ── so much later, in the boot, opened ── closed before there is any power
@pytest.mark.parametrize("later_s", [0.002, 0.01, 0.05, 0.1])
@pytest.mark.parametrize("extras", [OPEN, sdo_channel(0x1201)])
def test_opening_one_during_the_boot_is_undone_before_there_is_power(
    extras: Mapping[int, Extra], later_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = world_with(monkeypatch, extras)
    looks = bytes.fromhex("40 01 12 01 00 00 00 00")
    assert world.run(3.0, lambda: looks in world.sent(0x601))
    world.run(later_s)
    assert not world.core.snapshot(world.now_s).drives[0].configured
    open_by(world)
    assert not world.run(3.0, lambda: any(world.powered) and not is_closed(world))
    assert (world.core.state, is_closed(world)) == (DriverState.ENABLED, True)


# latched ── the drive starts anew: its channel is open as delivered, 1016h:1 = 0 by it ── booted, closed and set again
def test_what_comes_by_it_between_a_restart_and_the_boot_is_set_again(monkeypatch: pytest.MonkeyPatch) -> None:
    world = world_with(monkeypatch, OPEN)
    world.drive(FORWARD, seconds=1.2)
    before = value(world, MONITORED)
    world.core.request_stop()
    world.command = Twist2D.ZERO
    world.run(2.0)
    world.node.power_cycle(world.now_s)
    while not is_closed(world) or not value(world, MONITORED):
        world.inject(REQUESTS, UNMONITORED)
        world.run(0.01)
    world.inject(REQUESTS, UNMONITORED)
    world.run(3.0)
    assert (is_closed(world), value(world, MONITORED)) == (True, before)
