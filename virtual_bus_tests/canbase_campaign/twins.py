"""Failures that stop a base, and lies of sensors and wheels, in virtual time: the rows of docs/stop_times.md.

They are the failures of the exit matrix that the pure cores can have. A row has the name of its twin among real
processes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random

from canbase_campaign.fault import Arguments
from canbase_campaign.faults import FAULTS
from canbase_campaign.outside import Surroundings
from canbase_campaign.world import World
from canbase_sim.faults import KINDS, apply
from canbase_velocity.twist import Twist

Begin = Callable[[World, Surroundings, Random], None]
JOYSTICK, GOAL = "joystick", "goal"
"""The source that drives."""
SPEED_MPS = 0.4
"""The base drives at it when something fails."""


@dataclass(frozen=True, slots=True)
class Twin:
    """One failure. `by`: the source that drives. `then_zero_s`: this long after it zero is commanded and measured from;
    0: never.

    `lies`: a sensor or a wheel differs from its description, so a wheel may become faster than ordered.
    """

    what: str
    how: str
    begin: Begin
    by: str = GOAL
    then_zero_s: float = 0.0
    lies: bool = False

    @property
    def key(self) -> tuple[str, str]:
        """Its row."""
        return self.what, self.how


def fault(name: str, **given: object) -> Begin:
    """A fault of the campaign; what is not `given` is drawn."""

    def begin(world: World, around: Surroundings, random: Random) -> None:
        kind = FAULTS[name]
        arguments: Arguments = {**kind.draw(random), **given}
        kind.begin(world, around, arguments)

    return begin


def drive(kind: str, **given: object) -> Begin:
    """A fault of either simulated drive."""

    def begin(world: World, around: Surroundings, random: Random) -> None:
        node, axis = world.drives.place(random.randrange(len(world.robot.drives)))
        placed = {"axis": axis} if "axis" in KINDS[kind][1] else {}
        apply(world.drives.bench.nodes, node, kind, world.clock.now_s, given | placed)

    return begin


def ends(name: str) -> Begin:
    """SIGTERM."""
    return lambda world, around, random: world.processes[name].end()


def _ignores_zero(world: World, around: Surroundings, random: Random) -> None:
    world.driver.keeps_motion = True


def _straight_to_cmd_vel(world: World, around: Surroundings, random: Random) -> None:
    world.intruder.twist = Twist(around.cruise_mps, 0.0)


def _second_master(world: World, around: Surroundings, random: Random) -> None:
    world.intruder.setpoints_mps = around.cruise_mps / 2.0


def _goal_canceled(world: World, around: Surroundings, random: Random) -> None:
    world.action.cancel()


def _joystick_dies(world: World, around: Surroundings, random: Random) -> None:
    world.topics.loss["cmd_vel_joy"] = 1.0


DRIVER, VELOCITY, WATCHDOG, SERVER = "motor_driver", "velocity process", "watchdog", "drive_distance_server"
ZERO_S = 0.2

STOPS: tuple[Twin, ...] = (
    Twin(DRIVER, "SIGINT", ends("driver")),
    Twin(DRIVER, "SIGTERM", ends("driver")),
    Twin(DRIVER, "SIGKILL", fault("driver_dies")),
    Twin(DRIVER, "SIGSTOP", fault("driver_hangs")),
    Twin(DRIVER, "busy loop", fault("cmd_vel_lossy", share=1.0)),
    Twin(DRIVER, "busy loop in its control thread", fault("driver_hangs")),
    Twin(VELOCITY, "SIGINT", ends("velocity")),
    Twin(VELOCITY, "SIGTERM", ends("velocity")),
    Twin(VELOCITY, "SIGKILL", fault("velocity_dies")),
    Twin(VELOCITY, "SIGSTOP", fault("velocity_hangs")),
    Twin(VELOCITY, "busy loop", fault("velocity_hangs")),
    Twin(WATCHDOG, "SIGINT", ends("watchdog")),
    Twin(WATCHDOG, "SIGTERM", ends("watchdog")),
    Twin(WATCHDOG, "SIGKILL", fault("watchdog_dies")),
    Twin(WATCHDOG, "SIGSTOP", fault("watchdog_hangs")),
    Twin(WATCHDOG, "busy loop", fault("watchdog_hangs")),
    Twin(SERVER, "SIGINT", ends("action")),
    Twin(SERVER, "SIGTERM", ends("action")),
    Twin(SERVER, "SIGKILL", fault("action_dies")),
    Twin(SERVER, "SIGSTOP", fault("action_hangs")),
    Twin(SERVER, "busy loop", fault("action_hangs")),
    Twin("client", "SIGINT", _goal_canceled),
    Twin("client", "SIGTERM", _goal_canceled),
    Twin("cable", "cut both ways", fault("cable_cut")),
    Twin("cable", "nothing reaches the drives", fault("cable_cut_to_drives")),
    Twin("cable", "nothing comes from the drives", fault("cable_cut_from_drives")),
    Twin("cable", "of one drive is cut", fault("cable_cut_one_drive")),
    Twin("drive", "silent", fault("drive_silent")),
    Twin("drive", "in fault", fault("drive_fault")),
    Twin("drive", "STO opens", fault("drive_sto")),
    Twin("drive", "reset: without power for 0.5 s", fault("drive_power_cycle", off_s=0.5)),
    Twin("drive", "starts again", fault("drive_resets")),
    Twin(DRIVER, "repeats its last setpoints for ever, then zero is commanded",
         fault("driver_repeats", heartbeats=True),
         JOYSTICK, ZERO_S),
    Twin(DRIVER, "ignores zero, then zero is commanded", _ignores_zero, JOYSTICK, ZERO_S),
    Twin("cmd_vel", "another node publishes to it, then zero is commanded", _straight_to_cmd_vel, JOYSTICK, ZERO_S),
    Twin("second master", "sends setpoints and SYNC", _second_master),
    Twin("joystick", "dies", _joystick_dies, JOYSTICK),
    Twin("odometry", "stale", fault("odometry_lost")),
    Twin("scan", "stale", fault("scan_stale", share=1.0)),
    Twin("emergency stop", "pressed", fault("estop_pressed")),
    Twin("emergency stop", "stale", fault("estop_stale", share=1.0)),
    Twin("all processes", "are killed", fault("all_processes_restart")),
)  # fmt: skip
"""Something stops being there."""

LIES: tuple[Twin, ...] = (
    Twin("drive", "encoder frozen", drive("frozen_encoder")),
    Twin("drive", "actual velocity stuck at 0", drive("stuck_velocity", raw=0)),
    Twin("drive", "actual velocity stuck, then zero is commanded", drive("stuck_velocity"), JOYSTICK, ZERO_S),
    Twin("drive", "ignores its setpoints, then zero is commanded", drive("ignores_setpoints"), JOYSTICK, ZERO_S),
    Twin("encoder", "lost: nothing counts, no speed", drive("encoder_lost"), JOYSTICK),
    Twin("encoder", "frozen: nothing counts, the last speed", drive("encoder_frozen"), JOYSTICK),
    Twin("encoder", "counts backward", drive("encoder_reversed"), JOYSTICK),
    Twin("encoder", "jumps to and fro", drive("encoder_jumping"), JOYSTICK),
    Twin("encoder", "comes and goes", drive("encoder_intermittent"), JOYSTICK),
    Twin("wheel", "blocked", drive("blocked"), JOYSTICK),
    Twin("wheel", "follows half of its setpoint", drive("limited", share=0.5), JOYSTICK),
    Twin("wheel", "motor without force", drive("weak"), JOYSTICK),
    Twin("wheel", "setpoints lost, then zero is commanded", drive("rpdo_lost"), JOYSTICK, ZERO_S),
    Twin("wheel", "feedback lost", drive("tpdo_lost"), JOYSTICK),
    Twin("twin node", "a second drive with the same node id, at standstill", fault("twin_node"), JOYSTICK),
)
"""Something differs from its description."""
TWINS = (*STOPS, *(replace(twin, lies=True) for twin in LIES))
"""Those that `canbase prove qualify` tries too, one by one."""

DELIVERY: tuple[Twin, ...] = (
    Twin("adapter", "of motor_driver fails", fault("bus_problem")),
    Twin("adapter", "of the watchdog fails", fault("watchdog_bus_problem")),
    Twin("velocity_mux", "its orders do not arrive", fault("mux_lossy", share=1.0)),
    Twin("motor_driver/status", "does not arrive", fault("status_lost")),
    Twin("joystick", "comes 2 s late, then zero is commanded", fault("orders_delayed", value=2.0), JOYSTICK, ZERO_S),
    Twin("scan", "repeats its readings with new stamps", fault("scanner_frozen", margin_m=None)),
    Twin("scan", "repeats three scans by turns", fault("scanner_by_turns", margin_m=None)),
    Twin("frames", "come twice, one of five", fault("frame_duplication", value=0.2)),
)
"""Something is not sent, or arrives late, again or twice."""
MEASURED = (*TWINS, *DELIVERY)
"""Every row."""
