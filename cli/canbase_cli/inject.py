"""`canbase inject`: breaks one thing of a simulated robot, to see how the others stop it."""

from __future__ import annotations

import signal
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from canbase_cli.options import BenchOption, ConfigOption, named
from canbase_runtime.terminal import FAILED, WRONG_INPUT, colour, fail, load_config

if TYPE_CHECKING:
    from canbase_config.robot import Robot

SIGNALS: Final[Mapping[str, signal.Signals]] = MappingProxyType(
    {"hang": signal.SIGSTOP, "continue": signal.SIGCONT, "kill": signal.SIGKILL}
)
PARTS: Final = ("driver", "watchdog", "velocity")
ALL: Final = "all"
SIMULATED: Final = ("udp_multicast", "virtual")
EPILOG: Final = (
    "Examples:  \ncanbase inject driver hang  \ncanbase inject watchdog kill  \n"
    "canbase inject left_wheel encoder_lost  \ncanbase inject right_wheel weak share=0.3  \n"
    "canbase inject all cut  \ncanbase inject all heal"
)


def inject(
    target: Annotated[
        str,
        typer.Argument(metavar="TARGET", help="driver, watchdog or velocity; a joint of robot.yaml; or `all` drives."),
    ],
    fault: Annotated[
        str,
        typer.Argument(
            metavar="FAULT",
            help="Of a process: hang, continue, kill. Of a drive: one of those below.",
        ),
    ],
    values: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME=VALUE]…", help="Parameters of a drive's fault.")
    ] = None,
    config: ConfigOption = None,
    bench: BenchOption = False,
) -> None:
    """Cause one failure on a simulated robot while `canbase up` runs. Refused on a real bus.

    `continue` ends a hang. After `kill` start `canbase up` again. `canbase inject all heal` ends the faults of drives.

    Faults of a drive, with their parameters and defaults; for a drive with two axes also axis=0 or 1:

    - aliases: 29-bit frames that look like its own
    - blocked: something holds its wheel; force_n=1e6 [N]
    - bus_off: its controller leaves the bus; off_s=0.2
    - cut: sends and receives nothing
    - deaf: receives nothing
    - encoder_frozen: the encoder counts nothing, 606Ch keeps its last value
    - encoder_ghost: the encoder counts nothing, 606Ch shows residue_mps=0.003
    - encoder_intermittent: the encoder counts nothing for off_s=0.1, then all for on_s=0 (0: as off_s)
    - encoder_jumping: the encoder jumps; jump_m=0.01, every_s=0.02
    - encoder_lost: the encoder counts nothing, 606Ch is 0
    - encoder_reversed: the encoder counts backward
    - encoder_scaled: the encoder counts a part of the motion; factor=0.5
    - encoder_zero: as encoder_lost, and 6064h is 0
    - extra_boot_up: one boot-up message too many
    - fault: a drive fault; code=29445 (603Fh), holds=false (true: it stays)
    - frozen_encoder: 6064h alone keeps its value
    - guard_stuck: its answers to node guarding keep their toggle bit
    - heal: ends all of them; a drive fault still needs a reset
    - ignores_setpoints: keeps its last velocity
    - limited: the motor gets a share of each setpoint; share=0.5
    - mute_boot: its boot-up messages are lost
    - no_mains: no main voltage
    - no_requests: remote frames do not reach it
    - power_cycle: no supply; off_s=0.5
    - reset_node: restarts, as by NMT
    - rpdo_lost: setpoints of one axis are lost; every=0 (N: each N-th arrives)
    - short_emcy: EMCY of three bytes
    - silent: sends nothing
    - sto: no torque (STO)
    - stuck_velocity: 606Ch keeps its value; raw=N: it has this one
    - tpdo_lost: feedback of one axis is lost
    - unbraked: reports its stops, and brakes with a share of their slopes; share=0
    - weak: the motor has a share of its force; share=0

    Exit codes: 0 done, 1 the target does not run or the simulator refuses, 2 wrong command line or robot.yaml.
    """
    robot = load_config(named(config, bench=bench)).robot
    if robot.bus.interface not in SIMULATED:
        fail(f"{robot.name} is on {robot.bus.interface}: faults are injected on a simulated bus alone", WRONG_INPUT)
    if target in PARTS:
        _signal(robot, target, fault)
    else:
        _break(robot, target, fault, _arguments(values or []))
    typer.secho(f"canbase: {target}: {fault}", err=True, color=colour())


def _signal(robot: Robot, part: str, fault: str) -> None:
    from canbase_base.single_instance import bus_name, holder
    from canbase_runtime.own_process import NotOursError, send_signal

    if fault not in SIGNALS:
        fail(f"{part} takes {', '.join(SIGNALS)}, not {fault!r}", WRONG_INPUT)
    bus = bus_name(robot.bus.arguments())
    task, name = ("velocity process", robot.lease.socket) if part == "velocity" else (part, bus)
    pid = holder(task, name)
    if pid is None:
        fail(f"{part} of {robot.name} does not run; start it with `canbase up`", FAILED)
    try:
        send_signal(pid, SIGNALS[fault])
    except NotOursError as error:
        fail(f"{part} of {robot.name} gets no signal: {error}", FAILED)
    except OSError as error:
        fail(f"{part} is process {pid}: {error.strerror}", FAILED)


def _break(robot: Robot, target: str, fault: str, arguments: Mapping[str, Any]) -> None:
    from canbase_sim.control import ControlError, SimControl, control_path
    from canbase_sim.faults import KINDS

    wheels = [drive for drive in robot.drives if target in (ALL, drive.joint)]
    if not wheels:
        known = ", ".join((*PARTS, ALL, *(drive.joint for drive in robot.drives)))
        fail(f"{target!r} is no process and no joint of {robot.name}, expected one of {known}", WRONG_INPUT)
    if fault not in KINDS:
        fail(f"there is no fault {fault!r} of a drive, expected one of {', '.join(KINDS)}", WRONG_INPUT)
    by_axis = "axis" in KINDS[fault][1]
    places = sorted({(drive.node_id, drive.axis if by_axis else 0) for drive in wheels})
    try:
        with SimControl(control_path(robot)) as sim:
            for node, axis in places:
                sim.fault(node, fault, **({"axis": axis} if axis else {}), **arguments)
    except ControlError as error:
        fail(str(error), FAILED)


def _arguments(values: list[str]) -> dict[str, Any]:
    """`share=0.3` as the simulator takes it. It names what does not fit."""
    found: dict[str, Any] = {}
    for value in values:
        name, equals, text = value.partition("=")
        if not (name and equals):
            fail(f"{value!r}: expected NAME=VALUE, such as share=0.3", WRONG_INPUT)
        found[name] = _value(name, text)
    return found


def _value(name: str, text: str) -> bool | int | float:
    if text in ("true", "false"):
        return text == "true"
    try:
        return int(text) if text.lstrip("-").isdigit() else float(text)
    except ValueError:
        fail(f"{name} = {text!r}: expected a number, true or false", WRONG_INPUT)
