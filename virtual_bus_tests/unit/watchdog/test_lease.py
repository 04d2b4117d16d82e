"""Which leases count: layout, freshness, order, sender. Everything doubtful is refused and counted by its reason."""

from __future__ import annotations

import math
import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_watchdog.lease import Lease, LeaseBook, Refusal, judge, parse
from support.watchdog_story import lease

# Sequence 7 at 1.5 s orders 0.25 m/s and -0.5 rad/s, flag 1.
BYTES = bytes.fromhex(
    "43 42 4c 31  07 00 00 00 00 00 00 00  00 2f 68 59 00 00 00 00"
    "00 00 00 00 00 00 d0 3f  00 00 00 00 00 00 e0 bf  01 00 00 00  b3 48 57 b8"
)


def book(timeout_s: float = 0.25, uid: int | None = None) -> LeaseBook:
    return LeaseBook(timeout_s, uid)


def test_the_bytes_of_docs_bus_are_read_field_by_field() -> None:
    assert parse(BYTES) == Lease(7, 1_500_000_000, 0.25, -0.5, 1)


@pytest.mark.parametrize("length", [0, 1, 43, 45, 256])
def test_any_other_length_is_refused(length: int) -> None:
    assert parse((BYTES + bytes(256))[:length]) is Refusal.LENGTH


@pytest.mark.parametrize("magic", [b"CBL2", b"CBL0", b"\0\0\0\0"])
def test_another_magic_is_refused(magic: bytes) -> None:
    body = magic + BYTES[4:40]
    assert parse(body + struct.pack("<I", zlib.crc32(body))) is Refusal.MAGIC


@pytest.mark.parametrize("bit", range(32, 44 * 8))
def test_one_flipped_bit_is_refused(bit: int) -> None:
    damaged = bytearray(BYTES)
    damaged[bit // 8] ^= 1 << bit % 8
    assert parse(bytes(damaged)) is Refusal.CHECKSUM


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_velocities_that_are_no_numbers_are_refused(value: float) -> None:
    assert parse(lease(1, 1.0, linear=value)) is Refusal.VALUES
    assert parse(lease(1, 1.0, angular=value)) is Refusal.VALUES


def test_sequences_begin_at_one() -> None:
    assert parse(lease(0, 1.0)) is Refusal.VALUES


@pytest.mark.parametrize(
    ("linear", "angular", "orders"),
    [
        (0.0, 0.0, False),
        (-0.0, 0.0, False),
        (1e-9, 0.0, True),
        (-1e-9, 0.0, True),
        (0.0, 1e-9, True),
        (0.0, -1e-9, True),
    ],
)
def test_any_velocity_but_zero_orders_motion(linear: float, angular: float, orders: bool) -> None:
    assert Lease(1, 1, linear, angular, 0).orders_motion is orders


# stamp:   9.749 9.750 9.751                10.004 10.006
#  |  old ------->|<----- counts --------------->|  future
# now = 10 s, timeout 0.25 s
@pytest.mark.parametrize(
    ("stamp_s", "refusal"),
    [
        (9.0, Refusal.OLD),
        (9.749, Refusal.OLD),
        (9.75, Refusal.OLD),
        (9.751, None),
        (10.0, None),
        (10.004, None),
        (10.006, Refusal.FUTURE),
        (1e9, Refusal.FUTURE),
    ],
)
def test_stamps_count_from_the_timeout_to_just_ahead_of_now(stamp_s: float, refusal: Refusal | None) -> None:
    assert judge(Lease(1, round(stamp_s * 1e9), 0.0, 0.0, 0), None, 0.25, 10.0) is refusal


def test_a_stamp_at_the_very_tolerance_counts() -> None:
    assert judge(Lease(1, 5_000_000, 0.0, 0.0, 0), None, 0.25, 0.0) is None


# The last lease has sequence 100, stamp 10.000 s. It is 10.100 s.
@pytest.mark.parametrize(
    ("sequence", "stamp_ns", "refusal"),
    [
        (101, 10_000_000_001, None),
        (150, 10_020_000_000, None),  # some were lost
        (100, 10_000_000_000, Refusal.REPEATED),
        (100, 10_020_000_000, Refusal.REPEATED),  # a counter that stands still
        (101, 10_000_000_000, Refusal.REPEATED),  # a clock that stands still
        (99, 9_980_000_000, Refusal.REORDERED),
        (101, 9_999_999_999, Refusal.REORDERED),
        (1, 9_999_999_999, Refusal.REORDERED),  # of the filter's run before
        (1, 10_000_000_001, None),  # the filter was started again
        (3, 10_050_000_000, None),  # and its first two were lost
    ],
)
def test_order(sequence: int, stamp_ns: int, refusal: Refusal | None) -> None:
    last = Lease(100, 10_000_000_000, 0.0, 0.0, 0)
    assert judge(Lease(sequence, stamp_ns, 0.0, 0.0, 0), last, 0.25, 10.1) is refusal


def test_a_replayed_series_never_counts_again() -> None:
    it = book()
    series = [lease(n, 10 + n / 50) for n in range(1, 6)]
    assert [it.take_datagram(datagram, None, 10.1) for datagram in series] == [None] * 5
    again = [it.take_datagram(datagram, None, 10.15) for datagram in series]
    assert again == [Refusal.REORDERED] * 4 + [Refusal.REPEATED]
    assert it.last == Lease(5, 10_100_000_000, 0.0, 0.0, 0)


def test_the_age_counts_from_the_stamp_when_the_datagram_was_late_and_from_arrival_when_it_is_ahead() -> None:
    it = book()
    it.take_datagram(lease(1, 10.0), None, 10.2)
    assert it.valid_at == pytest.approx(10.0)
    it.take_datagram(lease(2, 10.304), None, 10.3)
    assert it.valid_at == 10.3


def test_only_the_configured_user_counts() -> None:
    it = book(uid=1000)
    assert it.take_datagram(lease(1, 10.0), 1001, 10.0) is Refusal.SENDER
    assert it.take_datagram(lease(1, 10.0), None, 10.0) is Refusal.SENDER
    assert it.take_datagram(lease(1, 10.0), 1000, 10.0) is None
    assert it.refused[Refusal.SENDER] == 2


def test_each_refusal_is_counted_by_its_reason_and_changes_nothing_else() -> None:
    it = book()
    it.take_datagram(lease(5, 10.0), None, 10.0)
    for datagram in (b"", lease(6, 9.0), lease(6, 99.0), lease(5, 10.01), lease(4, 9.99)):
        it.take_datagram(datagram, None, 10.02)
    counted = {why for why, number in it.refused.items() if number == 1}
    assert counted == {Refusal.LENGTH, Refusal.OLD, Refusal.FUTURE, Refusal.REPEATED, Refusal.REORDERED}
    assert sum(it.refused.values()) == 5
    assert (it.last, it.valid_at) == (Lease(5, 10_000_000_000, 0.0, 0.0, 0), 10.0)


@given(st.binary(max_size=64) | st.binary(min_size=44, max_size=44).map(lambda b: b"CBL1" + b[4:]))
def test_noise_is_no_lease(datagram: bytes) -> None:
    it = book()
    assert it.take_datagram(datagram, None, 10.0) is not None
    assert it.last is None


# one filter sends ── a second one too: refused ── the first ends ── 0.25 s ── the second counts
def test_leases_of_one_process_count() -> None:
    leases = book()
    assert leases.take_datagram(lease(1, 1.0), 1000, 1.0, pid=7) is None
    assert leases.take_datagram(lease(1, 1.1, 0.5), 1000, 1.1, pid=8) is Refusal.SECOND
    assert leases.take_datagram(lease(2, 1.2), 1000, 1.2, pid=7) is None
    assert leases.take_datagram(lease(2, 1.449, 0.5), 1000, 1.449, pid=8) is Refusal.SECOND
    assert leases.last is not None
    assert leases.last.linear_mps == 0.0
    assert leases.refused[Refusal.SECOND] == 2
    assert leases.take_datagram(lease(3, 1.45, 0.5), 1000, 1.45, pid=8) is None
    assert leases.take_datagram(lease(3, 1.5), 1000, 1.5, pid=7) is Refusal.SECOND


def test_a_refused_lease_of_the_first_does_not_keep_the_second_away() -> None:
    leases = book()
    assert leases.take_datagram(lease(1, 1.0), 1000, 1.0, pid=7) is None
    assert leases.take_datagram(b"garbage", 1000, 1.2, pid=7) is Refusal.LENGTH
    assert leases.take_datagram(lease(2, 1.25), 1000, 1.25, pid=8) is None


def test_processes_of_another_pid_namespace_cannot_be_told_apart_and_do_not_count() -> None:
    """Two filters in containers: the kernel says 0 for both, and a second one would free what the first holds."""
    leases = book()
    assert leases.take_datagram(lease(5000, 1.0), 1000, 1.0, pid=0) is Refusal.SENDER
    assert leases.take_datagram(lease(1, 1.1, 0.5), 1000, 1.1, pid=0) is Refusal.SENDER
    assert leases.last is None
    assert leases.take_datagram(lease(1, 1.2), 1000, 1.2, pid=1) is None


@pytest.mark.parametrize("flags", range(16))
def test_the_third_flag_alone_orders_to_brake_hard(flags: int) -> None:
    assert Lease(7, 1_500_000_000, 0.25, -0.5, flags).brakes_hard is (flags in {4, 5, 6, 7, 12, 13, 14, 15})
