"""Signs that a sensor lies or that a wheel does not follow: 6064h and 606Ch against each other and against 60FFh. Pure.

With robot.yaml in m/s, without it in the drive's own numbers: then only what needs no unit is looked at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Final

from canbase_driver.cia402 import DriveState
from canbase_recording.cause import Found
from canbase_recording.scene import Scene
from canbase_recording.trace import AxisTrace, around, between, last_before, value_at, wrapped

LOOK_BACK_S: Final = 2.5
"""The watchdog's slowest rule about one wheel takes about so long."""
SAMPLES: Final = 4
MOVES_MPS: Final = 0.02
"""Slower is no motion that is worth a sentence; also the noise of 606Ch."""
LAG_S: Final = 0.25
"""So late may a wheel follow its setpoint."""
JUMP_SHARE, JUMP_MPS, JUMPS = 1.5, 0.3, 3
SLOW_SHARE: Final = 0.75
SLOW_S: Final = 0.15
STUCK_SAMPLES: Final = 12


def encoder_jumps(scene: Scene) -> Found | None:
    """The speed by 6064h changes from sample to sample by more than the wheel's whole speed."""
    for trace in _moved(scene):
        if not trace.has_units:
            continue
        ordered = around(trace.target, scene.reaction_s - LOOK_BACK_S, scene.reaction_s)
        limit = max(JUMP_MPS, JUMP_SHARE * max((abs(trace.speed(raw)) for _, raw in ordered), default=0.0))
        speeds = [(at_s, way / max(seconds, scene.period_s)) for at_s, way, seconds in _steps(trace, scene)]
        jumps = [(at_s, b - a) for (_, a), (at_s, b) in itertools.pairwise(speeds) if abs(b - a) > limit]
        if len(jumps) >= JUMPS:
            at_s, change = jumps[0]
            text = (
                f"the speed of {trace.name} by 6064h jumps {len(jumps)} times, first by {change:+.2f} m/s in one sample"
            )
            return Found(at_s, text, trace.node_id)
    return None


def position_stuck(scene: Scene) -> Found | None:
    """6064h stands still while 606Ch shows a velocity."""
    for trace in _moved(scene):
        frozen_s = _stands_since(trace, scene)
        if frozen_s is None:
            continue
        speeds = [abs(trace.speed(raw)) for _, raw in between(trace.velocity, frozen_s, scene.reaction_s)]
        shown = sorted(speeds)[len(speeds) // 2] if speeds else 0.0
        if len(speeds) >= SAMPLES and shown > _moves(trace) and min(speeds[-SAMPLES:]) > _moves(trace):
            text = (
                f"6064h of {trace.name} stands still since {frozen_s:.3f} s, while 606Ch shows {_speed(trace, shown)}"
            )
            return Found(frozen_s, text, trace.node_id)
    return None


def velocity_stuck(scene: Scene) -> Found | None:
    """606Ch keeps one value while 6064h moves at another speed."""
    for trace in _moved(scene):
        changed_s = trace.last_change(trace.velocity, scene.reaction_s)
        samples = between(trace.velocity, (scene.began_s if changed_s is None else changed_s) - 1e-9, scene.reaction_s)
        scale = 1.0 if trace.has_units else _counts_of_606c(trace, samples[0][0] if samples else scene.began_s)
        if scale is None and samples:
            scale = _counts_of_606c(trace, _steady_until(trace, samples[0][0]))
        if len(samples) < SAMPLES or scale is None or _stands_since(trace, scene) is not None:
            continue
        shown = trace.speed(samples[-1][1]) * scale
        since_s = _differs_since(trace, shown, [at_s for at_s, _ in samples])
        still = abs(shown) <= _moves(trace) or len(samples) >= STUCK_SAMPLES
        real = _rate(trace, samples[-SAMPLES][0] - ROUNDING_S, scene.reaction_s)
        if since_s is not None and real is not None and still:
            text = f"606Ch of {trace.name} stays at {_speed(trace, shown)}, while 6064h moves at {_speed(trace, real)}"
            return Found(since_s, f"{text} since {since_s:.3f} s", trace.node_id)
    return None


ROUNDING_S: Final = 0.002


def _counts_of_606c(trace: AxisTrace, until_s: float) -> float | None:
    """Increments a second for each unit of 606Ch, by what came before; None: it did not move."""
    counted = shown = 0.0
    for (a_s, a), (b_s, b) in itertools.pairwise(between(trace.position, -math.inf, until_s - ROUNDING_S)):
        counted += abs(wrapped(b - a))
        velocity = value_at(trace.velocity, b_s)
        shown += abs(velocity or 0) * (b_s - a_s)
    return counted / shown if counted >= LEAST_COUNTS and shown else None


LEAST_COUNTS: Final = 100.0


def _steady_until(trace: AxisTrace, since_s: float) -> float:
    """Until when the setpoint of this time holds: its 606Ch and 6064h may show one speed."""
    targets = around(trace.target, since_s, math.inf)
    return next((at_s for at_s, raw in targets if raw != targets[0][1]), since_s)


def _differs_since(trace: AxisTrace, shown: float, times: list[float]) -> float | None:
    """Since which of these times the speed by 6064h differs from the one that is shown; None: it does not at last."""
    since_s = None
    for at in range(len(times) - 1, SAMPLES - 2, -1):
        real = _rate(trace, times[at - SAMPLES + 1] - ROUNDING_S, times[at] + ROUNDING_S)
        if real is None or abs(real - shown) < max(_moves(trace), STUCK_SHARE * max(abs(real), abs(shown))):
            break
        since_s = times[at - SAMPLES + 1]
    return since_s


STUCK_SHARE: Final = 0.3


def wrong_way(scene: Scene) -> Found | None:
    """606Ch has the opposite sign of the setpoint, and grows."""
    for trace in _moved(scene):
        signs: list[tuple[float, float]] = []
        for at_s, raw in between(trace.velocity, scene.reaction_s - 0.5, scene.reaction_s + 0.001):
            ordered, shown = _ordered(trace, at_s, 0.05), trace.speed(raw)
            opposite = ordered[0] * shown < 0.0 and ordered[1] * shown <= 0.0 and abs(shown) > 2.0 * _moves(trace)
            signs = [*signs, (at_s, shown)] if opposite else []
        if len(signs) >= SAMPLES and abs(signs[-1][1]) > abs(signs[0][1]):
            first, last = signs[0], signs[-1]
            text = f"606Ch of {trace.name} goes against its setpoint since {first[0]:.3f} s"
            return Found(first[0], f"{text}, {_speed(trace, last[1])} at last", trace.node_id)
    return None


def no_motion(scene: Scene) -> Found | None:
    """Motion is ordered, and neither 6064h nor 606Ch shows any."""
    for trace in _moved(scene):
        frozen_s = _stands_since(trace, scene)
        if frozen_s is None:
            continue
        ordered = [abs(trace.speed(raw)) for _, raw in around(trace.target, frozen_s, scene.reaction_s)]
        speeds = [abs(trace.speed(raw)) for _, raw in between(trace.velocity, frozen_s, scene.reaction_s)]
        if max(ordered, default=0.0) <= _moves(trace) or (speeds and min(speeds[-SAMPLES:]) > _moves(trace)):
            continue
        text = f"{trace.name} is ordered {_speed(trace, max(ordered))}, and its encoder shows no motion"
        torque = _torque(trace, frozen_s, scene.reaction_s)
        return Found(frozen_s, f"{text} since {frozen_s:.3f} s{torque}; {CANNOT_TELL}", trace.node_id)
    return None


CANNOT_TELL: Final = "a dead encoder, a blocked wheel and a motor without current look the same here"


def wheel_slow(scene: Scene) -> Found | None:
    """A wheel stays below its setpoint for long."""
    worst: Found | None = None
    for trace in _moved(scene):
        since_s, share = math.inf, 1.0
        for at_s, raw in between(trace.velocity, scene.reaction_s - LOOK_BACK_S, scene.reaction_s):
            low, high = _ordered(trace, at_s, LAG_S)
            least = min(abs(low), abs(high)) if low * high > 0.0 else 0.0
            if least <= 2.0 * _moves(trace) or abs(trace.speed(raw)) >= SLOW_SHARE * least:
                since_s = math.inf
            else:
                since_s, share = min(since_s, at_s), abs(trace.speed(raw)) / least
        if scene.reaction_s - since_s >= SLOW_S and (worst is None or since_s < worst.at_s):
            torque = _torque(trace, since_s, scene.reaction_s)
            text = f"{trace.name} turns at {100.0 * share:.0f} % of its setpoint since {since_s:.3f} s{torque}"
            worst = Found(since_s, text, trace.node_id)
    return worst


def wheel_runs_on(scene: Scene) -> Found | None:
    """A wheel stays faster than everything that was ordered lately."""
    for trace in _moved(scene):
        since_s, shown = math.inf, 0.0
        for at_s, raw in between(trace.velocity, scene.reaction_s - LOOK_BACK_S, scene.reaction_s):
            low, high = _ordered(trace, at_s, 0.1)
            speed = trace.speed(raw)
            margin = max(_moves(trace), 0.1 * max(abs(low), abs(high)))
            if min(low, 0.0) - margin <= speed <= max(high, 0.0) + margin:
                since_s = math.inf
            else:
                since_s, shown = min(since_s, at_s), speed
        if scene.reaction_s - since_s >= 2.0 * scene.period_s:
            low, high = _ordered(trace, scene.reaction_s, 0.02)
            ordered = high if abs(high) > abs(low) else low
            text = (
                f"{trace.name} turns at {_speed(trace, shown)}, ordered {_speed(trace, ordered)}, since {since_s:.3f} s"
            )
            return Found(since_s, text, trace.node_id)
    return None


def _moved(scene: Scene) -> Iterator[AxisTrace]:
    """Axes that had power until the reaction, and whose feedback still comes."""
    for trace in scene.enabled_axes():
        alive = (
            last_before([at for at, _ in trace.position], scene.reaction_s) > scene.reaction_s - 10.0 * scene.period_s
        )
        if alive and trace.state_at(scene.reaction_s - 3.0 * scene.period_s) is DriveState.OPERATION_ENABLED:
            yield trace


def _stands_since(trace: AxisTrace, scene: Scene) -> float | None:
    """Since when 6064h has one value, SAMPLES of it at least, though it came; None: it moves."""
    since_s = trace.last_change(trace.position, scene.reaction_s)
    since_s = scene.began_s if since_s is None else since_s
    samples = between(trace.position, since_s, scene.reaction_s)
    return since_s if len(samples) >= SAMPLES else None


def _steps(trace: AxisTrace, scene: Scene) -> Iterator[tuple[float, float, float]]:
    """Time, way and duration of each step of 6064h."""
    window = between(trace.position, scene.reaction_s - LOOK_BACK_S, scene.reaction_s)
    for (a_s, a), (b_s, b) in itertools.pairwise(window):
        yield b_s, trace.way(wrapped(b - a)), b_s - a_s


def _rate(trace: AxisTrace, since_s: float, until_s: float) -> float | None:
    """Mean speed by 6064h; None: too few values."""
    found = between(trace.position, since_s, until_s)
    if len(found) < SAMPLES or found[-1][0] <= found[0][0]:
        return None
    way = sum(trace.way(wrapped(b - a)) for (_, a), (_, b) in itertools.pairwise(found))
    return way / (found[-1][0] - found[0][0])


def _ordered(trace: AxisTrace, at_s: float, back_s: float) -> tuple[float, float]:
    """Least and greatest setpoint in force in the time before."""
    speeds = [trace.speed(raw) for _, raw in around(trace.target, at_s - back_s, at_s)]
    return (min(speeds), max(speeds)) if speeds else (0.0, 0.0)


def _moves(trace: AxisTrace) -> float:
    return MOVES_MPS if trace.has_units else 1.0


def _speed(trace: AxisTrace, speed: float) -> str:
    return f"{speed:.2f} m/s" if trace.has_units else f"{speed:.0f} (raw)"


def _torque(trace: AxisTrace, since_s: float, until_s: float) -> str:
    values = [abs(raw) for _, raw in between(trace.torque, since_s, until_s)]
    return f", at up to {max(values) / 10.0:.0f} % of rated torque" if values else ", torque not reported"
