"""What of a world decides about its future, as one number: two worlds with the same number go on alike.

Times count as ages, and an age beyond `OLD_S` is old; counters and paths that no decision looks at are left out.
Two worlds that differ in the fourth digit of a speed count as the same: that is the one rounding here.
"""

from __future__ import annotations

import marshal
import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from functools import cache, partial
from random import Random
from types import BuiltinFunctionType, FunctionType, GeneratorType, MethodType
from typing import TYPE_CHECKING, Any

from canbase_campaign.clock import Clock
from canbase_campaign.process import Process, Topics
from canbase_campaign.world import World
from canbase_sim.cia301.dictionary import Dictionary

if TYPE_CHECKING:
    from small_worlds.properties import Properties
    from small_worlds.world import SmallWorld

PLAIN = 2
"""The version of marshal's format in which equal values give equal bytes."""
OLD_S = 1.05
"""Longer than any timeout of the small robot that ends in what the properties look at: what is older has run out."""
EPOCH_S = 50.0
"""A number nearer than this to the present is a time, if it is not before BEGAN_S: nothing else is as large."""
BEGAN_S = 99.0
"""The clock begins at 100 s."""
DIGITS = 3
UNSEEN = frozenset((
    # counters, and what is only shown to people
    "_stats", "_told", "_mux_told", "_cycle", "_sequence", "sequence", "received", "refused", "frames_dropped",
    "dropped", "serial", "stops", "trips", "counters", "lease_age_ms", "stamp_ns", "seen", "detail", "snapshot",
    "_status_at", "_mux_state_at", "_state_at", "_counters_due", "_longest_gap_s", "_request", "answered", "_reset_at",
    "_sdo_turn", "_stamp_ns", "changes", "lost_producers", "_measures", "report", "copies", "_copies",
    "copied", "copied_at", "_signs",
    # where the base is: no decision of these parts looks at it; that of the scanner sees nothing
    "_feed", "travel", "travel_m", "_travel_m", "_anchor_m", "_counts", "_counts_before", "_poses", "encoder_offset",
    "_seen_m", "_from_m", "_restarts",
    # what never changes
    "_robot", "robot", "_config", "config", "drive", "layout", "scale", "personality", "_geometry", "dictionary",
    "_timeouts", "clock", "_member", "_topics", "_late", "_kept", "_life", "_random", "_routes", "_heeds", "_handlers",
    "_values", "note",
    # only encoders that come and go, or jump, look at it
    "_time_s",
    # a bound on when a heartbeat can be missed: of the times that are seen anyway
    "_none_before",
    # when an SDO was requested last: only how late an answer is depends on it, and none is late
    "_requests",
    # of the records on the disk what was written last counts
    "file", "_owner", "_cycles", "reset",
))  # fmt: skip
"""Names of fields that no decision looks at."""
VALUES_UNSEEN = frozenset((0x6064, 0x6864, 0x606C, 0x6041, 0x606B, 0x6077))
"""Objects of a drive that repeat the state of its motor: position, velocity, statusword, demand, torque."""
_FIXED = (
    FunctionType,
    BuiltinFunctionType,
    MethodType,
    partial,
    type,
    GeneratorType,
    Clock,
    Random,
    Topics,
    Dictionary,
)


class Canon:
    """Walks through objects; `form` gives nested tuples of plain values."""

    def __init__(self, now_s: float) -> None:
        self._now = now_s
        self._known: dict[int, object] = {}

    def form(self, thing: Any) -> Any:
        """`thing` as plain values; an object that is within itself ends there."""
        kind: Any = type(thing)
        if kind is float:
            return self._number(thing)
        if kind in _PLAIN:
            return thing
        if kind in _SEQUENCES:
            return tuple(self._forms(thing))
        if kind is dict:
            return tuple([(str(key), self.form(value)) for key, value in thing.items()])
        if kind in _SETS:
            return tuple(sorted([str(each) for each in thing]))
        if _is_enum(kind):
            return thing._name_
        return "" if _is_fixed(kind) else self._object(thing, kind)

    def _forms(self, things: Iterable[Any]) -> list[Any]:
        number, form = self._number, self.form
        told = []
        for thing in things:
            kind = type(thing)
            told.append(number(thing) if kind is float else thing if kind in _PLAIN else form(thing))
        return told

    def _number(self, number: float) -> object:
        age_s = self._now - number
        if number >= BEGAN_S and -EPOCH_S < age_s < EPOCH_S:
            return ("age", round(age_s, DIGITS) if age_s < OLD_S else "old")
        return round(number, DIGITS) + 0.0 if math.isfinite(number) else str(number)

    def _object(self, thing: Any, kind: Any) -> object:
        known = self._known.get(id(thing))
        if known is None:
            self._known[id(thing)] = "itself"
            known = self._known[id(thing)] = (kind.__name__, *self._forms(_seen(thing, kind)))
        return known


_PLAIN = frozenset((int, str, bytes, bool, type(None)))
_SEQUENCES = frozenset((tuple, list, deque))
_SETS = frozenset((set, frozenset))


def _seen(thing: Any, kind: Any) -> list[Any]:
    """The value of each field that counts, slots and all."""
    values = [getattr(thing, name) for name in _slots(kind) if hasattr(thing, name)]
    return values + [value for name, value in getattr(thing, "__dict__", {}).items() if name not in UNSEEN]


@cache
def _slots(kind: type) -> tuple[str, ...]:
    names: list[str] = []
    for base in kind.__mro__:
        slots = vars(base).get("__slots__", ())
        names += (slots,) if isinstance(slots, str) else slots
    return tuple(name for name in names if name not in UNSEEN)


@cache
def _is_enum(kind: type) -> bool:
    return issubclass(kind, Enum)


@cache
def _is_fixed(kind: type) -> bool:
    return issubclass(kind, _FIXED) or kind.__module__.startswith("canbase_config")


def told(small: SmallWorld, properties: Properties) -> bytes:
    """All that decides, as bytes."""
    now_s = small.world.clock.now_s
    more = {
        "ends": sorted((round(at_s - now_s, DIGITS), name) for at_s, name in small.ends),
        "stick": (small.held, small.has_radio),
        "button": small.around.pressed,
        "disks": [(disk.file.writable, disk.readable) for disk in small.disks.values()],
        "resets": len(small.resets) - sum(outcome.done for outcome in small.resets),
        "properties": properties.memory,
    }
    told: Any = form(small.world, more)
    return marshal.dumps(told, PLAIN)


def form(world: World, more: Mapping[str, object]) -> tuple[object, ...]:
    """All that decides: cores, living parts, drives, wheels, cables, what is on its way, and `more`."""
    canon = Canon(world.clock.now_s)
    processes = (world.driver, world.watchdog, world.velocity)
    bench = world.drives.bench
    return (
        *[_process(canon, process) for process in processes],
        *[canon.form((node.state, node.line, node.axes, node._consumer, node._bus_on_at, node._boot_at))
          for node in bench.nodes.values()],
        *[_values(canon, node.dictionary.values) for node in bench.nodes.values()],
        round(bench.base.v_left_mps, DIGITS) + 0.0, round(bench.base.v_right_mps, DIGITS) + 0.0,
        canon.form(world.bus.disturbance), canon.form(world.topics.loss), world.lease_loss,
        _waiting(world),
        *[(name, canon.form(value)) for name, value in more.items()],
    )  # fmt: skip


def _process(canon: Canon, process: Process) -> object:
    kept = tuple((channel, len(things)) for channel, things in process._kept.items())
    return (process.alive, kept, canon.form(process) if process.alive else "")


def _values(canon: Canon, values: Mapping[int, int]) -> object:
    return tuple([value for address, value in values.items() if address >> 8 not in VALUES_UNSEEN])


def _waiting(world: World) -> object:
    """What is on its way, and when: each timer and message by the name of what it calls."""
    now_s = world.clock.now_s
    return tuple(sorted((round(when - now_s, DIGITS), _name(do)) for when, _, do, _ in world.clock._events))


def _name(do: Callable[..., object]) -> str:
    return getattr(do, "__qualname__", "") or type(do).__name__
