"""How processes fail: they die, hang, misbehave, lose their supply, their adapter or their leases."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

from canbase_campaign.driver_process import SETPOINTS
from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, nothing, wheel
from canbase_campaign.operator_faults import goes_on

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

TORN_AT = 100
"""In a record of stops: within the first of its two pages."""
TURN_S = 0.01
SUSPENDED_S = (0.5, 8.0)
"""Every drive has stopped by itself after less, and every wheel has come to rest: more shows nothing new [s]."""
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


def _omits(world: World, around: Surroundings, given: Arguments) -> None:
    node_id, axis = world.drives.place(given["wheel"])
    world.driver.omits = SETPOINTS[axis] + node_id


def _omits_nothing(world: World, around: Surroundings, given: Arguments) -> None:
    world.driver.omits = 0


def _asked_to_end(world: World, around: Surroundings, given: Arguments) -> None:
    world.driver.end()


def _ended(world: World, around: Surroundings, given: Arguments) -> None:
    world.driver.die()
    world.driver.restart()


def _torn(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        process = world.processes[name]
        process.die()
        data = process.disk.file.data  # type: ignore[attr-defined]
        if data is not None:
            data[TORN_AT] ^= 0xFF

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].restart()

    return Kind(f"{name} is killed while it writes its record of stops", (0.3, 1.5), nothing, begin, end)


def _starved(name: str) -> Kind:
    """Again and again it gets its processor just before it is missed."""
    waits: dict[int, bool] = {}

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        waits[id(given)] = True
        away_s = given["share"] * world.robot.timeouts.watchdog_s

        def away() -> None:
            if id(given) in waits:
                world.processes[name].hang("starved")
                world.clock.after(away_s, back)

        def back() -> None:
            world.processes[name].go_on("starved")
            world.clock.after(TURN_S, away)

        away()

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        waits.pop(id(given), None)
        world.processes[name].go_on("starved")

    def draw(random: Random) -> Arguments:
        return {"share": random.uniform(0.6, 0.95)}

    return Kind(f"{name} gets its processor for moments only", LONG, draw, begin, end)


def _crashes(name: str) -> Kind:
    """It is started again, as its service manager does, and dies again."""

    def crash(world: World, around: Surroundings, given: Arguments, number: int) -> None:
        process = world.processes[name]
        process.die() if number % 2 == 0 else process.restart()

    def live(world: World, around: Surroundings, given: Arguments, number: int) -> None:
        world.processes[name].restart()

    return Kind(f"{name} is killed again and again", (1.0, 3.0), nothing, *goes_on(crash, live, 0.25))


def _all_hang(world: World, around: Surroundings, given: Arguments, by: str = "load") -> None:
    for name in PROCESSES:
        world.processes[name].hang(by)


def _all_go_on(world: World, around: Surroundings, given: Arguments, by: str = "load") -> None:
    for name in PROCESSES:
        world.processes[name].go_on(by)


def _suspend(world: World, around: Surroundings, given: Arguments) -> None:
    world.computer.suspend()
    _all_hang(world, around, given, "suspend")


def _resume(world: World, around: Surroundings, given: Arguments) -> None:
    world.computer.resume()
    _all_go_on(world, around, given, "suspend")


def _old_data(world: World, around: Surroundings, given: Arguments) -> None:
    for name in PROCESSES:
        world.processes[name].die()
    for disk in (world.driver.disk, world.watchdog.disk, world.velocity.disk):
        disk.file.forget()


def _slewed(random: Random) -> Arguments:
    """chrony's fastest, by 1 s; or a clock that has drifted since an unknown time."""
    rate, since_s = random.choice(((0.0833, 0.0), (0.0005, random.uniform(0.0, 3600.0))))
    return {"source": random.choice(("joystick", "navigation")), "rate": random.choice((-1.0, 1.0)) * rate,
            "since_s": since_s}  # fmt: skip


def _clock_slewed(world: World, around: Surroundings, given: Arguments) -> None:
    since_s, rate = world.computer.now_s - given["since_s"], given["rate"]
    world.velocity.clocks_behind[given["source"]] = lambda now_s: max(-1.0, min(1.0, rate * (now_s - since_s)))


def _clock_right(world: World, around: Surroundings, given: Arguments) -> None:
    world.velocity.clocks_behind.pop(given["source"], None)


def _disks(hang: bool) -> Change:
    def change(world: World, around: Surroundings, given: Arguments) -> None:
        for disk in (world.driver.disk, world.watchdog.disk, world.velocity.disk):
            disk.file.hangs = hang

    return change


def _other_version(older: bool) -> Change:
    """The velocity process is replaced, as by an upgrade of one part alone."""

    def change(world: World, around: Surroundings, given: Arguments) -> None:
        world.velocity.die()
        world.lease_older = older
        world.velocity.restart()

    return change


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
        node.power_cycle(world.clock.now_s, given["off_s"])


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
    **{f"{name}_crashes": _crashes(name) for name in PROCESSES},
    "all_hang": Kind("no process gets a processor", (0.05, 1.5), nothing, _all_hang, _all_go_on),
    "suspend": Kind("the computer is suspended: its clock does not run", SUSPENDED_S, nothing, _suspend, _resume),
    "sender_clock_slewed": Kind("the clock of a source's computer is slewed, or has drifted", LONG, _slewed,
                                _clock_slewed, _clock_right),
    "disk_returns_old_data": Kind(
        "all processes are killed, and find their records of stops without the last write", LONG, nothing,
        _old_data, _all_restart,
    ),
    "setpoints_not_sent": Kind(
        "the driver sends no setpoints to one axis", (0.8, 3.0), wheel, _omits, _omits_nothing
    ),
    "driver_asked_to_end": Kind(
        "the driver is asked to end, and started again later", (1.0, 2.0), nothing, _asked_to_end, _ended
    ),
    "driver_never_lets_go": Kind(
        "the driver leaves the power on at a stand that nothing proves", (2.0, 4.0), nothing, *_driver("never_lets_go")
    ),
    **{f"{name}_dies_torn": _torn(name) for name in ("driver", "watchdog")},
    "watchdog_starved": _starved("watchdog"),
    "driver_ignores_zero": Kind("the driver never sends zero", (0.8, 3.0), nothing, *_driver("ignores_zero")),
    "bus_problem": Kind(
        "the driver's adapter fails", SHORT, nothing, *_driver("bus_problem", on="adapter gone", off="")
    ),
    "watchdog_bus_problem": Kind("the watchdog's adapter fails", SHORT, nothing, _watchdog_deaf, _watchdog_hears),
    "lease_lost": Kind(
        "leases get lost", LONG, lambda r: {"value": r.choice((0.3, 0.9, 1.0))}, *_leases("lease_loss", 0.0)
    ),
    "driver_thread_stalls": Kind(
        "the thread of the driver's topics stands still, that of its bus does not", LONG, nothing,
        *_driver("ros_stalls"),
    ),
    "disk_hangs": Kind("no write to the disk ends", LONG, nothing, _disks(True), _disks(False)),
    "lease_of_older_version": Kind(
        "the velocity process is replaced by an older version, whose leases differ", LONG, nothing,
        _other_version(True), _other_version(False),
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
