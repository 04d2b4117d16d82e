"""Records stops from their cause to standstill, for the topic stop_events: how long each took, and how far it went.

A stop is opened by the driver's core (`StopRecord`), by the safety filter or the velocity mux when they begin to hold a
base that moves, or by a command that ends while it moves. It is reported once the base stands, when it was released
before, or after `report_after_s`. Pure: fed with snapshots and with the states of the other nodes; times are local
monotonic seconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, auto

from canbase_driver.snapshot import DriverSnapshot
from canbase_runtime.driver_state import DriverState

ORDER_AGE_S = 0.1
"""A source that ordered motion so short before its end was lost; one that ordered zero had ended by itself."""
FILTER, MUX, DRIVER = "safety_filter", "velocity_mux", "motor_driver"
NOBODY = "nobody"
"""In place of them, in a recording that was requested: nothing has stopped the base."""
STALE, NO_SOURCE = "command_stale", "no_source"
"""Words for people, in a `StopRecord`."""


class HeldBy(Enum):
    """What holds the base in a stop, and may release it before it stands."""

    FILTER = auto()
    MUX = auto()
    STALE_COMMAND = auto()
    DRIVER = auto()
    """The driver's core: it releases nothing that it has begun to stop."""


@dataclass(frozen=True, slots=True)
class StopRecord:
    """One stop of a moving or enabled base, for the topic stop_events."""

    stopped_by: str
    """velocity_mux, safety_filter, motor_driver or watchdog."""
    cause: str
    detail: str
    """One sentence with the values."""
    latched: bool
    """It needs a reset."""
    clears_on: str
    at_s: float
    """Local monotonic time of the cause [s]."""


@dataclass(frozen=True, slots=True)
class StopReport:
    """A stop that is over. NaN: not measured; `distance_m` is the length of the way, `turned_rad` counter-clockwise."""

    record: StopRecord
    standstill: bool
    standstill_s: float
    distance_m: float
    turned_rad: float


def standstill_text(report: StopReport) -> str:
    """When and after how many metres the base stood, for a log line that begins with "standstill"."""
    if not report.standstill:
        return "not seen"
    if math.isnan(report.distance_m):
        return f"after {report.standstill_s:.2f} s, distance not measured"
    return f"after {report.standstill_s:.2f} s and {report.distance_m:.3f} m"


@dataclass(slots=True)
class _OpenStop:
    """A stop on its way. `released`: what held the base holds it no longer."""

    record: StopRecord
    held_by: HeldBy
    stood: bool
    measured: bool = True
    distance_m: float = 0.0
    turned_rad: float = 0.0
    released: bool = field(default=False)

    def add(self, before: DriverSnapshot, now: DriverSnapshot) -> None:
        """The way between two snapshots."""
        here, there = before.odometry.pose, now.odometry.pose
        self.measured = self.measured and now.odometry.valid
        self.distance_m += math.hypot(there.x_m - here.x_m, there.y_m - here.y_m)
        self.turned_rad += there.yaw_rad - here.yaw_rad

    def report(self, snapshot: DriverSnapshot) -> StopReport:
        """As it is now."""
        stands = snapshot.standstill
        took_s = 0.0 if self.stood else max(0.0, snapshot.time_s - self.record.at_s)
        distance_m, turned_rad = (self.distance_m, self.turned_rad) if self.measured else (math.nan, math.nan)
        return StopReport(self.record, stands, took_s if stands else math.nan, distance_m, turned_rad)


class StopHistory:
    """All stops that are not reported yet."""

    def __init__(self, report_after_s: float) -> None:
        """`report_after_s`: after this long without a standstill the stop is reported all the same [s]."""
        self._report_after_s = report_after_s
        self._previous: DriverSnapshot | None = None
        self._open: list[_OpenStop] = []
        self._moved_at = -math.inf
        self._filter_stops = self._mux_idle = False

    def note_velocity_command(self, moves: bool, now_s: float) -> None:
        """A velocity command came; `moves`: it is not zero."""
        if moves:
            self._moved_at = now_s

    def on_filter(self, stop: StopRecord | None, now_s: float) -> None:
        """From the safety filter: whether it holds the base, and why; None: it does not."""
        if stop is None:
            self._note_release(HeldBy.FILTER)
        elif not self._filter_stops and (self._is_moving or self._ordered_motion(now_s)):
            self._begin(stop, HeldBy.FILTER)
        self._filter_stops = stop is not None

    def on_mux(self, active: str, detail: str, now_s: float) -> None:
        """From the mux: which source drives, empty: none; `detail`: why the last one does not."""
        idle = not active
        if idle and not self._mux_idle and self._is_moving and self._ordered_motion(now_s):
            self._begin(StopRecord(MUX, NO_SOURCE, detail, False, "a source that sends", now_s), HeldBy.MUX)
        if not idle:
            self._note_release(HeldBy.MUX)
        self._mux_idle = idle

    def on_snapshot(self, snapshot: DriverSnapshot, stops: list[StopRecord]) -> list[StopReport]:
        """Take what the driver knows now, and the stops that it began since the last call. What is over."""
        before = self._previous or snapshot
        for record in stops:
            self._begin(record, HeldBy.DRIVER)
        self._look_for_stale(before, snapshot)
        for stop in self._open:
            stop.add(before, snapshot)
        self._previous = snapshot
        over = [stop for stop in self._open if self._is_over(stop, snapshot)]
        self._open = [stop for stop in self._open if stop not in over]
        return [stop.report(snapshot) for stop in over]

    def end(self) -> list[StopReport]:
        """The driver ends: what is still open."""
        last, rest, self._open = self._previous, self._open, []
        return [stop.report(last) for stop in rest] if last is not None else []

    def _look_for_stale(self, before: DriverSnapshot, snapshot: DriverSnapshot) -> None:
        ended = before.command.fresh and not snapshot.command.fresh
        at_s = snapshot.time_s - snapshot.command.age_s
        moved = self._moved_at >= at_s - ORDER_AGE_S
        if ended and moved and self._is_moving and snapshot.state is DriverState.ENABLED:
            detail = f"no message on cmd_vel for {snapshot.command.age_s:.2f} s"
            self._begin(
                StopRecord(DRIVER, STALE, detail, False, "a fresh command", snapshot.time_s), HeldBy.STALE_COMMAND
            )
        if snapshot.command.fresh:
            self._note_release(HeldBy.STALE_COMMAND)

    @property
    def _is_moving(self) -> bool:
        return self._previous is not None and not self._previous.standstill

    def _ordered_motion(self, now_s: float) -> bool:
        return now_s - self._moved_at <= ORDER_AGE_S

    def _begin(self, record: StopRecord, held_by: HeldBy) -> None:
        self._open.append(_OpenStop(record, held_by, stood=not self._is_moving))

    def _note_release(self, holder: HeldBy) -> None:
        for stop in self._open:
            stop.released = stop.released or (stop.held_by is holder and not stop.record.latched)

    def _is_over(self, stop: _OpenStop, snapshot: DriverSnapshot) -> bool:
        late = snapshot.time_s - stop.record.at_s > self._report_after_s
        return snapshot.standstill or stop.released or late
