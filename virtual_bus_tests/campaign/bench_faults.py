"""Faults of the simulated drives, as `canbase_bench.faults` has them, with how each one ends."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from canbase_bench.cia402.axis import Supply
from canbase_bench.faults import apply
from canbase_bench.node import SimulatedNode

if TYPE_CHECKING:
    from campaign.faults import Arguments, Change
    from campaign.outside import Surroundings
    from campaign.world import World


def suffer(kind: str, heal: Callable[[SimulatedNode], None], **fixed: Any) -> tuple[Change, Change]:
    """A drive suffers `kind` with what was drawn and what is `fixed`; `heal` undoes that alone."""

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        arguments = {name: value for name, value in given.items() if name != "node"}
        apply(world.drives.bench.nodes, given["node"], kind, world.clock.now, arguments | fixed)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        heal(world.drives.bench.nodes[given["node"]])

    return begin, end


def join(node: SimulatedNode) -> None:
    """Its cable is whole again."""
    node.line.cut = False


def speak(node: SimulatedNode) -> None:
    """What it says gets onto the bus again."""
    node.line.silent = False


def heal_encoder(node: SimulatedNode) -> None:
    """Its first axis has its sensor again."""
    node.axes[0].encoder.heal()
    node.axes[0].motor.sensor = None


def let_loose(node: SimulatedNode) -> None:
    """Nothing holds its wheel any more."""
    node.axes[0].hold(0.0)


def unlimit(node: SimulatedNode) -> None:
    """Its motor gets the whole setpoint."""
    node.axes[0].faults.setpoint_share = 1.0


def strengthen(node: SimulatedNode) -> None:
    """Its motor has its whole force."""
    node.axes[0].weaken(1.0)


def hear_setpoints(node: SimulatedNode) -> None:
    """Every setpoint reaches it."""
    node.thin_out(0, 1)


def give_feedback(node: SimulatedNode) -> None:
    """Its feedback is on the bus again."""
    node.lose_feedback(0, lost=False)


def give_torque(node: SimulatedNode) -> None:
    """STO is closed again."""
    node.axes[0].faults.supply = Supply.FULL


def stay(node: SimulatedNode) -> None:
    """This ends by itself."""
