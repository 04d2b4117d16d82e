"""All interleavings of a few events in a small world: each branch in a forked copy of the process.

At every point something of what is left may happen, or nothing, until the world has been there before (`canonical.py`)
with as much left to happen. So there is no longest time: a world that comes to rest is gone on with once. What was
visited is a table in shared memory: all branches, which are processes, write into it.
"""

from __future__ import annotations

import gc
import hashlib
import json
import mmap
import os
import resource
import struct
import time
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from small_worlds import canonical
from small_worlds.events import EVENTS, FAULT_EVENTS, OPERATOR_EVENTS, Event
from small_worlds.properties import Found, Properties
from small_worlds.world import POINT_S, SmallWorld

LONGEST_S = 8.0
"""A world that is still new so long after the last event is given up, and counted: `Search.unfinished`."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """How much may happen: so many faults, so many things that the operator does, at each so-manieth point."""

    faults: int = 1
    operator: int = 1
    every: int = 1
    only: tuple[str, ...] = ()
    """Nothing but these events; empty: all."""

    def __str__(self) -> str:
        return (
            f"at most {self.faults} faults and {self.operator} actions of the operator, "
            f"at any multiples of {self.every * POINT_S:.1f} s"
        )


@dataclass(frozen=True, slots=True)
class Story:
    """A counterexample: where it began, what happened when [s], and what did not hold."""

    start: str
    events: tuple[tuple[float, str], ...]
    found: Found

    def lines(self) -> list[str]:
        """Told with times."""
        told = [f"{at_s:5.2f} s  {EVENTS[name].sentence}" for at_s, name in self.events]
        return [f"    0 s  {self.start}", *told, f"{self.found.at_s:5.2f} s  {self.found.name}: {self.found.detail}"]


@dataclass(slots=True)
class Search:
    """What came of it. `stories`: the shortest one for each property and set of events."""

    states: int = 0
    steps: int = 0
    unfinished: int = 0
    cpu_s: float = 0.0
    real_s: float = 0.0
    stories: list[Story] = field(default_factory=list)


class _Shared:
    """Memory that all forked branches share: the table of visited states, and three counters."""

    SLOTS = 1 << 21
    _HEAD = 24

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, self._HEAD + 8 * self.SLOTS)

    def count(self, at: int) -> int:
        return int(struct.unpack_from("<Q", self._memory, 8 * at)[0])

    def add(self, at: int) -> None:
        struct.pack_into("<Q", self._memory, 8 * at, self.count(at) + 1)

    def is_new(self, key: int) -> bool:
        """Whether it was not in the table; it is now. Raises MemoryError when the table is full."""
        slot = key % self.SLOTS
        for _ in range(self.SLOTS):
            at = self._HEAD + 8 * slot
            there = struct.unpack_from("<Q", self._memory, at)[0]
            if there == key:
                return False
            if there == 0:
                struct.pack_into("<Q", self._memory, at, key)
                return True
            slot = (slot + 1) % self.SLOTS
        raise MemoryError("more states than the table of visited ones has room for")


STATES, STEPS, UNFINISHED = 0, 1, 2


class _Branch:
    """One process: a world, what has happened in it, and what may still happen."""

    def __init__(self, start: str, bounds: Bounds, shared: _Shared, writer: int, part: tuple[int, int]) -> None:
        """`part`: of the first events it takes those of this remainder, of so many processes beside each other."""
        self._start, self._bounds, self._shared, self._writer, self._part = start, bounds, shared, writer, part
        self._small = SmallWorld(start)
        self._properties = Properties(self._small)
        self._began = self._small.world.clock.now
        self._events: list[tuple[float, str]] = []
        self._faults, self._operator = bounds.faults, bounds.operator
        self._first = 0

    def explore(self, least: int = 0) -> None:
        """Everything that may happen from here on; now only events from the row `least` on."""
        for point in range(round(LONGEST_S / POINT_S)):
            for row, event in self._choices(point, least):
                child = os.fork() if self._is_mine() else -1
                if child == 0:
                    self._branch(row, event)
                if child > 0:
                    os.waitpid(child, 0)
            least = 0
            if not self._pass(point + 1):
                return
        self._shared.add(UNFINISHED)

    def _choices(self, point: int, least: int) -> Iterator[tuple[int, Event]]:
        if point % self._bounds.every:
            return
        running = {name for _, name in self._small.ends}
        for row, event in enumerate(ALL):
            left = self._faults if event in FAULT_EVENTS else self._operator
            wanted = event.name in (self._bounds.only or EVENTS)
            if row >= least and left and wanted and event.name not in running:
                yield row, event

    def _is_mine(self) -> bool:
        """The first event of a story says which process goes on with it."""
        self._first += not self._events
        return bool(self._events) or self._first % self._part[1] == self._part[0]

    def _branch(self, row: int, event: Event) -> None:
        """The whole life of a forked process: it never returns."""
        status = 1
        try:
            self._events.append((self._small.world.clock.now - self._began, event.name))
            self._faults -= event in FAULT_EVENTS
            self._operator -= event in OPERATOR_EVENTS
            self._small.happens(event)
            self.explore(row)
            status = 0
        except Exception:  # noqa: BLE001 - whatever a core raises is what this search is for
            self._tell(Found("exception", self._small.world.clock.now, traceback.format_exc(limit=-3)))
            status = 0
        finally:
            os._exit(status)

    def _pass(self, point: int) -> bool:
        """Time passes up to the next point. False: something did not hold, or the world was there before."""
        self._small.pass_to_point()
        self._shared.add(STEPS)
        if self._properties.found is not None:
            self._tell(self._properties.found)
            return False
        is_new = self._shared.is_new(self._key(point))
        self._shared.add(STATES) if is_new else None
        return is_new

    def _key(self, point: int) -> int:
        small = self._small
        now = small.world.clock.now
        more = {
            "left": (point % self._bounds.every, self._faults, self._operator),
            "ends": sorted((round(at_s - now, 3), name) for at_s, name in small.ends),
            "stick": (small.held, small.has_radio),
            "button": small.around.pressed,
            "resets": len(small.resets) - sum(outcome.done for outcome in small.resets),
            "properties": self._properties.memory,
        }
        told = repr(canonical.form(small.world, more)).encode()
        return int.from_bytes(hashlib.blake2b(told, digest_size=8).digest(), "little") or 1

    def _tell(self, found: Found) -> None:
        told = [self._start, self._events, found.name, found.at_s - self._began, found.detail[:1500]]
        os.write(self._writer, json.dumps(told).encode() + b"\n")


ALL = (*FAULT_EVENTS, *OPERATOR_EVENTS)


def search(bounds: Bounds, starts: Sequence[str], workers: int = 2) -> Search:
    """Everything within `bounds` from each of `starts`."""
    began, used_s = time.perf_counter(), _cpu_s()
    shared = _Shared()
    reader, writer = os.pipe()
    gc.collect()
    gc.freeze()
    children = [_worker(starts, bounds, shared, (reader, writer), (at, workers)) for at in range(workers)]
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        stories = [_story(line) for line in pipe]
    failed = [child for child in children if os.waitpid(child, 0)[1]]
    if failed:
        raise RuntimeError(f"{len(failed)} of {workers} searching processes died")
    counts = (shared.count(STATES), shared.count(STEPS), shared.count(UNFINISHED))
    return Search(*counts, _cpu_s() - used_s, time.perf_counter() - began, stories)


def _cpu_s() -> float:
    """Of all processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _worker(
    starts: Sequence[str], bounds: Bounds, shared: _Shared, pipe: tuple[int, int], part: tuple[int, int]
) -> int:
    child = os.fork()
    if child:
        return child
    status = 1
    gc.disable()
    try:
        os.close(pipe[0])
        for start in starts:
            _Branch(start, bounds, shared, pipe[1], part).explore()
        status = 0
    except BaseException:  # noqa: BLE001 - told, and an exit code
        traceback.print_exc()
    finally:
        os._exit(status)


def _story(line: bytes) -> Story:
    start, events, name, at_s, detail = json.loads(line)
    return Story(start, tuple((at, event) for at, event in events), Found(name, at_s, detail))


def shortest(stories: Sequence[Story]) -> dict[str, Story]:
    """For each property the story with the fewest events, and of those the one that ends first."""
    told: dict[str, Story] = {}
    for story in sorted(stories, key=lambda story: (len(story.events), story.found.at_s, story.start, story.events)):
        told.setdefault(story.found.name, story)
    return told
