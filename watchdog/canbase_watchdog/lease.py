"""Leases: what the safety filter sends to the watchdog with each velocity that it orders. Layout: docs/bus.md.

A lease counts only when nothing about it is doubtful; each refusal is counted by its reason. No socket here.
"""

from __future__ import annotations

import enum
import math
import struct
import zlib
from dataclasses import dataclass

LAYOUT = struct.Struct("<4sQQddII")
"""Magic, sequence, CLOCK_MONOTONIC [ns], linear [m/s], angular [rad/s], flags, CRC-32 of all before it."""
MAGIC = b"CBL1"
BRAKES_HARD = 1 << 2
"""Flag: the base has to brake with limits.emergency_deceleration_mps2, to standstill. The other bits mean nothing."""
FUTURE_TOLERANCE_S = 0.005
"""A stamp that is so far ahead of the local clock is a lie: both processes read the same CLOCK_MONOTONIC."""

_CHECKED = LAYOUT.size - 4


class Refusal(enum.Enum):
    """Why a datagram is no lease."""

    SENDER = "sender: not the configured user, or a process in another PID namespace"
    SECOND = "second: another process, while the first one still sends"
    LENGTH = "length: not 44 bytes"
    MAGIC = "magic: does not begin with CBL1"
    CHECKSUM = "checksum: CRC-32 differs"
    VALUES = "values: a velocity that is not finite, or sequence 0"
    FUTURE = "future: stamp ahead of the local clock"
    OLD = "old: stamp older than the timeout"
    REPEATED = "repeated: sequence or stamp of the last lease"
    REORDERED = "reordered: stamp before the last lease's"


@dataclass(frozen=True, slots=True)
class Lease:
    """One lease as the filter sent it: velocities of the base in m/s and rad/s (REP 103), stamp in monotonic ns."""

    sequence: int
    stamp_ns: int
    linear_mps: float
    angular_radps: float
    flags: int

    @property
    def orders_motion(self) -> bool:
        """True when the filter orders any velocity that is not zero."""
        return self.linear_mps != 0.0 or self.angular_radps != 0.0

    @property
    def brakes_hard(self) -> bool:
        """True when the base has to brake hard."""
        return bool(self.flags & BRAKES_HARD)


def parse(datagram: bytes) -> Lease | Refusal:
    """The lease in a datagram, or why there is none in it."""
    if len(datagram) != LAYOUT.size:
        return Refusal.LENGTH
    magic, sequence, stamp_ns, linear, angular, flags, checksum = LAYOUT.unpack(datagram)
    if magic != MAGIC:
        return Refusal.MAGIC
    if zlib.crc32(datagram[:_CHECKED]) != checksum:
        return Refusal.CHECKSUM
    if sequence == 0 or not (math.isfinite(linear) and math.isfinite(angular)):
        return Refusal.VALUES
    return Lease(sequence, stamp_ns, linear, angular, flags)


def judge(lease: Lease, last: Lease | None, timeout_s: float, now_s: float) -> Refusal | None:
    """Why this lease does not count after `last` at the monotonic time `now_s` [s], or None when it does.

    Within one run of the filter both sequence and stamp rise. A sequence that falls back while the stamp goes on is a
    filter that was started again; its first datagrams may be lost, so it need not begin at 1.
    """
    stamp_s = lease.stamp_ns * 1e-9
    if stamp_s > now_s + FUTURE_TOLERANCE_S:
        return Refusal.FUTURE
    if now_s >= stamp_s + timeout_s:
        return Refusal.OLD
    if last is None:
        return None
    if lease.sequence == last.sequence or lease.stamp_ns == last.stamp_ns:
        return Refusal.REPEATED
    if lease.stamp_ns < last.stamp_ns:
        return Refusal.REORDERED
    return None


class LeaseBook:
    """Remembers the last lease that counts, and counts the others by reason."""

    def __init__(self, timeout_s: float, uid: int | None) -> None:
        """`uid`: the only user whose datagrams count; None: any."""
        self._timeout_s = timeout_s
        self._uid = uid
        self._pid: int | None = None
        self._last_lease_at = -math.inf
        self.last: Lease | None = None
        self.valid_at = -math.inf
        """Monotonic time [s] that the last lease's age counts from: its stamp or its arrival, whichever is earlier."""
        self.refused: dict[Refusal, int] = dict.fromkeys(Refusal, 0)

    def take_datagram(self, datagram: bytes, uid: int | None, now_s: float, pid: int | None = None) -> Refusal | None:
        """Judge a datagram from the user `uid` (None: unknown to the system). Returns why it does not count.

        `pid`: the process that sent it. Leases of one process count; of another one when the first has sent nothing for
        the timeout, as after a restart. 0, for all processes of another PID namespace, never counts.
        """
        refusal = self._judge(datagram, uid, now_s, pid)
        if refusal is not None:
            self.refused[refusal] += 1
        return refusal

    def _judge(self, datagram: bytes, uid: int | None, now_s: float, pid: int | None) -> Refusal | None:
        if (
            self._uid is not None and uid != self._uid
        ) or pid == 0:  # 0: cannot be told apart from others (pid_namespaces(7))
            return Refusal.SENDER
        if pid != self._pid and now_s < self._last_lease_at + self._timeout_s:
            return Refusal.SECOND
        lease = parse(datagram)
        if isinstance(lease, Refusal):
            return lease
        refusal = judge(lease, self.last, self._timeout_s, now_s)
        if refusal is None:
            self._pid, self._last_lease_at = pid, now_s
            self.last = lease
            self.valid_at = min(now_s, lease.stamp_ns * 1e-9)
        return refusal
