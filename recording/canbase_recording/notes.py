"""The notes between the frames of a black box: commands, and the states of filter, mux and driver. Pure.

The driver writes them (canbase_driver/runtime/black_box.py, docs/ros_api.md). Whatever is not understood stays text.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from canbase_recording.entry import Note
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause, stop_cause

_NUMBER: Final = r"(-?(?:\d[\d.]*(?:e[-+]?\d+)?|inf)|nan)"
_COMMAND: Final = re.compile(rf"cmd_vel {_NUMBER} m/s {_NUMBER} rad/s")
_FILTER: Final = re.compile(
    rf"safety_filter (\S+) ?(.*?); orders {_NUMBER} m/s {_NUMBER} rad/s(?:, lease (\d+))?", re.DOTALL
)
_MUX: Final = re.compile(r"velocity_mux (.+?); (.*)", re.DOTALL)
_DRIVER: Final = re.compile(r"motor_driver ([A-Z]+)(?:: ([^(;]+?))?(?: \((.*?)\))?(?:; ends with: (.*))?", re.DOTALL)
_TITLE: Final = re.compile(r"stop by (\w+): ([^(]+?) \((.*)\)", re.DOTALL)
NO_SOURCE: Final = "no source"


@dataclass(frozen=True, slots=True)
class CommandNote:
    """A velocity command that the driver received on cmd_vel [m/s], [rad/s]."""

    at_s: float
    linear_mps: float
    angular_radps: float

    @property
    def moves(self) -> bool:
        """It orders motion."""
        return bool(self.linear_mps or self.angular_radps) and math.isfinite(self.linear_mps + self.angular_radps)


@dataclass(frozen=True, slots=True)
class FilterNote:
    """The state of the safety filter: its cause, one sentence, and the velocity that it orders. `lease`: its number."""

    at_s: float
    cause: StopCause
    detail: str
    linear_mps: float
    angular_radps: float
    lease: int

    @property
    def orders_motion(self) -> bool:
        """It lets a velocity through."""
        return bool(self.linear_mps or self.angular_radps)


@dataclass(frozen=True, slots=True)
class MuxNote:
    """The state of the mux. `active`: the source that it follows, empty: none; `detail`: why not the others."""

    at_s: float
    active: str
    detail: str


@dataclass(frozen=True, slots=True)
class DriverNote:
    """A change of the driver's state. `cause` is the word of its cause; empty where the state has none."""

    at_s: float
    state: DriverState
    cause: str
    detail: str
    clears_on: str


@dataclass(frozen=True, slots=True)
class TitleNote:
    """What the recording was written for: the part that stopped the base, and its reason."""

    at_s: float
    stopped_by: str
    cause: str
    detail: str


ParsedNote = CommandNote | FilterNote | MuxNote | DriverNote | TitleNote


def parse_note(note: Note) -> ParsedNote | None:
    """What a note reports; None: a text that this version does not know."""
    at_s, text = note
    if match := _COMMAND.fullmatch(text):
        return CommandNote(at_s, _number(match[1]), _number(match[2]))
    if match := _FILTER.fullmatch(text):
        linear_mps, angular_radps = _number(match[3]), _number(match[4])
        return FilterNote(at_s, stop_cause(match[1]), match[2], linear_mps, angular_radps, int(match[5] or 0))
    if match := _MUX.fullmatch(text):
        return MuxNote(at_s, "" if match[1] == NO_SOURCE else match[1], match[2])
    if (match := _DRIVER.fullmatch(text)) and match[1] in DriverState.__members__:
        return DriverNote(at_s, DriverState[match[1]], match[2] or "", match[3] or "", match[4] or "")
    if match := _TITLE.fullmatch(text):
        return TitleNote(at_s, match[1], match[2], match[3])
    return None


def _number(text: str) -> float:
    """NaN for what only looks like a number."""
    try:
        return float(text)
    except ValueError:
        return math.nan
