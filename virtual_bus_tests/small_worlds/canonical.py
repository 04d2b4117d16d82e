"""What of a world decides about its future, as one number: two worlds with the same number go on alike.

Times count as ages, and an age beyond `OLD_S` is old; counters and paths that no decision looks at are left out, each
for a reason (IGNORED). merged.py steps worlds that count as the same side by side.
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
EPOCH_S = 70.0
"""A number nearer than this to the present is a time, if it is not before BEGAN_S: nothing else is as large. The
longest deadline, of an SDO transfer, is 60 s ahead."""
BEGAN_S = 99.0
"""The clock begins at 100 s."""
DIGITS = 3
IGNORED = {
    "a count that is shown alone": (
        "DriverCore._stats DriverCore.frames_dropped DriverCore.stops Watchdog.trips "
        "Watchdog._longest_gap_s Watchdog._counters_due _Source.received _Source.refused VelocityCommand.refused "
        "LeaseBook.refused Observer.dropped BusReport.dropped SdoClient.dropped WatchdogLink.counters "
        "WatchdogState.lease_age_ms"
    ),
    "a text for people": "Verdict.detail Decision.detail Finding.detail Record.detail",
    "evidence for a sentence alone, of all steps since the boot": (
        "FeedbackFactor._at FeedbackFactor._raw FeedbackFactor._counts FeedbackFactor._steps "
        "FeedbackFactor._velocity_mps FeedbackFactor._way_m FeedbackFactor._shown_m FeedbackFactor._xx "
        "FeedbackFactor._xy FeedbackFactor._yy"
    ),
    "what was published last": (
        "VelocityProcess._told VelocityProcess._mux_told Watchdog._reported_status DriverProcess._told Axis._told "
        "DriverProcess.snapshot CanopenNode._measures CanopenNode.report NodeBoot.report"
    ),
    "when a state is published again that did not change": (
        "DriverProcess._cycle DriverProcess._status_at VelocityProcess._mux_state_at VelocityProcess._state_at"
    ),
    "counts of frames that came twice: no bus of a small world duplicates one": "_Share.frames _Share.copies",
    "the newest frame, to know its copy again: there is none, and it holds the place on the way": "Copies._data",
    "numbered on, and compared with the one before alone": (
        "VelocityProcess._sequence VelocityProcess._stamp_ns Lease.sequence Lease.stamp_ns WatchdogLink._request "
        "WatchdogState.answered BaseReady._cycles"
    ),
    "a place on an endless way: the steps between two samples decide, and both are those of now": (
        "DriverCore._feed Axis.travel Axis._raw_position Axis.encoder_offset Stillness._travel_m "
        "StoppingDistance._travel_m "
        "Plausibility._counts Plausibility._counts_before TorqueWatch._counts TorqueWatch._counts_before "
        "StandstillWatch._counts TorqueEvidence._travel_m"
    ),
    "a place that is at most one sample from the newest one, or the same at standstill": (
        "Stillness._anchor_m StoppingDistance._from_m TorqueEvidence._counted_m"
    ),
    "the motion between two scans: the scanner of a small world sees nothing": "ExpectedMotion._poses",
    "the same object for ever, or told elsewhere: dictionaries, disks": (
        "Process._member Process.clock DriverProcess._topics VelocityProcess._topics DriverProcess._random "
        "VelocityProcess.note DriverCore._handlers Observer._routes CanopenNode._values HeartbeatConsumer._values "
        "Axis.scale Axis.personality Axis.dictionary Axis.drive _Record.drive StopDisk._owner StopDisk.part "
        "StopDisk.file"
    ),
    "of a process that hangs: `form` tells its channels and timers": "Process._late Process._kept Process._life",
    "looked at by encoders that come and go, or jump: no event makes one": "Encoder._time_s",
    "a bound on when a heartbeat can be missed: of the times that are told anyway": "HeartbeatConsumer._none_before",
    "how late an answer is: none is late here": "SdoClient._requests GuardRequests._requests",
    "which object of a drive that stands is read next, and that such readings become seldom: no stop waits for one": (
        "Stopper._sdo_turn"
    ),
}
"""Why no decision looks at it → fields, as `Class.name`; a class stands for those that are derived from it."""
UNSEEN = {field: reason for reason, fields in IGNORED.items() for field in fields.split()}
VALUES_UNSEEN = frozenset((0x6064, 0x6864, 0x606C, 0x6041, 0x606B, 0x6077))
"""Objects of a drive that repeat the state of its motor: position, velocity, statusword, demand, torque."""
COUNTERS_FRAME = 0x2FE
"""docs/bus.md: shown alone."""
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
            told_s = round(age_s, DIGITS)
            return ("age", told_s if told_s < OLD_S else "old")
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
    unseen = _unseen(kind)
    return values + [value for name, value in getattr(thing, "__dict__", {}).items() if name not in unseen]


@cache
def _unseen(kind: type) -> frozenset[str]:
    """Names of its fields that do not count."""
    of = {base.__name__ for base in kind.__mro__}
    return frozenset(name for owner, _, name in (field.partition(".") for field in UNSEEN) if owner in of)


@cache
def _slots(kind: type) -> tuple[str, ...]:
    names: list[str] = []
    for base in kind.__mro__:
        slots = vars(base).get("__slots__", ())
        names += (slots,) if isinstance(slots, str) else slots
    return tuple(name for name in names if name not in _unseen(kind))


@cache
def _is_enum(kind: type) -> bool:
    return issubclass(kind, Enum)


@cache
def _is_fixed(kind: type) -> bool:
    return issubclass(kind, _FIXED) or kind.__module__.startswith("canbase_config")


def told(small: SmallWorld, properties: Properties) -> bytes:
    """All that decides, as bytes."""
    plain: Any = told_form(small, properties)
    return marshal.dumps(plain, PLAIN)


def told_form(small: SmallWorld, properties: Properties) -> tuple[object, ...]:
    """All that decides, as nested tuples of plain values."""
    now_s = small.world.clock.now_s
    more = {
        "ends": sorted((round(at_s - now_s, DIGITS), name) for at_s, name in small.ends),
        "stick": (small.held, small.has_radio),
        "button": small.around.pressed,
        "disks": [(disk.file.writable, disk.readable) for disk in small.disks.values()],
        "resets": len(small.resets) - sum(outcome.done for outcome in small.resets),
        "properties": properties.memory,
    }
    return form(small.world, more)


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
    kept = tuple((channel, sum(map(_decides, things))) for channel, things in process._kept.items())
    return (process.alive, kept, canon.form(process) if process.alive else "")


def _decides(kept: tuple[object, tuple[Any, ...]]) -> bool:
    """Not the watchdog's counters, which a driver that hung reads as if it had received them in time."""
    return kept[1][:1] != (COUNTERS_FRAME,)


def _values(canon: Canon, values: Mapping[int, int]) -> object:
    return tuple([value for address, value in values.items() if address >> 8 not in VALUES_UNSEEN])


def _waiting(world: World) -> object:
    """What is on its way, and when: each timer and message by the name of what it calls."""
    now_s = world.clock.now_s
    return tuple(sorted((round(when - now_s, DIGITS), _name(do)) for when, _, do, _ in world.clock._events))


def _name(do: Callable[..., object]) -> str:
    return getattr(do, "__qualname__", "") or type(do).__name__
