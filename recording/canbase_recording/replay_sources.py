"""The velocity mux once more: the recorded orders of its sources decide which one has the base. Pure.

Which source has the base follows from its orders, its timeout and its priority. Locks and foreign publishers are not
recorded: moments in which one held a source back are left out. Whether the source was followed is not replayed: that
depends on the state of the driver, on the emergency stop and on scans.
"""

from __future__ import annotations

import bisect
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from canbase_config.robot import Robot
from canbase_recording.recorded_inputs import Happening, RecordedInputs
from canbase_runtime.source_standing import SourceStanding
from canbase_velocity.delay import Sent
from canbase_velocity.mux import Mux
from canbase_velocity.twist import Twist

WAY_S: Final = 0.05
"""A state of the mux is on its way for less than this [s]."""
NOBODY: Final = "no source"
_UNCOMPARED: Final = (SourceStanding.LOCKED, SourceStanding.SHUTDOWN)


@dataclass(frozen=True, slots=True)
class Takeover:
    """From this time on [s] this source has the base; empty: none has."""

    at_s: float
    source: str


@dataclass(frozen=True, slots=True)
class SourceDifference:
    """A state of the mux at this time [s] has another source than the replay."""

    at_s: float
    recorded: str
    replayed: str


@dataclass(frozen=True, slots=True)
class SourceReplay:
    """`orders`: by source. `compared`, `left_out`: recorded states of the mux."""

    orders: Mapping[str, int]
    takeovers: tuple[Takeover, ...]
    compared: int
    left_out: int
    differences: tuple[SourceDifference, ...]


def replay_sources(inputs: RecordedInputs, robot: Robot) -> SourceReplay:
    """`robot`: as recorded, or another one."""
    period_s = 1.0 / robot.rates.command_hz
    takeovers = list(_takeovers(inputs, robot, period_s))
    known_s = inputs.began_s + max(source.timeout_s for source in robot.mux.sources.values())
    states = list(inputs.of("velocity_mux/state"))
    compared = [each for each in states if each.at_s >= known_s and _is_free(each)]
    differences = tuple(_differences(compared, takeovers, period_s + WAY_S))
    orders = Counter(str(each.values.get("source")) for each in inputs.of("order"))
    return SourceReplay(orders, tuple(takeovers), len(compared), len(states) - len(compared), differences)


def _takeovers(inputs: RecordedInputs, robot: Robot, period_s: float) -> Iterator[Takeover]:
    mux, active = Mux(robot.mux.sources), None
    orders = [each for each in inputs.of("order") if each.values.get("source") in robot.mux.sources]
    at = 0
    for now_s in _moments(inputs, orders, period_s):
        while at < len(orders) and orders[at].at_s <= now_s:
            _take(mux, orders[at], inputs.wall_offset_s)
            at += 1
        source = mux.decide(now_s).active or ""
        if source != active:
            active = source
            yield Takeover(now_s, source)


def _moments(inputs: RecordedInputs, orders: Sequence[Happening], period_s: float) -> list[float]:
    """Each order is looked at when it comes, and all of them in each period."""
    ends_s = max(inputs.ends_s, inputs.happenings[-1].at_s if inputs.happenings else inputs.began_s)
    grid = [inputs.began_s + k * period_s for k in range(math.ceil((ends_s - inputs.began_s) / period_s) + 1)]
    return sorted([*grid, *(order.at_s for order in orders)])


def _take(mux: Mux, order: Happening, wall_offset_s: float) -> None:
    twist = Twist(order.number("linear_mps"), order.number("angular_radps"))
    stamp_s = order.number("stamp_s")
    sent = Sent(stamp_s, order.at_s + wall_offset_s, order.at_s) if stamp_s > 0.0 else None
    mux.on_command(str(order.values["source"]), twist, order.at_s, order.at_s, sent)


def _is_free(state: Happening) -> bool:
    """No lock and no foreign publisher holds a source back, and the mux does not end."""
    standing = state.values.get("standing")
    held = isinstance(standing, Mapping) and any(value in _UNCOMPARED for value in standing.values())
    return not held and not state.values.get("locks")


def _differences(
    states: Sequence[Happening], takeovers: Sequence[Takeover], late_s: float
) -> Iterator[SourceDifference]:
    times = [each.at_s for each in takeovers]
    for state in states:
        last = bisect.bisect_right(times, state.at_s + WAY_S) - 1
        first = max(0, bisect.bisect_right(times, state.at_s - late_s) - 1)
        near = {each.source for each in takeovers[first : last + 1]}
        recorded = str(state.values.get("active", ""))
        if recorded not in near:
            yield SourceDifference(state.at_s, recorded or NOBODY, takeovers[last].source or NOBODY)
