"""When the wheels stood after a stop, and how far they went, by the encoders. "Unknown" is an answer. Pure."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Final

from canbase_recording.scene import SILENT_PERIODS, Scene
from canbase_recording.trace import AxisTrace, around, last_before, value_at, wrapped

STANDS_SHARE: Final = 0.02
"""Of the greatest speed: slower is at standstill, where no unit is known."""
CONTRADICTS: Final = 3.0


@dataclass(frozen=True, slots=True)
class WheelStop:
    """One wheel. `stood_s`: seconds from the first cause; `distance`: until then, m or increments; None: unknown."""

    name: str
    stood_s: float | None
    distance: float | None
    unit: str
    why_not: str = ""


@dataclass(frozen=True, slots=True)
class Standstill:
    """All wheels. `stood_s` and `distance_m` of the one that took longest; None: unknown, or not in the recording."""

    wheels: tuple[WheelStop, ...]

    @property
    def was_stationary(self) -> bool:
        """No wheel turned at the cause or later."""
        return bool(self.wheels) and all(wheel.stood_s == 0.0 for wheel in self.wheels)

    @property
    def stood_s(self) -> float | None:
        """Seconds from the first cause until the last wheel stood."""
        times = [wheel.stood_s for wheel in self.wheels]
        return max((t for t in times if t is not None), default=None) if times and None not in times else None

    @property
    def distance_m(self) -> float | None:
        """Longest distance of a wheel [m]; None without robot.yaml."""
        found = [wheel.distance if wheel.unit == "m" else None for wheel in self.wheels]
        return max((each for each in found if each is not None), default=None) if found and None not in found else None


def standstill_of(scene: Scene, since_s: float) -> Standstill:
    """From the first cause on, of each axis that had power or moved."""
    return Standstill(tuple(_wheel(trace, scene, since_s) for _, trace in sorted(scene.axes.items()) if trace.position))


def _wheel(trace: AxisTrace, scene: Scene, since_s: float) -> WheelStop:
    unit = "m" if trace.has_units else "increments"
    times = [at for at, _ in trace.position]
    last_s = last_before(times, scene.ended_s)
    if last_s <= since_s and _is_gap(scene, last_s, scene.ended_s):
        return WheelStop(trace.name, None, None, unit, "6064h does not come any more")
    if _is_gap(scene, since_s, times[0]):
        return WheelStop(trace.name, None, None, unit, f"6064h begins at {times[0]:.3f} s")
    if last_s < scene.ended_s - 0.5:
        return WheelStop(trace.name, None, None, unit, f"6064h ends at {last_s:.3f} s")
    from_s = min(since_s, last_s - SILENT_PERIODS * scene.period_s)  # the recording may end with the cause
    steps = _steps(trace, scene, from_s)
    moved_s = _last_motion(trace, scene, from_s, steps)
    if moved_s >= last_s:
        return WheelStop(
            trace.name, None, trace.travel(since_s, last_s), unit, f"it moves in the last 6064h, at {last_s:.3f} s"
        )
    gap = next(((a_s, b_s) for a_s, b_s, _ in steps if a_s < moved_s and _is_gap(scene, a_s, b_s)), None)
    if gap is not None:
        return WheelStop(trace.name, None, None, unit, f"6064h is missing from {gap[0]:.3f} to {gap[1]:.3f} s")
    if moved_s <= since_s:
        return WheelStop(trace.name, 0.0, 0.0, unit)
    return WheelStop(trace.name, moved_s - since_s, trace.travel(since_s, moved_s), unit)


def _steps(trace: AxisTrace, scene: Scene, since_s: float) -> list[tuple[float, float, float]]:
    """Begin, end and speed of each step of 6064h; over a gap as if it were one period: nothing is averaged away."""
    found = []
    for (a_s, a), (b_s, b) in itertools.pairwise(around(trace.position, since_s, scene.ended_s)):
        seconds = scene.period_s if _is_gap(scene, a_s, b_s) else max(b_s - a_s, scene.period_s)
        found.append((a_s, b_s, abs(trace.way(wrapped(b - a))) / seconds))
    return found


def _is_gap(scene: Scene, since_s: float, until_s: float) -> bool:
    return until_s - since_s > SILENT_PERIODS * scene.period_s


def _last_motion(trace: AxisTrace, scene: Scene, since_s: float, steps: list[tuple[float, float, float]]) -> float:
    """The last time at which the wheel did not stand: 606Ch above the limit, or 6064h contradicts it (docs/bus.md)."""
    usual = [speed for a_s, b_s, speed in steps if not _is_gap(scene, a_s, b_s)]
    limit = _limit(trace, scene, max(usual, default=0.0))
    moved_s = since_s
    for _, at_s, speed in steps:
        shown = value_at(trace.velocity, at_s + scene.period_s / 2.0)
        stands = speed <= limit if shown is None else _is_slow(trace, scene, shown) and speed <= CONTRADICTS * limit
        if not stands:
            moved_s = at_s
    return moved_s


def _is_slow(trace: AxisTrace, scene: Scene, raw: int) -> bool:
    if scene.robot is not None and trace.has_units:
        return abs(trace.speed(raw)) <= scene.robot.base.standstill_mps
    return abs(raw) <= STANDS_SHARE * trace.peak


def _limit(trace: AxisTrace, scene: Scene, fastest: float) -> float:
    """Of 6064h at a wheel that stands [m/s], or in increments a second a share of its fastest step."""
    if scene.robot is not None and trace.has_units:
        return scene.robot.base.standstill_mps
    return STANDS_SHARE * fastest
