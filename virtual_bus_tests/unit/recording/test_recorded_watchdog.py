"""The watchdog that ran, as its frames show it: lives, trips, whose frames are whose, and which leases it had."""

from __future__ import annotations

import pytest

from canbase_recording.entry import RecordedFrame
from canbase_recording.recorded_inputs import Command
from canbase_recording.recorded_leases import datagram, leases
from canbase_recording.recorded_watchdog import Trip, heard, lives, seen, tick_phase_s
from canbase_watchdog import frames
from canbase_watchdog.lease import Lease, parse
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State

STARTING, WATCHING, TRIPPED = State.STARTING, State.WATCHING, State.TRIPPED


def state(at_s: float, number: State, cause: TripCause = TripCause.NONE, age_s: float = 0.01) -> RecordedFrame:
    frame = frames.state(number, cause, 0, 1 if cause else 0, age_s, (0, 0))
    return RecordedFrame(at_s, frame.cob_id, frame.data)


def every_50_ms(from_s: float, until_s: float, number: State, cause: TripCause = TripCause.NONE) -> list[RecordedFrame]:
    count = round((until_s - from_s) / 0.05)
    return [state(from_s + k * 0.05, number, cause) for k in range(count)]


LEASE = TripCause.LEASE_LOST


def test_a_life_ends_with_its_trip_and_the_next_one_begins_with_the_reset() -> None:
    recorded = [
        *every_50_ms(100.0, 101.0, WATCHING),
        *every_50_ms(101.0, 102.0, TRIPPED, LEASE),
        *every_50_ms(102.0, 103.0, WATCHING),
    ]
    first, second = lives(seen(recorded), 99.98, 103.0)
    assert (first.from_s, first.until_s, first.trip) == (99.98, 101.0, Trip(101.0, LEASE, 1))
    assert (second.from_s, second.until_s, second.trip) == (102.0, 103.0, None)
    assert first.silent == second.silent == ()


def test_a_watchdog_that_was_tripped_all_the_time_has_no_life() -> None:
    assert lives(seen(every_50_ms(100.0, 101.0, TRIPPED, LEASE)), 99.98, 101.0) == []
    assert lives([], 99.98, 101.0) == []


def test_a_watchdog_that_starts_again_begins_a_life() -> None:
    recorded = [
        *every_50_ms(100.0, 101.0, WATCHING),
        *every_50_ms(102.0, 102.3, STARTING),
        *every_50_ms(102.3, 103.0, WATCHING),
    ]
    first, second = lives(seen(recorded), 100.0, 103.0)
    assert (first.trip, first.starts) == (None, False)
    assert (second.from_s, second.starts) == (102.0, True)


def test_where_no_state_frame_came_it_is_said() -> None:
    recorded = [*every_50_ms(100.0, 101.0, WATCHING), *every_50_ms(102.0, 103.0, WATCHING)]
    (life,) = lives(seen(recorded), 100.0, 103.0)
    ((begin_s, end_s),) = life.silent
    assert (begin_s, end_s) == pytest.approx((100.95, 102.0))


def test_a_cause_that_this_canbase_does_not_know_is_none() -> None:
    recorded = [state(100.0, WATCHING), RecordedFrame(100.05, frames.STATE, bytes([2, 99, 1, 3, 0, 0, 0, 0]))]
    (life,) = lives(seen(recorded), 100.0, 101.0)
    assert life.trip is not None
    assert (life.trip.cause, life.trip.name, life.trip.node_id) == (None, "unknown", 3)


def test_a_frame_of_another_length_is_no_state() -> None:
    assert seen([RecordedFrame(100.0, frames.STATE, b"\x01"), RecordedFrame(100.0, 0x1FF, bytes(8))]) == []


QUICK_STOP, NMT = RecordedFrame(0.0, 0x501, bytes(2)), RecordedFrame(0.0, 0x000, bytes([0x80, 1]))
SDO = RecordedFrame(0.0, 0x601, bytes(8))


@pytest.mark.parametrize("frame", [QUICK_STOP, NMT, SDO])
def test_the_stop_frames_of_the_watchdog_are_not_those_of_another_master(frame: RecordedFrame) -> None:
    trip = Trip(101.0, LEASE, 0)
    times = [100.5, 100.997, 101.2]
    kept = heard([frame._replace(at_s=at_s) for at_s in times], [trip])
    assert [each.at_s for each in kept] == [100.5]


def test_the_frame_of_another_master_that_it_trips_on_is_heard() -> None:
    foreign = QUICK_STOP._replace(at_s=100.997)
    assert list(heard([foreign], [Trip(101.0, TripCause.FOREIGN_MASTER, 1)])) == [foreign]


def test_what_the_ladder_sends_after_that_trip_is_its_own() -> None:
    assert list(heard([QUICK_STOP._replace(at_s=101.2)], [Trip(101.0, TripCause.FOREIGN_MASTER, 1)])) == []


def test_what_the_driver_sends_is_heard_always() -> None:
    own = SDO._replace(at_s=101.2, sent=True)
    assert list(heard([own], [Trip(101.0, LEASE, 0)])) == [own]


@pytest.mark.parametrize(
    "late", [[0.0003, 0.0003, 0.002, 0.0003, 0.0011], [0.0041, 0.0003, 0.0003, 0.0003, 0.0024], [0.0003] * 5]
)
def test_ticks_lie_where_the_undelayed_state_frames_left(late: list[float]) -> None:
    """Also where the first one was delayed by most of a tick."""
    recorded = [state(100.001 + k * 0.05 + late_s, WATCHING) for k, late_s in enumerate(late * 4)]
    phase_s = tick_phase_s(seen(recorded), 0.005, 0.0003)
    off_s = (phase_s - 100.001 + 0.0025) % 0.005 - 0.0025
    assert off_s == pytest.approx(0.0, abs=0.00011)
    assert tick_phase_s([], 0.005, 0.0003) == 0.0


def orders(*times: float) -> list[Command]:
    return [Command(at_s + 0.0004, at_s, 0.3, 0.1) for at_s in times]


def ages(*pairs: tuple[float, float]) -> list[RecordedFrame]:
    return [state(at_s, WATCHING, age_s=age_s) for at_s, age_s in pairs]


def test_each_command_had_its_lease() -> None:
    found = leases(orders(100.0, 100.02, 100.04), seen(ages((100.05, 0.01))))
    assert [lease.at_s for lease in found.leases] == [100.0, 100.02, 100.04]
    assert (found.unstamped, found.lost, found.unheard) == (0, 0, 0)


def test_a_lease_that_the_watchdog_did_not_have_is_taken_away() -> None:
    found = leases(orders(100.0, 100.02, 100.04), seen(ages((100.05, 0.05), (100.1, 0.1))))
    assert [lease.at_s for lease in found.leases] == [100.0]
    assert found.lost == 2


def test_a_lease_whose_command_did_not_arrive_has_the_velocity_of_the_one_before() -> None:
    found = leases(orders(100.0, 100.02), seen(ages((100.05, 0.03), (100.1, 0.02))))
    assert found.unheard == 1
    assert found.leases[-1].at_s == pytest.approx(100.08)
    assert found.leases[-1].linear_mps == 0.3


def test_a_command_of_somebody_else_has_none() -> None:
    stranger = Command(100.03, None, -0.8, 0.0)
    found = leases([*orders(100.0, 100.02), stranger], [])
    assert (len(found.leases), found.unstamped) == (2, 1)


def test_a_lease_that_is_made_here_is_one_for_the_watchdog() -> None:
    (lease,) = leases(orders(100.0), []).leases
    assert parse(datagram(7, lease)) == Lease(7, 100_000_000_000, 0.3, 0.1, 0)
