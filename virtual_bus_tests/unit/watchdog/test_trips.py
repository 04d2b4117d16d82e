"""The whole watchdog against lies that the small robot can tell, in steps of 1 ms; what it says about it on the bus.

How long the real driver and the simulated drives take is in test_lies.py.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from random import Random

import pytest

from canbase_watchdog.frames import Frame
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Answer, State, Watchdog
from support.watchdog_story import FAULT, SOD, FakeDrive, Story, lease

COUNTERS = 0x2FE


def cause(story: Story) -> TripCause:
    return story.watchdog.status.verdict.cause


def driving(*drives: FakeDrive, bits: int = 300) -> Story:
    story = Story(*drives)
    story.drive_at(bits, 1.2)
    assert cause(story) is TripCause.NONE
    return story


def counters(story: Story) -> tuple[int, ...]:
    """Refused, dropped, bus errors, trips, longest pause of the last frame."""
    return struct.unpack("<HHHBB", story.since(0.0, COUNTERS)[-1][1].data)


class Stuck(FakeDrive):
    """606Ch shows 300 for ever, or 6064h stands still; the wheel does as it is told."""

    stuck_velocity = frozen = False

    def velocity(self, axis: int) -> int:
        return 300 if self.stuck_velocity else super().velocity(axis)

    def position(self, axis: int) -> int:
        return 777 if self.frozen else super().position(axis)


def test_a_driver_that_goes_on_after_the_filter_ordered_zero() -> None:
    story = driving()
    story.ordered_mps, begin = 0.0, story.t
    story.run(0.36)
    assert cause(story) is TripCause.NONE
    story.run(0.08)
    assert cause(story) is TripCause.TARGET_OUTSIDE
    assert story.since(begin, 0x501)[0][1].data == b"\x02\x00"


def test_a_wheel_that_does_not_brake() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    left.brakes, story.speed = False, 0
    story.run(0.4)
    assert (cause(story), story.watchdog.status.verdict.node_id) == (TripCause.MOTION_OUTSIDE, 1)


@pytest.mark.parametrize(("lie", "order", "found"), [("frozen", 300, 12), ("stuck_velocity", 0, 5)])
def test_feedback_that_lies(lie: str, order: int, found: int) -> None:
    left = Stuck(1)
    story = driving(left, FakeDrive(2))
    setattr(left, lie, True)
    story.speed = order
    story.run(0.4)
    assert cause(story) == found


def test_one_drive_in_fault_and_a_driver_that_does_not_mind() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    left.words[0], fault_at = FAULT, story.t
    story.run(0.1)
    assert cause(story) is TripCause.NONE
    story.run(0.03)
    assert (cause(story), story.watchdog.status.verdict.node_id) == (TripCause.DRIVE_DOWN, 1)
    story.run(0.4)
    assert story.t < fault_at + 0.6
    assert right.speed[0] == 0


def test_after_a_fault_the_reset_does_not_wait_for_the_drive() -> None:
    left = FakeDrive(1)
    story = driving(left, FakeDrive(2))
    left.words[0] = FAULT
    story.run(1.5)
    assert story.reset(1) == Answer.DONE


# --- the bus


def test_a_bus_that_fails_for_a_moment_trips_and_keeps_the_reset_away_until_it_works() -> None:
    story = driving()
    failed_at = story.t
    story.watchdog.on_bus(failed_at, 3)
    story.run(0.095)
    assert cause(story) is TripCause.NONE
    story.run(0.015)
    assert cause(story) is TripCause.BUS_FAILED
    story.run(1.0)
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.watchdog.on_bus(math.inf, 4)
    assert story.reset(2) == Answer.DONE


def test_a_bus_that_comes_back_in_time_is_no_reason() -> None:
    story = driving()
    for _ in range(5):
        story.watchdog.on_bus(story.t, 1)
        story.run(0.09)
        story.watchdog.on_bus(math.inf, 1)
        story.run(0.05)
    assert cause(story) is TripCause.NONE


# --- other masters


def test_after_a_trip_our_own_frames_are_no_sign_of_another_master() -> None:
    """605Ah = 6 and a driver that does not obey: the ladder sends quick stops, NMT and SDOs, and hears them all."""
    story = driving(FakeDrive(1, option=6), FakeDrive(2, option=6))
    story.obedient = story.filter = False
    story.run(1.0)
    assert cause(story) is TripCause.LEASE_LOST
    assert len(story.since(0.0, 0x000)) > 2
    story.obedient = story.filter = True
    for drive in story.drives:
        drive.nmt = 0x05
    story.run(0.5)
    assert story.reset(1) == Answer.DONE
    story.drive_at(100, 0.3)
    assert cause(story) is TripCause.NONE


def test_another_master_must_be_silent_for_a_second_before_the_reset() -> None:
    story = driving()
    story.put(Frame(0x000, b"\x01\x01"))
    story.run(0.01)
    assert (cause(story), story.watchdog.status.verdict.node_id) == (TripCause.FOREIGN_MASTER, 1)
    story.run(0.9)
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.run(0.1)
    assert story.reset(2) == Answer.DONE


# --- start and restart


def test_a_watchdog_that_is_started_while_the_base_drives_lets_it() -> None:
    story = driving()
    story.watchdog = Watchdog(story.config, story.t)
    story.run(2.0)
    assert story.watchdog.status.state is State.WATCHING


def test_pauses_of_its_own_loop_that_are_allowed_make_no_trip() -> None:
    story = Story()
    for bits in (300, -300, 0, 1000, -1000, 200):
        story.word, story.speed = 0x0F, bits
        for _ in range(20):
            story.ticking = False
            story.run(0.085)
            story.ticking = True
            story.run(0.015)
    assert cause(story) is TripCause.NONE


def test_the_next_tick_is_due_when_the_first_timeout_runs_out() -> None:
    story = driving()
    story.filter = story.driver = False
    story.run(0.2)
    assert story.watchdog.next_expiry(story.t) == pytest.approx(1.2 + 0.25, abs=0.021)
    assert story.watchdog.next_expiry(1.46) == pytest.approx(1.2 + 0.3, abs=0.101)  # the driver's heartbeat


# --- counters


def test_counters_twice_a_second() -> None:
    story = driving()
    assert [at for at, _ in story.since(0.1, COUNTERS)] == pytest.approx([0.505, 1.005], abs=0.006)
    assert counters(story) == (0, 0, 0, 0, 5)


def test_what_is_counted() -> None:
    story = driving()
    story.watchdog.on_lease(b"short", 1000, story.t)
    story.watchdog.on_lease(lease(1, story.t), 1000, story.t - 1.0)
    story.watchdog.on_frame(0x201, b"short", story.t)
    story.watchdog.on_bus(math.inf, 7)
    story.ticking = False
    story.run(0.05)
    story.ticking, story.filter = True, False
    story.run(0.5)
    assert counters(story) == (2, 1, 7, 1, 55)
    story.run(0.5)
    assert counters(story) == (2, 1, 7, 1, 5)


def test_trips_are_counted_over_resets() -> None:
    story = driving()
    for number in (1, 2):
        story.filter = False
        story.run(1.5)
        story.filter = True
        story.run(0.3)
        assert story.reset(number) == Answer.DONE
        story.drive_at(300)
    assert story.watchdog.trips == 2


# --- noise


def noise(random: Random) -> Iterator[tuple[int, bytes]]:
    """Frames that a drive or a driver could send, damaged or made up."""
    cob_ids = (0x000, 0x080, 0x181, 0x201, 0x27E, 0x281, 0x301, 0x501, 0x581, 0x601, 0x701, 0x77F)
    while True:
        cob_id = random.choice(cob_ids) + random.choice((0, 0, 1)) if random.random() < 0.9 else random.randrange(0x800)
        data = random.randbytes(random.choice((0, 1, 2, 4, 6, 6, 8)))
        if random.random() < 0.3:
            data = random.choice((b"\x37\x02", b"\x0f\x00", b"\x01RST")) + data[:4]
        yield cob_id, data[:8]


@pytest.mark.parametrize("seed", range(2))
def test_noise_neither_raises_nor_fills_the_memory_nor_lets_anything_but_stops_out(seed: int) -> None:
    """20,000 frames; `make fuzz` tries a million."""
    story, random = Story(), Random(seed)
    watchdog, t = story.watchdog, 0.0
    for n, (cob_id, data) in zip(range(20_000), noise(random), strict=False):
        t += 0.0002
        watchdog.on_frame(cob_id, data, t)
        if n % 5 == 0:
            good = lease(n + 1, t, random.uniform(-9, 9), random.choice((0.0, 1e300, -1e300)))
            damaged = bytearray(good)
            damaged[random.randrange(44)] ^= random.choice((0, 1, 255))
            watchdog.on_lease(bytes(damaged), None, t)
        if n % 25 == 0:
            frames = watchdog.tick(t)
            assert all(len(frame.data) <= 8 for frame in frames)
            assert {frame.data for frame in frames if frame.cob_id in (0x501, 0x502)} <= {b"\x02\x00", b"\x00\x00"}
            assert {frame.data[0] for frame in frames if frame.cob_id == 0x000} <= {0x80, 0x81}
    assert watchdog.dropped_frames > 2_000
    assert sum(watchdog.refused_leases.values()) > 200
    assert held(watchdog) < 1000


def held(watchdog: Watchdog) -> int:
    """How many things it holds in its queues, which are all that grows with time."""
    envelope, foreign = watchdog._envelope, watchdog._observer._foreign
    peaks = [peak for way in envelope._directions for peak in (way._high, way._low)]
    for record in watchdog._observer._records.values():
        peaks += [record.feedback._forward, record.feedback._backward]
    paces = (foreign._syncs, foreign._heartbeats, foreign._disorder)
    return sum(len(peak._past) for peak in peaks) + sum(len(pace._times) for pace in paces) + len(foreign._setpoints)


def test_a_drive_that_was_off_says_nothing_bad_afterwards() -> None:
    story = Story()
    story.run(0.5)
    story.drives[0].speed[0], story.drives[0].brakes, story.drives[0].words[0] = 900, False, SOD
    story.run(1.0)  # pushed by hand
    assert cause(story) is TripCause.NONE
