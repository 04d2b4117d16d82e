"""The metrics of safety_filter/state and velocity_mux/state. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from prometheus_client.core import Metric

from canbase_config.robot import Robot
from canbase_fleet.columns import Column, metrics, one_of
from canbase_runtime.source_standing import LockStanding, SourceStanding, lock_standing, source_standing
from canbase_runtime.stop_cause import StopCause, stop_cause

ACTIONS: Final = ("pass", "limit", "slow", "stop")
"""By their numbers in SafetyState.msg."""
FILTER: Final = (
    Column("estop", "", "The emergency stop holds, or waits for its reset (1).", lambda m: m.estop),
    Column("emergency_braking", "", "The base brakes as hard as it may (1).", lambda m: m.emergency),
    Column("clearance_ahead", "meters", "Free distance ahead.", lambda m: m.clearance_ahead_m),
    Column("clearance_behind", "meters", "Free distance behind.", lambda m: m.clearance_behind_m),
    Column("ordered_linear", "meters_per_second", "Last ordered velocity.", lambda m: m.ordered_linear_mps),
    Column("ordered_angular", "radians_per_second", "Last ordered turn.", lambda m: m.ordered_angular_radps),
    Column("lease_errors", "", "Leases that the watchdog did not get.", lambda m: m.lease_errors, True),
)
SCANNER: Final = (
    Column("scanner_fresh", "", "Its last scan counts (1), or not (0).", lambda s: s.fresh),
    Column("scanner_age", "seconds", "Age of its last usable scan.", lambda s: s.age_s),
    Column("scanner_usable", "ratio", "Share of its beams that have a reading.", lambda s: s.usable_share),
    Column("scanner_dropped", "", "Scans that could not be used.", lambda s: s.dropped, True),
)
MUX: Final = (
    Column("mux_ready", "", "The base can move (1), or not (0).", lambda m: m.ready),
    Column("mux_unexpected_publishers", "", "Publishers of velocities that robot.yaml does not name.",
           lambda m: len(m.foreign)),
)  # fmt: skip
SOURCE: Final = (
    Column("source_active", "", "It has the base (1), or not (0).", lambda s: s.active),
    Column("source_followed", "", "Its commands are followed (1), or not (0).",
           lambda s: source_standing(s.standing) is SourceStanding.FOLLOWED),
    Column("source_age", "seconds", "Age of its last message.", lambda s: s.age_s),
    Column("source_delay", "seconds", "How much later than its fastest message the last came.", lambda s: s.delay_s),
    Column("source_received", "", "Valid messages.", lambda s: s.received, True),
    Column("source_refused", "", "Messages with NaN or infinity.", lambda s: s.refused, True),
)  # fmt: skip
LOCK: Final = (
    Column("lock_holds", "", "It blocks sources (1), or not (0).",
           lambda lock: lock.holds or lock_standing(lock.standing) is LockStanding.UNKNOWN),
)  # fmt: skip


def filter_metrics(message: Any, robot: Robot) -> Iterator[Metric]:
    """Of one SafetyState, and those of its scanners that robot.yaml names."""
    action = ACTIONS[message.action] if message.action < len(ACTIONS) else ""
    yield one_of("filter_action", "What the safety filter does with commands.", ACTIONS, action)
    causes = [cause.value for cause in StopCause]
    yield one_of("filter_cause", "Why it stops or slows the base.", causes, stop_cause(message.cause).value)
    yield from metrics(FILTER, (), [((), message)])
    known = {scan.topic for scan in robot.safety.scans}
    scanners = {scanner.topic: scanner for scanner in message.scanners if scanner.topic in known}
    yield from metrics(SCANNER, ("topic",), [((topic,), scanner) for topic, scanner in scanners.items()])


def mux_metrics(message: Any, robot: Robot) -> Iterator[Metric]:
    """Of one MuxState, and those of its sources and locks that robot.yaml names."""
    yield from metrics(MUX, (), [((), message)])
    sources = {source.name: source for source in message.sources if source.name in robot.mux.sources}
    yield from metrics(SOURCE, ("source",), [((name,), source) for name, source in sources.items()])
    locks = {lock.name: lock for lock in message.locks if lock.name in robot.mux.locks}
    yield from metrics(LOCK, ("lock",), [((name,), lock) for name, lock in locks.items()])
