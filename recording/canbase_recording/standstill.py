"""When the wheels stood after a stop, and how far they went, by the encoders. "Cannot tell" is an answer. Pure."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

from canbase_recording.scene import Scene
from canbase_recording.trace import AxisTrace, around, between, last_before, wrapped

STANDS_MPS: Final = 0.005
STANDS_PERIODS: Final = 2.0
"""6064h must have stood for so many cycles at the end of what is known."""


@dataclass(frozen=True, slots=True)
class WheelStop:
    """One wheel. `stood_s`: seconds from the first cause; `way`: until then, m or increments; None: cannot tell."""

    name: str
    stood_s: float | None
    way: float | None
    unit: str
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class Standstill:
    """All wheels. `stood_s` and `way_m` of the one that took longest; None: cannot tell, or not in the recording."""

    wheels: tuple[WheelStop, ...]

    @property
    def stood_s(self) -> float | None:
        """Seconds from the first cause until the last wheel stood."""
        times = [wheel.stood_s for wheel in self.wheels]
        return max((t for t in times if t is not None), default=None) if times and None not in times else None

    @property
    def way_m(self) -> float | None:
        """Longest way of a wheel [m]; None without robot.yaml."""
        ways = [wheel.way if wheel.unit == "m" else None for wheel in self.wheels]
        return max((w for w in ways if w is not None), default=None) if ways and None not in ways else None


def standstill_of(scene: Scene, since_s: float) -> Standstill:
    """From the first cause on, of each axis that had power or moved."""
    return Standstill(tuple(_wheel(trace, scene, since_s) for _, trace in sorted(scene.axes.items()) if trace.position))


def _wheel(trace: AxisTrace, scene: Scene, since_s: float) -> WheelStop:
    unit = "m" if trace.has_units else "increments"
    came = between(trace.position, since_s, scene.ended_s)
    if not came:
        return WheelStop(trace.name, None, None, unit, "6064h does not come any more")
    last_s = last_before([at for at, _ in trace.position], scene.ended_s)
    if last_s < scene.ended_s - 0.5:
        return WheelStop(trace.name, None, None, unit, f"6064h ends at {last_s:.3f} s")
    moved_s = _last_motion(trace, since_s, scene.ended_s)
    if last_s - moved_s < (STANDS_PERIODS - 0.5) * scene.period_s:
        return WheelStop(trace.name, None, trace.travel(since_s, scene.ended_s), unit, "it still moves at the end")
    return WheelStop(trace.name, max(0.0, moved_s - since_s), trace.travel(since_s, moved_s), unit)


def _last_motion(trace: AxisTrace, since_s: float, until_s: float) -> float:
    """When 6064h last moved faster than STANDS_MPS; without units when it last changed."""
    moved_s = since_s
    for (a_s, a), (b_s, b) in itertools.pairwise(around(trace.position, since_s, until_s)):
        if abs(trace.way(wrapped(b - a))) > (STANDS_MPS * (b_s - a_s) if trace.has_units else 0.0):
            moved_s = b_s
    return moved_s
