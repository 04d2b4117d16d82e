"""Do worlds that count as the same continue alike? Pairs of them are stepped on side by side.

The search throws a world away that `canonical` tells as one that was there before. So an ignored field that decides
would hide the whole future of that world. Here such a pair is kept: two worlds with different histories and one form.
The same events happen to both, and after each step their forms must be equal, but for the rounding of speeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from small_worlds import canonical
from small_worlds.copying import Snapshot
from small_worlds.events import EVENTS, FAULT_EVENTS, OPERATOR_EVENTS, Event
from small_worlds.properties import Properties
from small_worlds.world import STARTS, SmallWorld

NEAR = 0.004
"""Numbers that count as the same differ by 10⁻³ at most; speeds may be further apart a few steps later."""
POINTS, AFTER_POINTS = 12, 10
"""How long a history and a future last, in steps of world.POINT_S."""
BUSY = 0.25
"""Chance that something happens at a point."""
TRIES = 40
"""Histories for each pair that is wanted."""


@dataclass(frozen=True, slots=True)
class Pair:
    """Two worlds with the same form, and what happened to each of them."""

    first: Snapshot
    second: Snapshot
    histories: tuple[tuple[str, ...], tuple[str, ...]]


def pairs(seed: int, most: int) -> Iterator[Pair]:
    """Worlds that random histories from one start led to the same form: `most` of them, fewer after TRIES for each."""
    random = Random(seed)
    start = random.choice(STARTS)
    before: dict[bytes, tuple[Snapshot, tuple[str, ...]]] = {}
    began = SmallWorld(start)
    origin = Snapshot((began, Properties(began)))
    given = 0
    for _ in range(TRIES * most):
        pair = _history(random, origin, start, before)
        if pair is not None:
            given += 1
            yield pair
        if given == most:
            return


def _history(
    random: Random, origin: Snapshot, start: str, before: dict[bytes, tuple[Snapshot, tuple[str, ...]]]
) -> Pair | None:
    """One history, until it meets a world of `before` to which other events have happened; None: it meets none."""
    small, properties = origin.restore()
    history = [start]
    for point in range(POINTS):
        if random.random() < BUSY:
            _happens(random, (small,), history)
        small.pass_to_point()
        form = canonical.told(small, properties)
        history.append(f"{point}")
        known = before.setdefault(form, (Snapshot((small, properties)), tuple(history)))
        if _events(known[1]) != _events(history):
            return Pair(known[0], Snapshot((small, properties)), (known[1], tuple(history)))
    return None


def _events(history: Sequence[str]) -> list[str]:
    return [entry for entry in history if entry in EVENTS]


def _may(small: SmallWorld, event: Event) -> bool:
    return event.may(small) and all(name != event.name for _, name in small.ends)


def _happens(random: Random, worlds: tuple[SmallWorld, ...], history: list[str]) -> None:
    """The same event in all of them."""
    event = random.choice(random.choice((FAULT_EVENTS, OPERATOR_EVENTS)))
    if all(_may(small, event) for small in worlds):
        history.append(event.name)
        for small in worlds:
            small.happens(event)


def differences(pair: Pair, seed: int) -> list[str]:
    """One future of both: the histories, and what differs at the first point where anything does. Empty: nothing."""
    random, future = Random(seed), ["then"]
    (first, its), (second, others) = pair.first.restore(), pair.second.restore()
    for point in range(AFTER_POINTS):
        if point == 0 or random.random() < BUSY:
            _happens(random, (first, second), future)
        first.pass_to_point()
        second.pass_to_point()
        future.append(f"{point}")
        apart = list(_apart(canonical.told_form(first, its), canonical.told_form(second, others), ""))
        if apart:
            return [*(" ".join(history) for history in pair.histories), " ".join(future), *apart]
    return []


def _apart(one: Any, other: Any, place: str) -> Iterator[str]:
    if isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        name = one[0] if one and isinstance(one[0], str) else ""
        for at, (here, there) in enumerate(zip(one, other, strict=True)):
            yield from _apart(here, there, f"{place}/{name}[{at}]")
    elif isinstance(one, float) and isinstance(other, float):
        if abs(one - other) > NEAR:
            yield f"{place}: {one} {other}"
    elif one != other:
        yield f"{place}: {str(one)[:80]} {str(other)[:80]}"
