"""Both files of a black box as one: frames, and what went into the parts of the chain, on the robot's monotonic clock.

Pure; reading the files is `replay_file.py`. What the .json file is, docs/ros_api.md describes ("The black box").
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from canbase_config.watchdog import WatchdogConfig
from canbase_recording.bus_times import heard_times
from canbase_recording.entry import Entry, FrameKind, RecordedFrame

FORMAT: Final = 1
"""canbase_driver.runtime.black_box_json writes it."""
STAMP_S: Final = 1.0
"""The stamps of one clock are this near to each other, seen from the receiver [s]: others are not the filter's."""


class NoInputsError(Exception):
    """The .json file is none of a black box, or of a newer canbase. The text says what is wrong."""


@dataclass(frozen=True, slots=True)
class Command:
    """A message on cmd_vel that the driver received at `at_s` [s]; `sent_s`: when the filter sent it, and its lease.

    None: its stamp is not of the filter's clock, as of a message that somebody else published there.
    """

    at_s: float
    sent_s: float | None
    linear_mps: float
    angular_radps: float

    @property
    def is_finite(self) -> bool:
        """The filter sends nothing else."""
        return math.isfinite(self.linear_mps) and math.isfinite(self.angular_radps)


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
    """In the order in which they were on the bus; `sent`: by the driver, where no echo came back."""
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
    bitrate: int
    """[bit/s]"""
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
        bitrate = int(robot_yaml["bus"]["bitrate"])
        return RecordedInputs(
            frames=_as_heard(frames, watchdog.bus_arguments, bitrate),
            commands=tuple(_commands(happenings)),
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
            bitrate=bitrate,
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


def _as_heard(
    frames: tuple[RecordedFrame, ...], bus_arguments: Mapping[str, Any], bitrate: int
) -> tuple[RecordedFrame, ...]:
    """As all others heard them, and when: echoes are that, and where there are none, sent frames had to wait."""
    if hears_itself(bus_arguments, frames):
        return tuple(frame for frame in frames if not frame.sent)
    return heard_times(frames, bitrate)


def _happenings(events: Sequence[Mapping[str, Any]]) -> Iterator[Happening]:
    for event in events:
        at_s = float(event["at_s"])
        if math.isfinite(at_s):
            yield Happening(at_s, str(event["what"]), event)


def _commands(happenings: Iterable[Happening]) -> list[Command]:
    """The wall clock may be wrong, and the one of another computer too: what counts is the usual distance."""
    found = [each for each in happenings if each.what == "cmd_vel"]
    distances = [each.number("stamp_s") - each.at_s for each in found]
    known = [distance for distance in distances if math.isfinite(distance)]
    usual_s = median(known) if known else math.nan
    near = [distance for distance in known if abs(distance - usual_s) <= STAMP_S]
    offset_s = max(near, default=math.nan)
    """The message that was on the way for the shortest time: the least that the clocks are apart."""
    return [_command(each, distance, offset_s) for each, distance in zip(found, distances, strict=True)]


def _command(event: Happening, distance_s: float, offset_s: float) -> Command:
    late_s = offset_s - distance_s
    sent_s = event.at_s - late_s if 0.0 <= late_s <= STAMP_S else None
    return Command(event.at_s, sent_s, event.number("linear_mps"), event.number("angular_radps"))
