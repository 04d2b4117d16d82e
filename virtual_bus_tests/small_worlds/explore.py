"""All interleavings of a few events in a small world: each branch in a copy of its own (`copying.py`).

At every point something of what is left may happen, or nothing, until the world has been there before (`canonical.py`)
with as much left to happen, or more. So there is no longest time: a world that comes to rest, or goes in a circle, is
gone on with once. What was visited is a table in shared memory: all searching processes write into it.
"""

from __future__ import annotations

import gc
import hashlib
import json
import mmap
import os
import resource
import signal
import struct
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from small_worlds import canonical
from small_worlds.copying import Snapshot
from small_worlds.events import EVENTS, FAULT_EVENTS, OPERATOR_EVENTS, Event
from small_worlds.properties import Found, Properties
from small_worlds.world import POINT_S, SmallWorld

LONGEST_S = 40.0
"""A world that is still new this long after the last event does not come to rest: a story. What goes round in 4.2 s, as
a boot with a drive that does not answer does, comes back to the same grid of events after 16.8 s."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """How much may happen: the number of faults, of the operator's actions, and every how-many-th point is tried."""

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
        """The story with its times."""
        told = [f"{at_s:5.2f} s  {EVENTS[name].sentence}" for at_s, name in self.events]
        return [f"    0 s  {self.start}", *told, f"{self.found.at_s:5.2f} s  {self.found.name}: {self.found.detail}"]


@dataclass(slots=True)
class Search:
    """What came of it. `stories`: the shortest one for each property and set of events."""

    states: int = 0
    steps: int = 0
    cpu_s: float = 0.0
    real_s: float = 0.0
    stories: list[Story] = field(default_factory=list)
    tasks: int = 0
    done: int = 0
    """Of the tasks: each is one first event, and all that may come after it."""

    @property
    def broken_off(self) -> bool:
        """Ctrl-C came before the last task was done."""
        return self.done < self.tasks


def _nobody(found: Search) -> None:
    """A listener that ignores everything."""


class _Shared:
    """Memory that all processes share: the table of visited states, and two counters."""

    SLOTS = 1 << 22
    _HEAD = 16

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, self._HEAD + 16 * self.SLOTS)

    def count(self, at: int) -> int:
        return int(struct.unpack_from("<Q", self._memory, 8 * at)[0])

    def add(self, at: int) -> None:
        struct.pack_into("<Q", self._memory, 8 * at, self.count(at) + 1)

    def seen(self, key: int, what: int) -> int:
        """What was noted for `key` before; `what` is noted too. Raises MemoryError when the table is full."""
        slot = key % self.SLOTS
        for _ in range(self.SLOTS):
            at = self._HEAD + 16 * slot
            there, noted = struct.unpack_from("<QQ", self._memory, at)
            if there in (0, key):
                struct.pack_into("<QQ", self._memory, at, key, noted | what)
                return int(noted)
            slot = (slot + 1) % self.SLOTS
        raise MemoryError("more states than the table of visited ones has room for")


STATES, STEPS = 0, 1
DONE = "done"
COLLECTED = (30_000, 5, 5)
"""Worlds refer to themselves: many are thrown away at once."""
ALL = (*FAULT_EVENTS, *OPERATOR_EVENTS)


@dataclass(frozen=True, slots=True)
class _Left:
    """What may still happen."""

    faults: int
    operator: int

    def after(self, event: Event) -> _Left:
        """When `event` has happened."""
        if event in FAULT_EVENTS:
            return _Left(self.faults - 1, self.operator)
        return _Left(self.faults, self.operator - 1)

    def allows(self, event: Event) -> bool:
        """Whether it may happen still."""
        return (self.faults if event in FAULT_EVENTS else self.operator) > 0

    @property
    def bit(self) -> int:
        return 1 << self.faults * 8 + self.operator

    @property
    def as_much(self) -> int:
        """The bits of all that has at least as much left."""
        return sum(_Left(f, o).bit for f in range(self.faults, 4) for o in range(self.operator, 8))


class _World:
    """One world, and what has happened in it."""

    def __init__(self, start: str) -> None:
        self.start = start
        self.small = SmallWorld(start)
        self.properties = Properties(self.small)
        self.small.pass_to_point(canonical.OLD_S)
        self.began = self.small.world.clock.now_s
        self.events: list[tuple[float, str]] = []

    def happens(self, event: Event) -> None:
        self.events.append((self.small.world.clock.now_s - self.began, event.name))
        self.small.happens(event)


class _Worker:
    """One process of the search."""

    def __init__(self, bounds: Bounds, shared: _Shared, writer: int) -> None:
        self._bounds, self._shared, self._writer = bounds, shared, writer

    def begin(self, world: _World, left: _Left) -> list[tuple[Snapshot, list[int]]]:
        """As `nothing_happens`, from a world at rest: what it comes back to was there before."""
        self._is_new(world, left, 0)
        return self.nothing_happens(world, left, 0)

    def explore(self, world: _World, left: _Left, least: int = 0) -> None:
        """Everything that may happen from here on; now only events from the row `least` on."""
        for snapshot, rows in self.nothing_happens(world, left, least):
            for row in rows:
                self.branch(snapshot, row, left)

    def branch(self, snapshot: Snapshot, row: int, left: _Left) -> None:
        """The event of this row happens, and everything that may come after it."""
        world: _World = snapshot.restore()
        if self._guard(world, lambda: world.happens(ALL[row])):
            self.explore(world, left.after(ALL[row]), row)

    def nothing_happens(self, world: _World, left: _Left, least: int) -> list[tuple[Snapshot, list[int]]]:
        """From here on, until the world was there before; its points, and what may happen at each."""
        points: list[tuple[Snapshot, list[int]]] = []
        for point in range(round(LONGEST_S / POINT_S)):
            rows = [] if point % self._bounds.every else self._rows(world, left, 0 if point else least)
            if rows:
                points.append((Snapshot(world), rows))
            if not self._pass(world, left, (point + 1) % self._bounds.every):
                return points
        self._tell(world, Found("rest", world.small.world.clock.now_s, f"still new {LONGEST_S} s after the last event"))
        return points

    def _rows(self, world: _World, left: _Left, least: int) -> list[int]:
        return [row for row, event in enumerate(ALL) if row >= least and left.allows(event) and self._may(world, event)]

    def _may(self, world: _World, event: Event) -> bool:
        wanted = not self._bounds.only or event.name in self._bounds.only
        over = all(name != event.name for _, name in world.small.ends)
        due = any(name.startswith(event.after) for _, name in world.events) or not event.after
        return wanted and over and due and event.may(world.small)

    def _pass(self, world: _World, left: _Left, phase: int) -> bool:
        """Time passes up to the next point. False: something did not hold, or the world was there before."""
        self._shared.add(STEPS)
        if not self._guard(world, world.small.pass_to_point):
            return False
        if world.properties.found is not None:
            self._tell(world, world.properties.found)
            return False
        is_new = self._is_new(world, left, phase)
        self._shared.add(STATES) if is_new else None
        return is_new

    def _guard(self, world: _World, do: Callable[[], None]) -> bool:
        try:
            do()
        except Exception:  # noqa: BLE001 - whatever a core raises is what this search is for
            now_s = world.small.world.clock.now_s
            self._tell(world, Found("exception", now_s, traceback.format_exc(limit=-3)))
            return False
        return True

    def _is_new(self, world: _World, left: _Left, phase: int) -> bool:
        """Not, where a world like it was seen to which as much may happen, as soon."""
        told = canonical.told(world.small, world.properties)
        before = self._shared.seen(_hash(told, b""), left.bit)
        if left == NOTHING:
            return not before & left.as_much
        return not self._shared.seen(_hash(told, bytes((phase + 1,))), left.bit) & left.as_much

    def _tell(self, world: _World, found: Found) -> None:
        self.say([world.start, world.events, found.name, found.at_s - world.began, found.detail[:1500]])

    def say(self, news: object) -> None:
        """To the process that began the search: a story, or DONE."""
        os.write(self._writer, json.dumps(news).encode() + b"\n")


NOTHING = _Left(0, 0)


def _hash(told: bytes, salt: bytes) -> int:
    return int.from_bytes(hashlib.blake2b(told, digest_size=8, salt=salt).digest(), "little") or 1


def search(
    bounds: Bounds, starts: Sequence[str], workers: int = 2, on_news: Callable[[Search], None] = _nobody
) -> Search:
    """Everything within `bounds` from each of `starts`. `on_news` receives each story and each task that is done.

    Ctrl-C ends it, with what was found until then. Raises RuntimeError when a searching process died.
    """
    began, used_s = time.perf_counter(), _cpu_s()
    shared, found = _Shared(), Search()
    reader, writer = os.pipe()
    children = _fork(bounds, starts, shared, (reader, writer), workers, found)
    os.close(writer)
    try:
        with os.fdopen(reader, "rb") as pipe:
            for line in pipe:
                _take(line, found)
                found.states, found.steps = shared.count(STATES), shared.count(STEPS)
                on_news(found)
    except KeyboardInterrupt:
        for child in children:
            os.kill(child, signal.SIGTERM)
    failed = [child for child in children if os.waitpid(child, 0)[1] not in (0, signal.SIGTERM)]
    if failed:
        raise RuntimeError(f"{len(failed)} of {workers} searching processes died")
    found.states, found.steps = shared.count(STATES), shared.count(STEPS)
    found.cpu_s, found.real_s = _cpu_s() - used_s, time.perf_counter() - began
    return found


def _take(line: bytes, found: Search) -> None:
    told = json.loads(line)
    if told == DONE:
        found.done += 1
    else:
        found.stories.append(_story(told))


def _fork(
    bounds: Bounds, starts: Sequence[str], shared: _Shared, pipe: tuple[int, int], workers: int, found: Search
) -> list[int]:
    """The processes of the search. Each takes the next task when it has done one: a first event at some point."""
    first = _Worker(bounds, shared, pipe[1])
    left = _Left(bounds.faults, bounds.operator)
    tasks = [(snapshot, row) for start in starts for snapshot, rows in first.begin(_World(start), left) for row in rows]
    found.tasks = len(tasks)
    todo, give = os.pipe()
    os.write(give, b"".join(struct.pack("<H", number) for number in range(len(tasks))))
    os.close(give)
    children = []
    for _ in range(workers):
        child = os.fork()
        if child == 0:
            _work(first, tasks, left, todo, pipe[0])
        children.append(child)
    os.close(todo)
    return children


def _work(worker: _Worker, tasks: list[tuple[Snapshot, int]], left: _Left, todo: int, reader: int) -> None:
    """The whole life of a forked process: it never returns."""
    status = 1
    try:
        os.close(reader)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to all; the first process ends it
        gc.collect()
        gc.freeze()
        gc.set_threshold(*COLLECTED)
        while number := os.read(todo, 2):
            snapshot, row = tasks[struct.unpack("<H", number)[0]]
            worker.branch(snapshot, row, left)
            worker.say(DONE)
        status = 0
    except BaseException:  # noqa: BLE001 - reported, and an exit code
        traceback.print_exc()
    finally:
        os._exit(status)


def _cpu_s() -> float:
    """Of all processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _story(told: list[Any]) -> Story:
    start, events, name, at_s, detail = told
    return Story(start, tuple((at, event) for at, event in events), Found(name, at_s, detail))


def shortest(stories: Sequence[Story]) -> dict[str, Story]:
    """For each property the story with the fewest events, and of those the one that ends first."""
    told: dict[str, Story] = {}
    for story in sorted(stories, key=lambda story: (len(story.events), story.found.at_s, story.start, story.events)):
        told.setdefault(story.found.name, story)
    return told
