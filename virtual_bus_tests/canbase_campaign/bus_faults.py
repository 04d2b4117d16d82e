"""What goes wrong on the bus: cut cables, lost and late frames, a second master, a second drive with a node id."""

from __future__ import annotations

from typing import TYPE_CHECKING

from canbase_campaign.can_bus import COMPUTER
from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, intruder, nothing, speed, wheel
from canbase_campaign.operator_faults import goes_on

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

RESTART_S = 0.1
"""restart-ms of the interface."""
ALL_DRIVES = 0xFF
"""Only driver and watchdog are parted; fewer bits: drives that are with the driver, by their place."""
NMT_COMMANDS = (b"\x02\x00", b"\x80\x00", b"\x81\x00", b"\x82\x00", b"\x01\x00", b"\x80\x01", b"\x02\x02")
"""Stop, pre-operational, reset node, reset communication, start; some to one node alone."""


def _twin(world: World, around: Surroundings, given: Arguments) -> None:
    world.intruder.twin = world.drives.place(given["wheel"])[0]


def _no_twin(world: World, around: Surroundings, given: Arguments) -> None:
    world.intruder.twin = 0


def _bus(field: str) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.bus.disturbance, field, given["value"])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.bus.disturbance, field, 0.0)

    return begin, end


def _cut(to_drives: bool, to_computer: bool) -> tuple[Change, Change]:
    def ways(world: World) -> set[tuple[str, str]]:
        computer, drives = ("driver", "watchdog"), [f"drive{node_id}" for node_id in world.drives.bench.nodes]
        there = {(here, drive) for here in computer for drive in drives if to_drives}
        return there | {(drive, here) for here in computer for drive in drives if to_computer}

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.bus.disturbance.blocked |= ways(world)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.bus.disturbance.blocked -= ways(world)

    return begin, end


def _hold(held: bool) -> Change:
    def change(world: World, around: Surroundings, given: Arguments) -> None:
        for member in world.bus.members:
            if member.name in COMPUTER:
                member.hold(held)

    return change


def _unacknowledged() -> tuple[Change, Change]:
    cut, join = _cut(False, True)
    hold, release = _hold(True), _hold(False)

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        cut(world, around, given)
        hold(world, around, given)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        join(world, around, given)
        release(world, around, given)
        world.driver.bus_problem = ""
        world.watchdog.fail_bus(False)

    return begin, end


def _parted(world: World, given: Arguments) -> set[tuple[str, str]]:
    drives = [f"drive{node_id}" for node_id in world.drives.bench.nodes]
    with_driver = {"driver", *(drive for at, drive in enumerate(drives) if given["drives"] >> at & 1)}
    others = {"watchdog", *drives} - with_driver
    if given["drives"] == ALL_DRIVES:
        with_driver, others = {"driver"}, {"watchdog"}
    return {(here, there) for here in with_driver for there in others} | {
        (here, there) for here in others for there in with_driver
    }


def _part(world: World, around: Surroundings, given: Arguments) -> None:
    world.bus.disturbance.blocked |= _parted(world, given)


def _unite(world: World, around: Surroundings, given: Arguments) -> None:
    world.bus.disturbance.blocked -= _parted(world, given)


def _burst(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    world.bus.disturbance.loss = float(number % given["of"] == 0)


def _no_burst(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    world.bus.disturbance.loss = 0.0


def _off_and_on(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """Bus-off, and started again by the kernel (restart-ms), in turn."""
    off = number % 2 == 0
    world.driver.bus_problem = "bus-off" if off else ""
    world.watchdog.fail_bus(off)


def _on(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    world.driver.bus_problem = ""
    world.watchdog.fail_bus(False)


def _adapter_fails(world: World, around: Surroundings, given: Arguments) -> None:
    _off_and_on(world, around, given, 0)


def _adapter_works(world: World, around: Surroundings, given: Arguments) -> None:
    _on(world, around, given, 0)


BUS_FAULTS: dict[str, Kind] = {
    "second_master_setpoints": Kind(
        "a second master sends enabling setpoints and SYNC",
        SHORT,
        lambda r: {"speed": speed(r)},
        *intruder("setpoints_mps", "speed", 0.0),
    ),
    "second_master_nmt": Kind(
        "a second master sends NMT commands",
        (0.02, 0.3),
        lambda r: {"nmt": r.choice(NMT_COMMANDS)},
        *intruder("nmt", "nmt", b""),
    ),
    "second_master_sync": Kind(
        "a second master sends SYNC", SHORT, lambda r: {"on": True}, *intruder("syncs", "on", False)
    ),
    "cable_cut": Kind("computer and drives do not hear each other", SHORT, nothing, *_cut(True, True)),
    "cable_cut_to_drives": Kind("the drives do not hear the computer", SHORT, nothing, *_cut(True, False)),
    "cable_cut_from_drives": Kind("the computer does not hear the drives", SHORT, nothing, *_cut(False, True)),
    "frame_loss": Kind("frames get lost", LONG, lambda r: {"value": r.uniform(0.01, 0.3)}, *_bus("loss")),
    "frame_duplication": Kind(
        "frames come twice", LONG, lambda r: {"value": r.uniform(0.01, 0.3)}, *_bus("duplication")
    ),
    "frame_delay": Kind("frames come late", LONG, lambda r: {"value": r.uniform(0.001, 0.03)}, *_bus("delay_s")),
    "no_acknowledge": Kind(
        "no node acknowledges the computer's frames, which are sent when one does", SHORT, nothing, *_unacknowledged()
    ),
    "adapter_fails": Kind(
        "the adapter that driver and watchdog share fails", SHORT, nothing, _adapter_fails, _adapter_works
    ),
    "controller_restarts": Kind(
        "the computer's CAN controller is bus-off and starts again, several times", LONG, nothing,
        *goes_on(_off_and_on, _on, RESTART_S),
    ),
    "adapter_batches": Kind(
        "the computer's adapter passes frames in batches", LONG,
        lambda r: {"value": r.choice((0.002, 0.008, r.uniform(0.01, 0.1)))}, *_bus("batch_s"),
    ),
    "partition": Kind(
        "driver and watchdog do not hear each other, nor each other's drives", LONG,
        lambda r: {"drives": r.choice((ALL_DRIVES, ALL_DRIVES, r.randrange(ALL_DRIVES)))}, _part, _unite,
    ),
    "loss_bursts": Kind(
        "all frames of a moment get lost, again and again", LONG, lambda r: {"of": r.choice((2, 3, 5))},
        *goes_on(_burst, _no_burst),
    ),
    "babbling_node": Kind(
        "a node sends the lowest identifier all the time", SHORT,
        lambda r: {"share": r.choice((1.5, r.uniform(0.4, 0.9)))}, *intruder("babbles", "share", 0.0),
    ),
    "twin_node": Kind(
        "a second drive has the node id of another one, and stands", SHORT, wheel,
        _twin, _no_twin,
    ),
}  # fmt: skip

SECOND_MASTERS = frozenset({"second_master_setpoints", "second_master_nmt", "second_master_sync"})
"""Each is fought rung by rung."""
