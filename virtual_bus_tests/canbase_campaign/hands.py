"""The sources of an ordinary hour: a joystick, a planner, a program; each an endless series of commands with pauses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from random import Random

from canbase_config.robot import Limits
from canbase_velocity.twist import ZERO, Twist

Source = Iterator[tuple[float, Twist]]
"""Velocity commands, each with the time until the next one [s]."""


def _any(random: Random, limits: Limits, share: float = 1.0) -> Twist:
    """Now and then more than the limits allow."""
    linear = share * random.uniform(-1.2, 1.2) * limits.linear_mps
    return Twist(linear, share * random.uniform(-1.2, 1.2) * limits.angular_radps)


def joystick(random: Random, limits: Limits) -> Source:
    """50 Hz: jumps, full deflection, reversals at speed, turns in place, creeping, released."""
    while True:
        wanted = _any(random, limits)
        turn, straight, creep = Twist(0.0, wanted.angular_radps), Twist(wanted.linear_mps, 0.0), wanted.scaled(0.05)
        wanted = random.choice((wanted, wanted, turn, ZERO, straight, creep, wanted.scaled(5.0)))
        for _ in range(random.choice((1, 2, 5, 10, 25, 50, 100))):
            yield 0.02, wanted
        if random.random() < 0.3:
            for _ in range(random.randint(1, 30)):
                yield 0.02, wanted.scaled(-1.0)


def navigation(random: Random, limits: Limits) -> Source:
    """20 Hz: curves that grow and shrink, bursts, and gaps after which it is not followed any more."""
    at = ZERO
    while True:
        towards = _any(random, limits, 0.8)
        for number in range(random.randint(5, 60)):
            at = Twist(
                at.linear_mps + 0.15 * (towards.linear_mps - at.linear_mps),
                at.angular_radps + 0.15 * (towards.angular_radps - at.angular_radps),
            )
            yield random.choice((0.05, 0.05, 0.05, 0.001, 0.1) if number else (0.6, 0.05)), at


def program(random: Random, limits: Limits) -> Source:
    """50 Hz: up, on and down to an exact zero, forward or backward, straight or in place."""
    while True:
        straight = random.random() < 0.7
        top = Twist(limits.linear_mps, 0.0) if straight else Twist(0.0, limits.angular_radps)
        top = top.scaled(random.choice((-1.0, 1.0)) * random.uniform(0.02, 1.0))
        rise, hold = random.randint(5, 60), random.randint(0, 100)
        shares = [n / rise for n in range(rise)] + [1.0] * hold + [1.0 - n / rise for n in range(rise)]
        for share in [*shares, *[0.0] * random.randint(1, 50)]:
            yield 0.02, top.scaled(share)


def nobody(random: Random, limits: Limits) -> Source:
    """The base rests."""
    while True:
        yield 0.5, ZERO


HANDS: Mapping[str, tuple[str, Callable[[Random, Limits], Source]]] = {
    "joystick": ("joystick", joystick),
    "planner": ("navigation", navigation),
    "program": ("navigation", program),
    "fast joystick": ("joystick", program),
    "gentle joystick": ("joystick", navigation),
    "bold planner": ("navigation", joystick),
    "nobody": ("joystick", nobody),
}
"""Name → source of the mux that it publishes as, and what it publishes."""
