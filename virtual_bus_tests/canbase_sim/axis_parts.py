"""The parameters of a simulated node for each axis, and the state that it reports of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from canbase_sim.cia402.raw_units import Scale
from canbase_sim.cia402.states import State
from canbase_sim.plant.motor import Motor


def _not_mounted(force_n: float) -> None:
    """No wheel is there to be held."""


@dataclass(frozen=True, slots=True)
class AxisParts:
    """What one axis is built from. `travel_m` gives the way of its motor since the start of the world."""

    motor: Motor
    scale: Scale
    travel_m: Callable[[], float]
    encoder_offset: int
    hold: Callable[[float], None] = _not_mounted
    """Something holds its wheel with so much force [N]."""


@dataclass(frozen=True, slots=True)
class StateChange:
    """One transition of one axis."""

    node_id: int
    axis: int
    before: State
    number: int
    after: State
