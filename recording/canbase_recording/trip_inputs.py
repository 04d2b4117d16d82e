"""The file of a trip's inputs: every call of the watchdog that ran, in its order. Pure; docs/ros_api.md has its form.

canbase_watchdog.input_ring writes it. It may come from anybody: each value is checked, and its size is bounded.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from canbase_config.watchdog import WatchdogConfig
from canbase_recording.input_lines import finite, head_of, json_line
from canbase_recording.recorded_inputs import NoInputsError
from canbase_watchdog.input_ring import END, EXPIRE, FORMAT, FRAME, LEASE, MAX_INPUTS, START, SUSPEND, TICK, VERDICT
from canbase_watchdog.latch import Entry, Mark, Past

LINE_BYTES: Final = 200_000
"""Of one line."""
_COB_IDS: Final = range(0x800)
_FRAME_BYTES, _DATAGRAM_BYTES = 8, 256

Call = tuple[Any, ...]
"""What it is, its time [s], and its values, as the watchdog's loop noted it."""


@dataclass(frozen=True, slots=True)
class RecordedVerdict:
    """From this time on [s] the watchdog was tripped for this cause (its number); 0: it was not."""

    at_s: float
    cause: int
    node_id: int
    detail: str


@dataclass(frozen=True, slots=True)
class TripHead:
    """The first line. Times: monotonic seconds of the robot's computer."""

    robot: str
    config: WatchdogConfig
    past: Past | None
    """The record on disk at the start of that watchdog."""
    trip: RecordedVerdict
    wall_offset_s: float
    """On top of a time: seconds since 1970."""


@dataclass(frozen=True, slots=True)
class TripInputs:
    """One file."""

    head: TripHead
    calls: tuple[Call, ...]
    verdicts: tuple[RecordedVerdict, ...]

    @property
    def has_start(self) -> bool:
        """The life of that watchdog begins in it: nothing that it knew is missing."""
        return bool(self.calls) and self.calls[0][0] == START

    @property
    def began_s(self) -> float:
        """Of the first call [s]."""
        return float(self.calls[0][1]) if self.calls else self.head.trip.at_s

    @property
    def ends_s(self) -> float:
        """Of the last call [s]."""
        return float(self.calls[-1][1]) if self.calls else self.head.trip.at_s


def trip_inputs(lines: Iterable[str]) -> TripInputs:
    """`lines` of the file, the head first. Raises NoInputsError, with the number of the line."""
    numbered = enumerate(lines, 1)
    head = trip_head(next(numbered, (1, ""))[1])
    calls: list[Call] = []
    verdicts: list[RecordedVerdict] = []
    for number, line in numbered:
        if number > MAX_INPUTS + 1:
            raise NoInputsError(f"line {number}: canbase writes no more than {MAX_INPUTS}")
        call = _call(json_line(line, number, LINE_BYTES), number)
        if call[0] == VERDICT:
            verdicts.append(RecordedVerdict(*call[1:]))
        else:
            calls.append(call)
    return TripInputs(head, tuple(calls), tuple(verdicts))


def trip_head(line: str) -> TripHead:
    """Of the first line. Raises NoInputsError."""
    head = head_of(line, LINE_BYTES, "watchdog", FORMAT, "a watchdog's trip")
    try:
        trip, past = head["trip"], head["past"]
        return TripHead(
            robot=str(head["robot"]),
            config=WatchdogConfig.from_json(json.dumps(head["config"])),
            past=None if past is None else _past(past),
            trip=RecordedVerdict(finite(trip["at_s"]), int(trip["cause"]), int(trip["node_id"]), str(trip["detail"])),
            wall_offset_s=finite(head["wall_offset_s"]),
        )
    except KeyError as error:
        raise NoInputsError(f"line 1: the key {error} is missing") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise NoInputsError(f"line 1: a value is not what it must be: {str(error)[:200]}") from error


def _past(values: Mapping[str, Any]) -> Past:
    entry = dict(values["entry"])
    return Past(Entry(**{**entry, "mark": Mark(entry["mark"])}), str(values["problem"]), int(values["sequence"]))


def _call(values: Any, number: int) -> Call:
    try:
        what, at_s, *rest = values
        call = what, finite(at_s), *_READ[what](rest)
    except (KeyError, TypeError, ValueError) as error:
        raise NoInputsError(f"line {number}: no input of a watchdog ({str(error)[:80]})") from error
    return call


def _bytes(text: Any, most: int) -> bytes:
    data = bytes.fromhex(text)
    if len(data) > most:
        raise ValueError(f"{len(data)} bytes, at most {most}")
    return data


def _frame(values: list[Any]) -> Call:
    cob_id, data = values
    if type(cob_id) is not int or cob_id not in _COB_IDS:
        raise ValueError(f"{cob_id} is no 11-bit identifier")
    return cob_id, _bytes(data, _FRAME_BYTES)


def _lease(values: list[Any]) -> Call:
    datagram, uid, pid = values
    return _bytes(datagram, _DATAGRAM_BYTES), *(None if each is None else int(each) for each in (uid, pid))


def _tick(values: list[Any]) -> Call:
    failed_since, errors = values
    return math.inf if failed_since is None else finite(failed_since), int(errors)


def _verdict(values: list[Any]) -> Call:
    cause, node_id, detail = values
    return int(cause), int(node_id), str(detail)


def _nothing(values: list[Any]) -> Call:
    if values:
        raise ValueError("too many values")
    return ()


_READ: Final[Mapping[str, Callable[[list[Any]], Call]]] = {
    START: _nothing,
    FRAME: _frame,
    LEASE: _lease,
    TICK: _tick,
    EXPIRE: _nothing,
    SUSPEND: lambda values: (finite(values[0]),),
    END: _nothing,
    VERDICT: _verdict,
}
