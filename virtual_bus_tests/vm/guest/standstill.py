"""From the simulator's trace to how the wheels came to stand. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from canbase_sim.world.trace import Row

STANDS_MPS = 0.005


@dataclass(frozen=True, slots=True)
class Standstill:
    """Time [s] and way [m] from some moment (monotonic [s]) until the wheels stood."""

    after_s: float
    way_m: float


def standstill(rows: Sequence[Row], moment_s: float) -> Standstill:
    """`rows`: the trace since `moment_s`, until the wheels have stood for a while."""
    moving = [row[0] for row in rows if max(abs(row[4]), abs(row[5])) > STANDS_MPS]
    return Standstill(max(moving, default=moment_s) - moment_s, math.dist(rows[0][1:3], rows[-1][1:3]))
