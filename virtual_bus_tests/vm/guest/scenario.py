"""What a scenario gives: a row of the table, judged against the limit of the layer that caught the failure."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass

from exit_matrix.log_evidence import Catch
from exit_matrix.stop_limits import Layer
from vm.guest.robot import SPEED_MPS, Robot
from vm.guest.standstill import Standstill
from vm.guest.system import BrokenPromiseError

LATCHED = "no power until reset"
STANDS = "stands"


@dataclass(frozen=True, slots=True)
class Row:
    """What was measured: times in seconds, ways in metres; what there is not is None."""

    what: str
    how: str
    caught: str = ""
    stands_s: float | None = None
    way_m: float | None = None
    limit_s: float | None = None
    again_s: float | None = None
    then: str = ""


Scenario = Callable[[Robot], Row]


def judged(row: Row, robot: Robot, moment_s: float, stop: Standstill, caught_by: Collection[Layer]) -> Row:
    """`row` with the times, and who caught what happened at `moment_s`. Raises BrokenPromiseError: too late."""
    catches = robot.evidence.since(moment_s)
    caught = [layer for layer in caught_by if (layer.who, layer.cause) in catches]
    if not caught:
        raise BrokenPromiseError(f"expected that {_names(caught_by)} catches it; heard of {sorted(catches)}")
    return timed(row, stop, limit_s(robot, caught), _names(caught))


def timed(row: Row, stop: Standstill, limit: float, caught: str) -> Row:
    """`row` with its times. Raises BrokenPromiseError when it stood too late."""
    if stop.after_s > limit:
        raise BrokenPromiseError(f"stood after {stop.after_s:.3f} s and {stop.way_m:.3f} m, limit {limit:.3f} s")
    return Row(row.what, row.how, caught, stop.after_s, stop.way_m, limit, row.again_s, row.then)


def limit_s(robot: Robot, layers: Collection[Layer]) -> float:
    """What hazards.yaml promises where these layers catch a failure at the speed of the scenarios."""
    return max(layer.limit_s(robot.config, SPEED_MPS) for layer in layers)


def _names(layers: Collection[Layer]) -> str:
    named: dict[Catch, None] = {(layer.who, layer.cause): None for layer in layers}
    return ", ".join(f"{who}: {cause}" for who, cause in named)


def elapsed(since_s: float) -> float:
    """Seconds since a monotonic time."""
    return time.monotonic() - since_s
