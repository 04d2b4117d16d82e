"""Faults by name, as the control socket and the campaigns order them. Each is a plain field or method of the node."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from canbase_sim.cia402.axis import Supply
from canbase_sim.node import SimulatedNode
from canbase_sim.plant.encoder import EncoderFault

DEFAULT_CODE = 0x7305
"""603Fh of a fault without a code: encoder."""
BLOCKED_N = 1e6
"""Force that holds a wheel whatever its motor does [N]."""


class FaultError(ValueError):
    """The order names no known fault, no node or axis of this robot, or an argument that the fault does not take."""


def _silent(node: SimulatedNode, now_s: float) -> None:
    node.line.silent = True


def _deaf(node: SimulatedNode, now_s: float) -> None:
    node.line.deaf = True


def _cut(node: SimulatedNode, now_s: float) -> None:
    node.line.cut = True


def _drive_fault(
    node: SimulatedNode, now_s: float, axis: int = 0, code: int = DEFAULT_CODE, holds: bool = False
) -> None:
    node.fail(axis, code, holds)


def _power_cycle(node: SimulatedNode, now_s: float, off_s: float = 0.5) -> None:
    node.power_cycle(now_s, off_s)


def _frozen_encoder(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.axes[axis].faults.frozen_position = node.axes[axis].position()


def _stuck_velocity(node: SimulatedNode, now_s: float, axis: int = 0, raw: int | None = None) -> None:
    node.axes[axis].faults.stuck_velocity = node.axes[axis].velocity() if raw is None else raw


def _ignores_setpoints(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.axes[axis].faults.ignores_setpoints = True


def _weak(node: SimulatedNode, now_s: float, axis: int = 0, share: float = 0.0) -> None:
    node.axes[axis].weaken(share)


def _blocked(node: SimulatedNode, now_s: float, axis: int = 0, force_n: float = BLOCKED_N) -> None:
    node.axes[axis].hold(force_n)


def _limited(node: SimulatedNode, now_s: float, axis: int = 0, share: float = 0.5) -> None:
    node.axes[axis].faults.setpoint_share = share


def _unbraked(node: SimulatedNode, now_s: float, axis: int = 0, share: float = 0.0) -> None:
    node.axes[axis].faults.stop_share = share


def _encoder(**fixed: float | bool) -> Callable[..., None]:
    """A fault of all that hangs on one encoder; what is not `fixed` is an argument of EncoderFault."""

    def begin(node: SimulatedNode, now_s: float, axis: int = 0, **given: float) -> None:
        node.axes[axis].lose_encoder(EncoderFault(**(fixed | given)))  # type: ignore[arg-type]

    return begin


def _encoder_zero(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.axes[axis].faults.frozen_position = 0
    node.axes[axis].lose_encoder(EncoderFault())


def _rpdo_lost(node: SimulatedNode, now_s: float, axis: int = 0, every: int = 0) -> None:
    node.thin_out(axis, every)


def _tpdo_lost(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.lose_feedback(axis)


def _mute_boot(node: SimulatedNode, now_s: float) -> None:
    node.line.mute_boot = True


def _short_emcy(node: SimulatedNode, now_s: float) -> None:
    node.line.short_emcy = True


def _guard_stuck(node: SimulatedNode, now_s: float) -> None:
    node.guarding.stuck = True


def _no_requests(node: SimulatedNode, now_s: float) -> None:
    node.line.answers_requests = False


def _aliases(node: SimulatedNode, now_s: float) -> None:
    node.line.aliases = True


def _extra_boot_up(node: SimulatedNode, now_s: float) -> None:
    node.say_boot_up()


def _bus_off(node: SimulatedNode, now_s: float, off_s: float = 0.2) -> None:
    node.bus_off(now_s, off_s)


def _reset_node(node: SimulatedNode, now_s: float) -> None:
    node.reset_node(now_s)


def _sto(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.axes[axis].lose(Supply.NO_TORQUE)


def _no_mains(node: SimulatedNode, now_s: float, axis: int = 0) -> None:
    node.axes[axis].lose(Supply.NO_MAINS)


def _heal(node: SimulatedNode, now_s: float) -> None:
    node.line.heal()
    node.guarding.stuck = False
    for number, axis in enumerate(node.axes):
        axis.heal()
        node.heal(number)
    for number in range(len(node.axes)):
        node.thin_out(number, 1)
        node.lose_feedback(number, lost=False)


KINDS: Mapping[str, tuple[Callable[..., None], frozenset[str]]] = {
    "silent": (_silent, frozenset()),
    "deaf": (_deaf, frozenset()),
    "cut": (_cut, frozenset()),
    "fault": (_drive_fault, frozenset({"axis", "code", "holds"})),
    "power_cycle": (_power_cycle, frozenset({"off_s"})),
    "frozen_encoder": (_frozen_encoder, frozenset({"axis"})),
    "stuck_velocity": (_stuck_velocity, frozenset({"axis", "raw"})),
    "ignores_setpoints": (_ignores_setpoints, frozenset({"axis"})),
    "weak": (_weak, frozenset({"axis", "share"})),
    "blocked": (_blocked, frozenset({"axis", "force_n"})),
    "limited": (_limited, frozenset({"axis", "share"})),
    "unbraked": (_unbraked, frozenset({"axis", "share"})),
    "encoder_lost": (_encoder(), frozenset({"axis"})),
    "encoder_frozen": (_encoder(holds_speed=True), frozenset({"axis"})),
    "encoder_ghost": (_encoder(holds_speed=True, residue_mps=0.003), frozenset({"axis", "residue_mps"})),
    "encoder_zero": (_encoder_zero, frozenset({"axis"})),
    "encoder_jumping": (_encoder(factor=1.0, jump_m=0.01, every_s=0.02), frozenset({"axis", "jump_m", "every_s"})),
    "encoder_scaled": (_encoder(factor=0.5), frozenset({"axis", "factor"})),
    "encoder_reversed": (_encoder(factor=-1.0), frozenset({"axis"})),
    "encoder_intermittent": (_encoder(off_s=0.1), frozenset({"axis", "off_s", "on_s"})),
    "rpdo_lost": (_rpdo_lost, frozenset({"axis", "every"})),
    "tpdo_lost": (_tpdo_lost, frozenset({"axis"})),
    "mute_boot": (_mute_boot, frozenset()),
    "short_emcy": (_short_emcy, frozenset()),
    "aliases": (_aliases, frozenset()),
    "guard_stuck": (_guard_stuck, frozenset()),
    "no_requests": (_no_requests, frozenset()),
    "extra_boot_up": (_extra_boot_up, frozenset()),
    "bus_off": (_bus_off, frozenset({"off_s"})),
    "reset_node": (_reset_node, frozenset()),
    "sto": (_sto, frozenset({"axis"})),
    "no_mains": (_no_mains, frozenset({"axis"})),
    "heal": (_heal, frozenset()),
}
"""Each fault and the arguments that it takes. silent: sends nothing. deaf: receives nothing. cut: both.
weak: its motor gives a share of its force, none by default, and holds its power.
blocked: something holds its wheel, with `force_n` beyond its friction, by default more than any motor. limited: its
motor gets a share of each setpoint, half by default. unbraked: it reports its stops (quick stop, fault reaction) and
brakes with a share of their slopes, none by default.
encoder_…: all that hangs on one encoder, 6064h, 606Ch and the drive's own loops. lost: it counts nothing and shows no
speed. frozen: it counts nothing and shows its last speed. ghost: it counts nothing and shows `residue_mps`, 3 mm/s by
default. zero: lost, and 6064h is 0. jumping: `jump_m` ahead and back in turn, each `every_s`.
scaled: it counts `factor` times the motion, 0.5 by default. reversed: it counts backward.
intermittent: nothing for `off_s`, everything for `on_s` (0: as long), in turn.
rpdo_lost: setpoints of one axis do not reach it, or every n-th does. tpdo_lost: the feedback PDOs of one axis are lost.
mute_boot: its boot-up messages are lost. short_emcy: three bytes. aliases: 29-bit frames that look like its own.
guard_stuck: its answers to node guarding keep their toggle bit. no_requests: remote frames do not reach it.
extra_boot_up: one boot-up message too many. bus_off: its controller leaves the bus for `off_s`. reset_node: as by NMT.
sto: no torque, it stays in switch on disabled. no_mains: it does not get beyond ready to switch on.
heal: all of them are over; a drive fault still needs its reset."""

RANGES: Mapping[str, tuple[type, float, float]] = {
    "axis": (int, 0, 1),
    "code": (int, 1, 0xFFFF),
    "holds": (bool, 0, 1),
    "off_s": (float, 0.0, 3600.0),
    "on_s": (float, 0.0, 3600.0),
    "share": (float, 0.0, 1.0),
    "factor": (float, -10.0, 10.0),
    "force_n": (float, 0.0, 1e9),
    "residue_mps": (float, -10.0, 10.0),
    "jump_m": (float, 0.0, 10.0),
    "every_s": (float, 0.002, 10.0),
    "every": (int, 0, 100),
    "raw": (int, -(2**31), 2**31 - 1),
}
"""Type, least and greatest value of each argument."""


def apply(nodes: Mapping[int, SimulatedNode], node: int, kind: str, now_s: float, arguments: Mapping[str, Any]) -> None:
    """Make `nodes[node]` suffer `kind`. Raises FaultError and changes nothing when the order makes no sense."""
    if node not in nodes:
        raise FaultError(f"there is no node {node!r}, expected one of {sorted(nodes)}")
    if kind not in KINDS:
        raise FaultError(f"there is no fault {kind!r}, expected one of {', '.join(KINDS)}")
    do, takes = KINDS[kind]
    for name, value in arguments.items():
        if name not in takes:
            raise FaultError(f"{kind} does not take {name!r}, expected {', '.join(sorted(takes)) or 'no argument'}")
        _check(name, value)
    if arguments.get("axis", 0) >= len(nodes[node].axes):
        raise FaultError(f"node {node} has no axis {arguments['axis']}, expected below {len(nodes[node].axes)}")
    do(nodes[node], now_s, **arguments)


def _check(name: str, value: object) -> None:
    kind, least, greatest = RANGES[name]
    fits = type(value) is kind or (kind is float and type(value) is int)
    if not (fits and isinstance(value, (int, float)) and least <= value <= greatest):
        raise FaultError(f"{name} = {value!r}: expected {kind.__name__} from {least} to {greatest}")
