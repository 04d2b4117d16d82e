"""Faults of the simulated drives, as `canbase_sim.faults` has them, with how each one ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from canbase_sim.cia402.axis import Supply
from canbase_sim.faults import KINDS, apply
from canbase_sim.node import SimulatedNode

if TYPE_CHECKING:
    from canbase_campaign.fault import Arguments, Change
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World


def suffer(kind: str, heal: Callable[[SimulatedNode, int], None], **fixed: Any) -> tuple[Change, Change]:
    """A drive suffers `kind` with what was drawn and what is `fixed`; `heal` undoes that alone."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        node_id, axis = world.drives.place(given["wheel"])
        arguments = {name: value for name, value in given.items() if name != "wheel"} | fixed
        takes = KINDS[kind][1]
        if "axis" in takes:
            arguments["axis"] = axis
        apply(world.drives.bench.nodes, node_id, kind, world.clock.now_s, arguments)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        node_id, axis = world.drives.place(given["wheel"])
        heal(world.drives.bench.nodes[node_id], axis)

    return begin, end


def join(node: SimulatedNode, axis: int) -> None:
    """Its cable is whole again."""
    node.line.cut = False


def speak(node: SimulatedNode, axis: int) -> None:
    """Its frames get onto the bus again."""
    node.line.silent = False


def heal_encoder(node: SimulatedNode, axis: int) -> None:
    """This axis has its sensor again."""
    node.axes[axis].encoder.heal()
    node.axes[axis].motor.sensor = None


def let_loose(node: SimulatedNode, axis: int) -> None:
    """Nothing holds its wheel any more."""
    node.axes[axis].hold(0.0)


def unlimit(node: SimulatedNode, axis: int) -> None:
    """Its motor gets the whole setpoint."""
    node.axes[axis].faults.setpoint_share = 1.0


def brake(node: SimulatedNode, axis: int) -> None:
    """Its next stop is a stop."""
    node.axes[axis].faults.stop_share = 1.0


def strengthen(node: SimulatedNode, axis: int) -> None:
    """Its motor has its whole force."""
    node.axes[axis].weaken(1.0)


def hear_setpoints(node: SimulatedNode, axis: int) -> None:
    """Every setpoint reaches it."""
    node.thin_out(axis, 1)


def give_feedback(node: SimulatedNode, axis: int) -> None:
    """Its feedback is on the bus again."""
    node.lose_feedback(axis, lost=False)


def give_torque(node: SimulatedNode, axis: int) -> None:
    """STO is closed again."""
    node.axes[axis].faults.supply = Supply.FULL


def stay(node: SimulatedNode, axis: int) -> None:
    """This ends by itself."""
