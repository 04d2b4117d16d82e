"""A lease that runs out stops the drives before the frames that wait are taken in. The clock is made up.

last lease ─ 0.25 s ─ runs out ─ quick stop ─ the frames that wait, 0.1 ms each ─ tick: cause and latch
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from canbase_watchdog.bus_health import BusHealth
from canbase_watchdog.frames import Frame
from canbase_watchdog.loop import TICK_S, Loop
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import Answer, State
from support.watchdog_story import Story, lease

FRAME_S, JUDGING_S = 0.0001, 0.0007
"""What taking in one frame, and a tick, last here."""
MANY = 200
NOTHING = Frame(0x7AA, b"")
QUICK_STOPS = [Frame(0x501, bytes.fromhex("02 00")), Frame(0x502, bytes.fromhex("02 00"))]


class Computer:
    """A clock that stands still while nothing is done, a bus with frames that wait, and a lease socket."""

    def __init__(self, story: Story) -> None:
        self.now_s = story.t
        self.health, self.datagrams_dropped, self.request_problem = BusHealth(), 0, ""
        self.waiting: list[tuple[Frame, float]] = []
        self.datagrams: list[bytes] = []
        self.sent: list[tuple[float, Frame]] = []
        self._tick = story.watchdog.tick
        story.watchdog.tick = self.tick  # type: ignore[method-assign]
        self.loop = Loop(story.watchdog, cast(Any, self), cast(Any, SimpleNamespace(fileno=int, receive=self.leases)))

    def monotonic(self) -> float:
        return self.now_s

    def select(self, _read: Any, _write: Any, _error: Any, timeout_s: float) -> None:
        self.now_s += timeout_s

    def fileno(self) -> int:
        return 0

    def leases(self) -> list[tuple[bytes, int, int]]:
        datagrams, self.datagrams = self.datagrams, []
        return [(datagram, 1000, 7) for datagram in datagrams]

    def receive(self, now_s: float) -> Iterator[tuple[int, bytes, float]]:
        while self.waiting:
            frame, at_s = self.waiting.pop(0)
            self.now_s += FRAME_S
            yield frame.cob_id, frame.data, min(at_s, now_s)

    def send(self, frame: Frame) -> None:
        self.sent.append((self.now_s, frame))

    def tick(self, now_s: float) -> list[Frame]:
        self.now_s += JUDGING_S
        return self._tick(now_s)

    def turn_until(self, end_s: float) -> None:
        while self.now_s < end_s:
            self.loop._turn()


@pytest.fixture
def story() -> Story:
    """It drives at 0.3 m/s, its last lease is 0.24 s old, its drives and its driver are heard."""
    story = Story()
    story.drive_at(300)
    story.filter = False
    story.run(0.24)
    return story


@pytest.fixture
def computer(story: Story, monkeypatch: pytest.MonkeyPatch) -> Computer:
    it = Computer(story)
    clock = SimpleNamespace(monotonic=it.monotonic)
    monkeypatch.setattr("canbase_watchdog.loop.time", clock)
    monkeypatch.setattr("canbase_watchdog.loop.suspended_s", lambda: 0.0)
    monkeypatch.setattr("canbase_watchdog.loop.select", SimpleNamespace(select=it.select))
    it.loop._due = it.loop._acted_at = it.now_s
    return it


def expires_at(story: Story) -> float:
    return story.watchdog._leases.valid_at + story.config.lease_timeout_s


def stops(computer: Computer) -> list[float]:
    return [at for at, frame in computer.sent if frame in QUICK_STOPS]


def just_before_it_runs_out(computer: Computer, story: Story) -> float:
    """The last tick before it; frames come after that."""
    expiry_s = expires_at(story)
    computer.turn_until(expiry_s - TICK_S)
    assert stops(computer) == []
    return expiry_s


def test_the_stop_is_sent_before_the_frames_that_wait_are_taken_in(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = math.inf
    computer.waiting = [(NOTHING, expiry_s - 0.001)] * MANY

    computer.turn_until(expiry_s + FRAME_S)

    assert [frame for _, frame in computer.sent if frame in QUICK_STOPS][:2] == QUICK_STOPS
    assert stops(computer)[1] == pytest.approx(expiry_s, abs=1e-9)
    assert story.watchdog.status.verdict.cause is TripCause.LEASE_LOST
    assert story.watchdog.trips == 1


@pytest.mark.parametrize("before_s", [FRAME_S * n + 0.00003 for n in (0, 1, 20, 150)])
def test_a_lease_that_runs_out_while_frames_are_taken_in_waits_for_one_of_them(
    computer: Computer, story: Story, before_s: float
) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = expiry_s - before_s
    computer.waiting = [(NOTHING, expiry_s - before_s)] * MANY

    computer.turn_until(expiry_s + MANY * FRAME_S)

    assert expiry_s <= stops(computer)[0] <= expiry_s + FRAME_S
    assert story.watchdog.status.state is State.TRIPPED


def test_a_bus_that_is_never_quiet_holds_no_tick_up(computer: Computer, story: Story) -> None:
    computer.waiting = [(NOTHING, computer.now_s)] * (10 * MANY)
    for _ in range(10):
        before_s = computer.now_s
        computer.loop._turn()
        assert computer.now_s - before_s <= TICK_S + JUDGING_S + 2 * FRAME_S
        assert computer.now_s - story.watchdog._ticked_at <= 2 * (TICK_S + JUDGING_S + 2 * FRAME_S)
    assert computer.waiting != []


def test_what_the_frames_that_came_before_the_stop_say_is_the_cause(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = math.inf
    computer.waiting = [(Frame(0x000, b"\x80\1"), expiry_s - 0.001), *((frame, expiry_s) for frame in QUICK_STOPS)]

    computer.turn_until(expiry_s + FRAME_S)

    assert stops(computer)[0] == pytest.approx(expiry_s, abs=1e-9)
    assert story.watchdog.status.verdict.cause is TripCause.FOREIGN_MASTER
    assert "NMT" in story.watchdog.status.verdict.detail


def test_own_stops_that_come_back_at_once_are_no_other_master(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = math.inf
    computer.waiting = [(frame, expiry_s) for frame in QUICK_STOPS]

    computer.turn_until(expiry_s + FRAME_S)

    assert story.watchdog.status.verdict.cause is TripCause.LEASE_LOST


def test_a_stop_that_was_sent_is_latched_though_the_frames_behind_it_say_that_no_wheel_moves(
    computer: Computer, story: Story
) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = math.inf
    off = bytes.fromhex("40 02") + bytes(4)
    computer.waiting = [(Frame(cob_id, off), expiry_s - 0.001) for cob_id in (0x181, 0x182)]

    computer.turn_until(expiry_s + FRAME_S)

    assert not any(axis.powered for axis in story.watchdog._view.axes)
    assert story.watchdog.status.verdict.cause is TripCause.LEASE_LOST


def test_a_stop_that_was_sent_is_latched_in_the_same_turn_though_the_driver_times_out_in_it(
    computer: Computer, story: Story
) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.loop._due = math.inf
    story.watchdog._observer._driver_at = expiry_s + 0.001 - story.config.drive_heartbeat_s
    computer.waiting = [(NOTHING, expiry_s - 0.001)] * MANY

    computer.loop._turn()

    assert stops(computer) != []
    assert story.watchdog.status.state is State.TRIPPED


def test_a_lease_that_runs_out_after_a_trip_sends_nothing_of_its_own(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    story.watchdog.on_bus(0.0, 1)
    story.watchdog.tick(computer.now_s)
    assert story.watchdog.status.verdict.cause is TripCause.BUS_FAILED
    story.watchdog._ticked_at = expiry_s - TICK_S

    assert story.watchdog.expire(expiry_s) == []


def test_a_lease_that_waits_is_taken_first_and_nothing_is_stopped(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    computer.datagrams = [lease(story.sequence + 1, expiry_s - 0.001, 0.3)]

    computer.turn_until(expiry_s + FRAME_S)

    assert stops(computer) == []
    assert story.watchdog.status.state is State.WATCHING


def test_a_lease_that_runs_out_at_rest_stops_nothing(computer: Computer, story: Story) -> None:
    expiry_s = just_before_it_runs_out(computer, story)
    off = bytes.fromhex("40 02") + bytes(4)
    for cob_id in (0x181, 0x182):
        story.watchdog.on_frame(cob_id, off, computer.now_s)

    computer.turn_until(expiry_s + TICK_S)

    assert stops(computer) == []
    assert story.watchdog.status.state is State.WATCHING


def test_a_reset_request_that_waited_is_judged_by_what_holds_now(computer: Computer, story: Story) -> None:
    """Tripped for its leases, which come again; the process is stopped for 1 s, and so are they."""
    story.run(0.1)
    assert story.watchdog.status.verdict.cause is TripCause.LEASE_LOST
    story.filter = True
    story.run(3.0)
    computer.now_s = story.t + 1.0
    computer.waiting = [(Frame(0x27E, b"\1RST"), story.t + 0.01)]

    computer.loop._turn()

    assert story.watchdog.status.reset == (1, Answer.CAUSE_STANDS)
