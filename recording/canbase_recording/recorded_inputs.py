"""Both files of a black box as one: frames, and what went into the parts of the chain, on the robot's monotonic clock.

Pure; reading the files is `replay_file.py`. What the .json file is, docs/ros_api.md describes ("The black box").
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from canbase_config.watchdog import WatchdogConfig
from canbase_recording.entry import Entry, FrameKind, RecordedFrame

FORMAT: Final = 1
"""canbase_driver.runtime.black_box_json writes it."""


class NoInputsError(Exception):
    """The .json file is none of a black box, or of a newer canbase. The text says what is wrong."""


@dataclass(frozen=True, slots=True)
class Command:
    """A message on cmd_vel that the driver received at `at_s` [s]."""

    at_s: float
    linear_mps: float
    angular_radps: float


@dataclass(frozen=True, slots=True)
class Happening:
    """Any event of the .json file: its time [s], what it is, and its values as they stand there."""

    at_s: float
    what: str
    values: Mapping[str, Any]

    def number(self, name: str) -> float:
        """A value as a number; NaN: it is none."""
        value = self.values.get(name)
        try:
            return float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return math.nan


@dataclass(frozen=True, slots=True)
class RecordedInputs:
    """One recorded stop. All times: monotonic seconds of the robot's computer."""

    frames: tuple[RecordedFrame, ...]
    """Each once; `sent`: by the driver, where no echo came back."""
    commands: tuple[Command, ...]
    happenings: tuple[Happening, ...]
    began_s: float
    wall_offset_s: float
    """On top of a time: seconds since 1970."""
    at_s: float
    """Of the stop."""
    stopped_by: str
    cause: str
    detail: str
    robot_yaml: Mapping[str, Any]
    profiles: Mapping[str, str]
    watchdog: WatchdogConfig
    versions: Mapping[str, str]

    @property
    def ends_s(self) -> float:
        """Of the last frame; of its beginning where there is none."""
        return self.frames[-1].at_s if self.frames else self.began_s

    def of(self, what: str) -> Iterator[Happening]:
        """The events of one kind."""
        return (each for each in self.happenings if each.what == what)


def recorded_inputs(entries: Iterable[Entry], told: Mapping[str, Any]) -> RecordedInputs:
    """`entries` of the .asc file, `told`: the .json file. Raises NoInputsError."""
    if told.get("format") != FORMAT:
        raise NoInputsError(
            f"format {str(told.get('format'))[:20]!r}, expected {FORMAT}: of another version of canbase?"
        )
    try:
        watchdog = _watchdog(told["watchdog_config"])
        began_s, at_s = float(told["began_s"]), float(told["at_s"])
        happenings = tuple(_happenings(told["events"]))
        robot_yaml, profiles = dict(told["robot_yaml"]), dict(told["profiles"])
        frames = tuple(_frames(entries, began_s))
        return RecordedInputs(
            frames=_each_once(frames, watchdog.bus_arguments),
            commands=tuple(_command(each) for each in happenings if each.what == "cmd_vel"),
            happenings=happenings,
            began_s=began_s,
            wall_offset_s=float(told["wall_offset_s"]),
            at_s=at_s,
            stopped_by=str(told.get("stopped_by", "")),
            cause=str(told.get("cause", "")),
            detail=str(told.get("detail", "")),
            robot_yaml=robot_yaml,
            profiles=profiles,
            watchdog=watchdog,
            versions=dict(told.get("versions", {})),
        )
    except KeyError as error:
        raise NoInputsError(f"the key {error} is missing") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise NoInputsError(f"a value is not what it must be: {error}") from error


def hears_itself(bus_arguments: Mapping[str, Any], frames: Sequence[RecordedFrame]) -> bool:
    """On this bus a sender receives what it sends, and most of its frames did come back."""
    if bus_arguments.get("interface") != "udp_multicast" and not bus_arguments.get("receive_own_messages"):
        return False
    sent = [(frame.cob_id, frame.data) for frame in frames if frame.sent]
    received = {(frame.cob_id, frame.data) for frame in frames if not frame.sent}
    return sum(each in received for each in sent) > len(sent) / 2


def _watchdog(values: Mapping[str, Any]) -> WatchdogConfig:
    return WatchdogConfig.from_json(json.dumps(values))


def _frames(entries: Iterable[Entry], began_s: float) -> Iterator[RecordedFrame]:
    for entry in entries:
        if isinstance(entry, RecordedFrame) and entry.kind is FrameKind.DATA:
            yield entry._replace(at_s=began_s + entry.at_s)


def _each_once(frames: tuple[RecordedFrame, ...], bus_arguments: Mapping[str, Any]) -> tuple[RecordedFrame, ...]:
    """Where what the driver sends comes back, the echo has the time at which it was on the bus."""
    if hears_itself(bus_arguments, frames):
        return tuple(frame for frame in frames if not frame.sent)
    return frames


def _happenings(events: Sequence[Mapping[str, Any]]) -> Iterator[Happening]:
    for event in events:
        at_s = float(event["at_s"])
        if math.isfinite(at_s):
            yield Happening(at_s, str(event["what"]), event)


def _command(event: Happening) -> Command:
    return Command(event.at_s, event.number("linear_mps"), event.number("angular_radps"))
