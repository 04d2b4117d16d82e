"""What goes wrong on the bus: cut cables, lost and late frames, a second master, a second drive with a node id."""

from __future__ import annotations

from typing import TYPE_CHECKING

from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, intruder, nothing, speed, wheel

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

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
    "twin_node": Kind(
        "a second drive has the node id of another one, and stands", SHORT, wheel,
        _twin, _no_twin,
    ),
}  # fmt: skip

SECOND_MASTERS = frozenset({"second_master_setpoints", "second_master_nmt", "second_master_sync"})
"""Each is fought rung by rung."""
