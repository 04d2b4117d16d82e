"""The leases that the watchdog had, out of cmd_vel and of the age that its state frames report. Pure.

The filter sends each lease just before its cmd_vel. Not every cmd_vel has one (somebody else may publish there, a lease
may get lost), and not every lease has a cmd_vel (DDS may lose it). The age tells: at each state frame the watchdog's
newest lease was that old.
"""

from __future__ import annotations

import bisect
import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from canbase_recording.recorded_inputs import Command
from canbase_recording.recorded_watchdog import AGE_S, WAY_S, Seen
from canbase_watchdog.lease import LAYOUT, MAGIC

_BODY: Final = struct.Struct(LAYOUT.format.removesuffix("I"))


@dataclass(frozen=True, slots=True)
class RecordedLease:
    """At `at_s` [s] the filter ordered these velocities [m/s, rad/s]."""

    at_s: float
    linear_mps: float
    angular_radps: float


@dataclass(slots=True)
class Leases:
    """All that counted, in the order of time, and what of it is not a plain cmd_vel with its lease."""

    leases: list[RecordedLease] = field(default_factory=list)
    unstamped: int = 0
    """Messages on cmd_vel without a stamp of the filter's clock: taken as somebody else's."""
    lost: int = 0
    """Messages of the filter whose leases the watchdog did not have when it reported the age of its newest one."""
    unheard: int = 0
    """Leases that the watchdog had, without a cmd_vel: taken with the velocity of the one before."""


def leases(commands: Sequence[Command], states: Sequence[Seen]) -> Leases:
    """What the watchdog that ran had."""
    found = Leases()
    sent = [command for command in commands if command.is_finite and command.sent_s is not None]
    found.unstamped = sum(command.is_finite and command.sent_s is None for command in commands)
    kept = [RecordedLease(c.sent_s or 0.0, c.linear_mps, c.angular_radps) for c in sent]
    kept.sort(key=lambda lease: lease.at_s)
    missing = [lease for lease in kept if _is_missing(lease.at_s, states)]
    found.lost = len(missing)
    kept = [lease for lease in kept if lease not in missing]
    found.leases = _completed(kept, states, found)
    return found


def _is_missing(at_s: float, states: Sequence[Seen]) -> bool:
    """The next state frame that could know of it reports an older one."""
    at = bisect.bisect_left(states, at_s + WAY_S, key=lambda each: each.at_s)
    return at < len(states) and states[at].lease_at_s < at_s - WAY_S - AGE_S


def _completed(kept: list[RecordedLease], states: Sequence[Seen], found: Leases) -> list[RecordedLease]:
    times = [lease.at_s for lease in kept]
    more: list[RecordedLease] = []
    for each in states:
        at_s = each.lease_at_s
        if math.isinf(at_s) or not kept:
            continue
        place = bisect.bisect_right(times, at_s + WAY_S)
        near = [*times[max(0, place - 1) : place], *[lease.at_s for lease in more[-1:]]]
        if any(abs(time - at_s) <= WAY_S + AGE_S for time in near) or at_s < times[0]:
            continue
        before = kept[max(0, place - 1)]
        more.append(RecordedLease(at_s, before.linear_mps, before.angular_radps))
    found.unheard = len(more)
    return sorted([*kept, *more], key=lambda lease: lease.at_s)


def datagram(number: int, lease: RecordedLease) -> bytes:
    """As the filter sends it: docs/bus.md, "The lease". `number` from 1."""
    body = _BODY.pack(MAGIC, number, round(lease.at_s * 1e9), lease.linear_mps, lease.angular_radps, 0)
    return body + struct.pack("<I", zlib.crc32(body))
