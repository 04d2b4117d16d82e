"""What can go wrong: each fault with its sentence, how long it lasts, what is drawn for it, how it begins and ends.

Faults are plain switches of the processes, the bus and the drives. Several may hold at once; each end undoes its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING, Any

from campaign import bench_faults as bench
from campaign import people
from campaign.scanner import LIES, Lie
from canbase_velocity.twist import Twist

if TYPE_CHECKING:
    from campaign.outside import Surroundings
    from campaign.world import World

Arguments = Mapping[str, Any]
Change = Callable[["World", "Surroundings", Arguments], None]
WHEELS = 8


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """One fault of one scenario. Times from its start [s]."""

    name: str
    start_s: float
    duration_s: float
    arguments: Arguments

    def __str__(self) -> str:
        given = ", ".join(f"{key}={value}" for key, value in self.arguments.items())
        return f"{self.start_s:5.2f} s  fault {self.name}({given}), {self.duration_s:.2f} s"


@dataclass(frozen=True, slots=True)
class Kind:
    """One row of the table."""

    sentence: str
    lasts_s: tuple[float, float]
    draw: Callable[[Random], Arguments]
    begin: Change
    end: Change
    encoder_lies: bool = False
    """A position is not that of the wheel: odometry cannot be compared with the truth."""


def _nothing(random: Random) -> Arguments:
    return {}


def _stays(world: World, around: Surroundings, given: Arguments) -> None:
    """This fault does not end by itself."""


def _wheel(random: Random) -> Arguments:
    """One of the robot's wheels; a robot with fewer counts on from the first one."""
    return {"wheel": random.randrange(WHEELS)}


def _dies(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].die()

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].restart()

    return Kind(f"{name} is killed, and started again later", (0.3, 1.5), _nothing, begin, end)


def _hangs(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].hang("fault")

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].go_on("fault")

    return Kind(f"{name} hangs, and goes on later", (0.3, 1.5), _nothing, begin, end)


def _hiccup(name: str) -> Kind:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].hang("hiccup")

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.processes[name].go_on("hiccup")

    return Kind(f"{name} gets no processor for 50 to 300 ms", (0.05, 0.3), _nothing, begin, end)


def _driver(field: str, *, on: object = True, off: object = False) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.driver, field, on)
        world.driver.heartbeats = given.get("heartbeats", True)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.driver, field, off)

    return begin, end


def _intruder(field: str, key: str, off: object) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.intruder, field, given[key])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.intruder, field, off)

    return begin, end


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


def _fails(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).fail(world.drives.place(given["wheel"])[1], 0x7305, holds=True)


def _heals(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).heal(world.drives.place(given["wheel"])[1])


def _power_cycle(world: World, around: Surroundings, given: Arguments) -> None:
    world.drives.node(given["wheel"]).power_cycle(world.clock.now, given["off_s"])


def _axis_fault(field: str, value: Callable[[Any], object], off: object) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        axis = world.drives.axis(given["wheel"])
        setattr(axis.faults, field, value(axis))

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        setattr(world.drives.axis(given["wheel"]).faults, field, off)

    return begin, end


def _topic_lost(topic: str) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        world.topics.loss[topic] = given.get("share", 1.0)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        world.topics.loss.pop(topic, None)

    return begin, end


def _pressed(world: World, around: Surroundings, given: Arguments) -> None:
    around.press(True)


def _released(world: World, around: Surroundings, given: Arguments) -> None:
    around.press(False)


def _wall(world: World, around: Surroundings, given: Arguments) -> None:
    around.put_wall(given["margin_m"])


def _no_wall(world: World, around: Surroundings, given: Arguments) -> None:
    around.take_wall()


def _scanner_lies(name: str, lie: Lie) -> Kind:
    """Mostly a wall appears while it lies."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        if around.scanner is None:
            around.look_closely()
        assert around.scanner is not None
        around.scanner.begin(name)
        if given["margin_m"] is not None:
            around.put_wall(given["margin_m"])

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        assert around.scanner is not None
        around.scanner.end(name)
        around.take_wall()

    def draw(random: Random) -> Arguments:
        return {"margin_m": random.choice((None, random.uniform(0.0, 0.3), random.uniform(0.0, 0.3)))}

    return Kind(lie.sentence, (1.5, 3.5), draw, begin, end)


def _watchdog_deaf(world: World, around: Surroundings, given: Arguments) -> None:
    world.watchdog.fail_bus(True)


def _watchdog_hears(world: World, around: Surroundings, given: Arguments) -> None:
    world.watchdog.fail_bus(False)


SOURCES = ("cmd_vel_joy", "cmd_vel_nav")


def _network(field: str) -> tuple[Change, Change]:
    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        for topic in SOURCES:
            getattr(world.topics, field)[topic] = given["value"]

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        for topic in SOURCES:
            getattr(world.topics, field).pop(topic, None)

    return begin, end


def _twice(world: World, around: Surroundings, given: Arguments) -> None:
    world.topics.twice |= set(SOURCES)


def _once(world: World, around: Surroundings, given: Arguments) -> None:
    world.topics.twice.clear()


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


def _share(random: Random) -> Arguments:
    return {"share": random.choice((1.0, 1.0, random.uniform(0.1, 1.0)))}


def _strange_twist(random: Random) -> Arguments:
    """Mostly a motion, sometimes nonsense."""
    nonsense = Twist(math.nan, math.inf)
    motion = Twist(_speed(random), random.choice((0.0, random.uniform(-2.0, 2.0))))
    return {"twist": nonsense if random.random() < 0.1 else motion}


def _speed(random: Random) -> float:
    return random.choice((-1.0, 1.0)) * random.uniform(0.15, 0.8)


NMT_COMMANDS = (b"\x02\x00", b"\x80\x00", b"\x81\x00", b"\x82\x00", b"\x01\x00", b"\x80\x01", b"\x02\x02")
"""Stop, pre-operational, reset node, reset communication, start; some to one node alone."""
PROCESSES = ("driver", "velocity", "watchdog", "action")
LONG, SHORT = (0.3, 1.5), (0.1, 1.0)

FAULTS: dict[str, Kind] = {
    **{f"{name}_dies": _dies(name) for name in PROCESSES},
    **{f"{name}_hangs": _hangs(name) for name in PROCESSES},
    **{f"{name}_hiccup": _hiccup(name) for name in PROCESSES},
    "driver_repeats": Kind(
        "the driver sends its last setpoints for ever",
        (0.8, 3.0),
        lambda r: {"heartbeats": r.random() < 0.8},
        *_driver("repeats"),
    ),
    "driver_ignores_zero": Kind("the driver never sends zero", (0.8, 3.0), _nothing, *_driver("ignores_zero")),
    "straight_to_cmd_vel": Kind(
        "somebody publishes to cmd_vel",
        LONG,
        _strange_twist,
        *_intruder("twist", "twist", None),
    ),
    "second_master_setpoints": Kind(
        "a second master sends enabling setpoints and SYNC",
        SHORT,
        lambda r: {"speed": _speed(r)},
        *_intruder("setpoints_mps", "speed", 0.0),
    ),
    "second_master_nmt": Kind(
        "a second master sends NMT commands",
        (0.02, 0.3),
        lambda r: {"nmt": r.choice(NMT_COMMANDS)},
        *_intruder("nmt", "nmt", b""),
    ),
    "second_master_sync": Kind(
        "a second master sends SYNC", SHORT, lambda r: {"on": True}, *_intruder("syncs", "on", False)
    ),
    "cable_cut": Kind("computer and drives do not hear each other", SHORT, _nothing, *_cut(True, True)),
    "cable_cut_to_drives": Kind("the drives do not hear the computer", SHORT, _nothing, *_cut(True, False)),
    "cable_cut_from_drives": Kind("the computer does not hear the drives", SHORT, _nothing, *_cut(False, True)),
    "cable_cut_one_drive": Kind("one drive is cut off", SHORT, _wheel, *bench.suffer("cut", bench.join)),
    "drive_silent": Kind("one drive hears and says nothing", SHORT, _wheel, *bench.suffer("silent", bench.speak)),
    "frame_loss": Kind("frames get lost", LONG, lambda r: {"value": r.uniform(0.01, 0.3)}, *_bus("loss")),
    "frame_duplication": Kind(
        "frames come twice", LONG, lambda r: {"value": r.uniform(0.01, 0.3)}, *_bus("duplication")
    ),
    "frame_delay": Kind("frames come late", LONG, lambda r: {"value": r.uniform(0.001, 0.03)}, *_bus("delay_s")),
    "drive_fault": Kind("one drive is in fault", SHORT, _wheel, _fails, _heals),
    "drive_power_cycle": Kind(
        "one drive is off for a while", SHORT, lambda r: {**_wheel(r), "off_s": r.uniform(0.05, 0.8)}, _power_cycle,
        _stays,
    ),
    "frozen_encoder": Kind(
        "a position stands still",
        LONG,
        _wheel,
        *_axis_fault("frozen_position", lambda axis: axis.position(), None),
        encoder_lies=True,
    ),
    "stuck_velocity": Kind(
        "an actual velocity stands still",
        LONG,
        _wheel,
        *_axis_fault("stuck_velocity", lambda axis: axis.velocity(), None),
    ),
    "drive_ignores_setpoints": Kind(
        "a drive ignores setpoints", LONG, _wheel, *_axis_fault("ignores_setpoints", lambda axis: True, False)
    ),
    "odometry_lost": Kind("odom does not arrive", SHORT, _nothing, *_topic_lost("odom")),
    "status_lost": Kind("motor_driver/status does not arrive", SHORT, _nothing, *_topic_lost("motor_driver/status")),
    "cmd_vel_lossy": Kind(
        "messages of cmd_vel get lost", (0.3, 2.5), _share, *_topic_lost("cmd_vel")
    ),
    "mux_lossy": Kind(
        "orders of the mux do not reach the filter in its own process", (0.5, 4.0), _share, *_topic_lost("cmd_vel_mux")
    ),
    "scan_stale": Kind("no scan arrives", LONG, _nothing, *_topic_lost("scan")),
    "estop_stale": Kind("the stop button is not heard", LONG, _nothing, *_topic_lost("estop_state")),
    "obstacle": Kind(
        "an obstacle appears", (1.0, 3.0), lambda r: {"margin_m": r.uniform(0.0, 0.3)}, _wall, _no_wall
    ),
    "estop_pressed": Kind("the emergency stop is pressed and released", (0.1, 2.5), _nothing, _pressed, _released),
    "bus_problem": Kind(
        "the driver's adapter fails", SHORT, _nothing, *_driver("bus_problem", on="adapter gone", off="")
    ),
    "watchdog_bus_problem": Kind("the watchdog's adapter fails", SHORT, _nothing, _watchdog_deaf, _watchdog_hears),
    "lease_lost": Kind(
        "leases get lost", LONG, lambda r: {"value": r.choice((0.3, 0.9, 1.0))}, *_leases("lease_loss", 0.0)
    ),
    "lease_garbage": Kind(
        "mangled leases come too", LONG, lambda r: {"value": True}, *_leases("lease_garbage", False)
    ),
    "encoder_lost": Kind(
        "all that hangs on one encoder shows nothing",
        LONG,
        _wheel,
        *bench.suffer("encoder_lost", bench.heal_encoder),
        encoder_lies=True,
    ),
    "encoder_frozen": Kind(
        "an encoder counts nothing and shows its last speed",
        LONG,
        _wheel,
        *bench.suffer("encoder_frozen", bench.heal_encoder),
        encoder_lies=True,
    ),
    "encoder_reversed": Kind(
        "an encoder counts backward", LONG, _wheel, *bench.suffer("encoder_reversed", bench.heal_encoder),
        encoder_lies=True,
    ),
    "encoder_scaled": Kind(
        "an encoder counts a share of the motion",
        LONG,
        lambda r: {**_wheel(r), "factor": r.choice((0.3, 0.5, 2.0))},
        *bench.suffer("encoder_scaled", bench.heal_encoder),
        encoder_lies=True,
    ),
    "encoder_jumping": Kind(
        "an encoder jumps to and fro", LONG, _wheel, *bench.suffer("encoder_jumping", bench.heal_encoder),
        encoder_lies=True,
    ),
    "encoder_intermittent": Kind(
        "an encoder comes and goes",
        LONG,
        lambda r: {**_wheel(r), "off_s": r.uniform(0.03, 0.2)},
        *bench.suffer("encoder_intermittent", bench.heal_encoder),
        encoder_lies=True,
    ),
    "wheel_blocked": Kind("something holds a wheel", LONG, _wheel, *bench.suffer("blocked", bench.let_loose)),
    "wheel_limited": Kind(
        "a drive follows a share of its setpoint",
        LONG,
        lambda r: {**_wheel(r), "share": r.uniform(0.0, 0.7)},
        *bench.suffer("limited", bench.unlimit),
    ),
    "motor_weak": Kind(
        "a motor has a share of its force",
        LONG,
        lambda r: {**_wheel(r), "share": r.choice((0.0, r.uniform(0.0, 0.5)))},
        *bench.suffer("weak", bench.strengthen),
    ),
    "setpoints_lost": Kind(
        "setpoints do not reach one drive, or one of several does",
        LONG,
        lambda r: {**_wheel(r), "every": r.choice((0, 0, 2, 5))},
        *bench.suffer("rpdo_lost", bench.hear_setpoints),
    ),
    "feedback_lost": Kind(
        "one drive's feedback is lost", LONG, _wheel, *bench.suffer("tpdo_lost", bench.give_feedback)
    ),
    "drive_sto": Kind("STO opens at one drive", SHORT, _wheel, *bench.suffer("sto", bench.give_torque)),
    "drive_resets": Kind("one drive starts again", SHORT, _wheel, *bench.suffer("reset_node", bench.stay)),
    "drive_bus_off": Kind(
        "one drive's CAN controller leaves the bus", SHORT, _wheel, *bench.suffer("bus_off", bench.stay)
    ),
    "twin_node": Kind(
        "a second drive has the node id of another one, and stands", SHORT, _wheel,
        _twin, _no_twin,
    ),
    "all_processes_restart": Kind(
        "all processes are killed, and started again", LONG, _nothing, _all_die, _all_restart
    ),
    "supply_lost": Kind(
        "computer and drives lose their supply, and start again",
        LONG,
        lambda r: {"off_s": r.uniform(0.05, 0.8)},
        _supply_lost,
        _all_restart,
    ),
    "stick_held": Kind(
        "a stick is held through everything", (0.8, 4.0), people.steady,
        *people.goes_on(people.hold_stick, people.release_stick),
    ),
    "two_hands": Kind(
        "joystick and navigation order opposite motions", LONG, people.steady, *people.goes_on(people.two_hands)
    ),
    "button_tapped": Kind(
        "the emergency stop is pressed and released again and again", (0.05, 0.6), _nothing,
        *people.goes_on(people.tap_button, people.release_button),
    ),
    "resets_too_early": Kind(
        "an operator resets again and again", LONG, _nothing, *people.goes_on(people.reset_again, every_s=0.2)
    ),
    "radio_gap": Kind("the joystick's radio is lost for a moment", SHORT, _nothing, *_topic_lost("cmd_vel_joy")),
    "orders_delayed": Kind(
        "the network delays what sources order", LONG, lambda r: {"value": r.uniform(0.2, 2.0)}, *_network("delay_s")
    ),
    "orders_shuffled": Kind(
        "the network reorders what sources order", LONG, lambda r: {"value": r.uniform(0.02, 0.25)},
        *_network("shuffles_s"),
    ),
    **{name: _scanner_lies(name, lie) for name, lie in LIES.items()},
    "orders_twice": Kind("the network duplicates what sources order", LONG, _nothing, _twice, _once),
}  # fmt: skip
"""Every fault that a scenario may draw."""
