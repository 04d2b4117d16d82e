"""What processes do wrong: they die, hang, go mad, lose their supply, their adapter or their leases."""

from __future__ import annotations

from typing import TYPE_CHECKING

from campaign.fault import LONG, SHORT, Arguments, Change, Kind, nothing

if TYPE_CHECKING:
    from campaign.outside import Surroundings
    from campaign.world import World

PROCESSES = ("driver", "velocity", "watchdog", "action")


def _dies(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].die()

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].restart()

    return Kind(f"{name} is killed, and started again later", (0.3, 1.5), nothing, begin, end)


def _hangs(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].hang("fault")

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].go_on("fault")

    return Kind(f"{name} hangs, and goes on later", (0.3, 1.5), nothing, begin, end)


def _hiccup(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].hang("hiccup")

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].go_on("hiccup")

    return Kind(f"{name} gets no processor for 50 to 300 ms", (0.05, 0.3), nothing, begin, end)


def _driver(field: str, *, on: object = True, off: object = False) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.driver, field, on)
        world.driver.heartbeats = given.get("heartbeats", True)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.driver, field, off)

    return begin, end


def _watchdog_deaf(world: World, around: Surroundings, given: Arguments) -> None:
    world.watchdog.fail_bus(True)


def _watchdog_hears(world: World, around: Surroundings, given: Arguments) -> None:
    world.watchdog.fail_bus(False)


def _all_die(world: World, around: Surroundings, given: Arguments) -> None:
    for name in PROCESSES:
        world.processes[name].die()


def _all_restart(world: World, around: Surroundings, given: Arguments) -> None:
    for name in PROCESSES:
        world.processes[name].restart()


def _supply_lost(world: World, around: Surroundings, given: Arguments) -> None:
    _all_die(world, around, given)
    for node in world.drives.bench.nodes.values():
        node.power_cycle(world.clock.now, given["off_s"])


def _leases(field: str, off: object) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world, field, given["value"])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world, field, off)

    return begin, end


PROCESS_FAULTS: dict[str, Kind] = {
    **{f"{name}_dies": _dies(name) for name in PROCESSES},
    **{f"{name}_hangs": _hangs(name) for name in PROCESSES},
    **{f"{name}_hiccup": _hiccup(name) for name in PROCESSES},
    "driver_repeats": Kind(
        "the driver sends its last setpoints for ever",
        (0.8, 3.0),
        lambda r: {"heartbeats": r.random() < 0.8},
        *_driver("repeats"),
    ),
    "driver_ignores_zero": Kind("the driver never sends zero", (0.8, 3.0), nothing, *_driver("ignores_zero")),
    "bus_problem": Kind(
        "the driver's adapter fails", SHORT, nothing, *_driver("bus_problem", on="adapter gone", off="")
    ),
    "watchdog_bus_problem": Kind("the watchdog's adapter fails", SHORT, nothing, _watchdog_deaf, _watchdog_hears),
    "lease_lost": Kind(
        "leases get lost", LONG, lambda r: {"value": r.choice((0.3, 0.9, 1.0))}, *_leases("lease_loss", 0.0)
    ),
    "lease_garbage": Kind(
        "mangled leases come too", LONG, lambda r: {"value": True}, *_leases("lease_garbage", False)
    ),
    "all_processes_restart": Kind(
        "all processes are killed, and started again", LONG, nothing, _all_die, _all_restart
    ),
    "supply_lost": Kind(
        "computer and drives lose their supply, and start again",
        LONG,
        lambda r: {"off_s": r.uniform(0.05, 0.8)},
        _supply_lost,
        _all_restart,
    ),
}  # fmt: skip
