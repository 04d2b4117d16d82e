"""Voltage, current and temperature of one node by SDO, now and then: outside of the cycle, one request at a time.

What a drive has of them is in its profile. A request that is not answered is left, the next one comes in its turn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.drive import Drive
from canbase_config.profile import Measured
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import NO_OBJECT, NO_SUB_INDEX, Read, SdoAborted, SdoClient, SdoError

PERIOD_S = 0.25
"""Between two requests to one node."""
STALE_S = 10.0
"""A value that is older is none."""
_NEXT_AXIS = 0x800


@dataclass(frozen=True, slots=True)
class Values:
    """NaN: the drive has no such object, or did not answer of late."""

    voltage_v: float = math.nan
    current_a: float = math.nan
    temperature_c: float = math.nan


UNKNOWN = Values()


@dataclass(slots=True)
class _Point:
    """One object of one axis, and its last value."""

    axis: int
    name: str
    read: Read
    measured: Measured
    value: float = math.nan
    at: float = -math.inf


class Measures:
    """Reads in turn what the profile of a node measures."""

    def __init__(self, node_id: int, drives: tuple[Drive, ...], timeout_s: float) -> None:
        """`timeout_s`: for one answer [s]."""
        self._client = SdoClient(node_id, timeout_s, attempts=1)
        self._points = [point for drive in drives for point in _points(drive)]
        self._turn = 0
        self._asked_at = -math.inf
        self._waits = False

    def tick(self, now_s: float) -> list[Frame]:
        """The next request, when one is due."""
        if self._waits:
            frames = self._client.tick(now_s)
            self._take(now_s)
            return frames
        if not self._points or now_s < self._asked_at + PERIOD_S:
            return []
        self._turn = (self._turn + 1) % len(self._points)
        self._asked_at, self._waits = now_s, True
        return [self._client.start(self._points[self._turn].read, now_s)]

    def on_frame(self, frame: Frame, now_s: float) -> list[Frame]:
        """Take an SDO answer; those to somebody else's requests are dropped."""
        if not self._waits:
            return []
        frames = self._client.on_frame(frame, now_s)
        self._take(now_s)
        return frames

    def values(self, axis: int, now_s: float) -> Values:
        """What is known of an axis."""
        fresh = {
            point.name: point.value for point in self._points if point.axis == axis and now_s - point.at <= STALE_S
        }
        return Values(**fresh) if fresh else UNKNOWN

    def _take(self, now_s: float) -> None:
        if self._client.busy:
            return
        self._waits = False
        point = self._points[self._turn]
        try:
            data = self._client.answer()
        except SdoError as error:
            if isinstance(error, SdoAborted) and error.code in (NO_OBJECT, NO_SUB_INDEX):
                self._points.remove(point)
            return
        raw = int.from_bytes(data[: point.measured.bits // 8], "little", signed=point.measured.signed)
        point.value, point.at = raw * point.measured.scale, now_s


def _points(drive: Drive) -> list[_Point]:
    measures = drive.kind.measures
    named = (
        ("voltage_v", measures.voltage),
        ("current_a", measures.current),
        ("temperature_c", measures.temperature),
    )
    return [_Point(drive.axis, name, _read(of, drive.axis), of) for name, of in named if of is not None]


def _read(measured: Measured, axis: int) -> Read:
    if measured.second_axis == "offset":
        return Read(measured.index + _NEXT_AXIS * axis, measured.sub)
    return Read(measured.index, measured.sub + (axis if measured.second_axis == "next_sub" else 0))
