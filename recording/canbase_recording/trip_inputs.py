"""The file of a trip's inputs: every call of the watchdog that ran, in its order. Pure; docs/ros_api.md has its form.

canbase_watchdog.input_ring writes it. It may come from anybody: each value is checked, and its size is bounded.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter, ValidationError

from canbase_base.latch_record import Found
from canbase_config.watchdog import WatchdogConfig
from canbase_recording.input_lines import NoInputsError, Time, first_of, head_of, json_line, read_call, readers
from canbase_watchdog.input_ring import END, EXPIRE, FORMAT, FRAME, LEASE, MAX_INPUTS, START, SUSPEND, TICK, VERDICT

LINE_BYTES: Final = 200_000
"""Of one line."""

Call = tuple[Any, ...]
"""What it is, its time [s], and its values, as the watchdog's loop noted it."""


@dataclass(frozen=True, slots=True)
class RecordedVerdict:
    """From this time on [s] the watchdog was tripped for this cause (its number); 0: it was not."""

    at_s: Time
    cause: int
    node_id: int
    detail: str


@dataclass(frozen=True, slots=True)
class TripHead:
    """The first line. Times: monotonic seconds of the robot's computer."""

    robot: str
    config: WatchdogConfig
    past: Found | None
    """The record on disk at the start of that watchdog."""
    trip: RecordedVerdict
    wall_offset_s: Time
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
        call = read_call(json_line(line, number, LINE_BYTES), number, _CALLS, "a watchdog")
        if call[0] == VERDICT:
            verdicts.append(RecordedVerdict(*call[1:]))
        else:
            calls.append(call)
    return TripInputs(head, tuple(calls), tuple(verdicts))


def trip_head(line: str) -> TripHead:
    """Of the first line. Raises NoInputsError."""
    head = head_of(line, LINE_BYTES, "watchdog", FORMAT, "a watchdog's trip")
    try:
        values = {name: head[name] for name in ("robot", "past", "trip", "wall_offset_s")}
        return _HEAD.validate_python({**values, "config": WatchdogConfig.from_json(json.dumps(head["config"]))})
    except KeyError as error:
        raise NoInputsError(f"line 1: the key {error} is missing") from error
    except ValidationError as error:
        raise NoInputsError(f"line 1: a value is not what it must be: {first_of(error)}") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise NoInputsError(f"line 1: a value is not what it must be: {str(error)[:200]}") from error


def _hex(most: int) -> Any:
    return Annotated[bytes, BeforeValidator(lambda text: bytes.fromhex(text)), Field(max_length=most)]


_HEAD: Final = TypeAdapter(TripHead)
_CALLS: Final = readers(
    {
        START: (),
        FRAME: (Annotated[int, Field(ge=0, lt=0x800, strict=True)], _hex(8)),
        LEASE: (_hex(256), int | None, int | None),
        TICK: (Annotated[Time | None, AfterValidator(lambda since: math.inf if since is None else since)], int),
        EXPIRE: (),
        SUSPEND: (Time,),
        END: (),
        VERDICT: (int, int, str),
    }
)
