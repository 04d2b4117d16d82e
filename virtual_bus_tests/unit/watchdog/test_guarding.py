"""Node guarding by the watchdog: requests in time, answers by their toggle bit, and what a trip does to both."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import pytest

from canbase_config.watchdog import LIFE_TIME_FACTOR, WatchdogConfig, guard_time_ms
from canbase_driver.cia301 import node_guarding as of_the_driver
from canbase_driver.cia301.frame import Frame as DriverFrame
from canbase_watchdog import frames
from canbase_watchdog.frames import Frame
from canbase_watchdog.guarding import GuardAnswers, GuardRequests
from canbase_watchdog.ladder import Step
from canbase_watchdog.watchdog import State, Watchdog
from support.watchdog_story import FakeDrive, Story, config

GUARDED_S = 0.06
"""A fifth of drive_heartbeat_s."""


def guarded(*nodes: int) -> WatchdogConfig:
    """Nodes 1 and 2, of which these are guarded."""
    plain = config()
    drives = tuple(replace(drive, guarded=drive.node_id in nodes) for drive in plain.drives)
    return replace(plain, drives=drives)


class GuardedDrive(FakeDrive):
    """It sends no heartbeat, and answers requests."""

    toggle = 0
    stuck = False

    def step(self, dt: float, now_s: float) -> list[Frame]:
        return [frame for frame in super().step(dt, now_s) if frame.cob_id != 0x700 + self.node_id]

    def on_frame(self, frame: Frame) -> list[Frame]:
        if not frame.remote:
            return super().on_frame(frame)
        if frame.cob_id != 0x700 + self.node_id or self.mute:
            return []
        answer = Frame(frame.cob_id, bytes([self.toggle | self.nmt]))
        self.toggle ^= 0 if self.stuck else 0x80
        return [answer]


class GuardedStory(Story):
    """Both drives are guarded."""

    def __init__(self) -> None:
        self.left, self.right = GuardedDrive(1), GuardedDrive(2)
        super().__init__(self.left, self.right)
        self.config = guarded(1, 2)
        self.watchdog = Watchdog(self.config, 0.0)


def requests(story: Story, since: float) -> list[float]:
    """When it sent them to node 1."""
    return [at for at, frame in story.since(since, 0x701) if frame.remote]


def test_requests_go_to_guarded_drives_alone_a_guard_time_apart() -> None:
    guard = GuardRequests(guarded(2), 0.0)
    sent = [(ms, frame) for ms in range(0, 200, 5) for frame in guard.tick(ms / 1000)]
    assert [ms for ms, _ in sent] == [0, 60, 120, 180]
    assert {frame for _, frame in sent} == {Frame(0x702, b"", remote=True)}
    assert guard.tick(0.5) == [Frame(0x702, b"", remote=True)]  # late: once, and none to make up for
    assert guard.tick(0.505) == []
    assert GuardRequests(guarded(), 0.0).tick(0.0) == []


# due at 8, 8.125, 8.25 … ── a request that is late by less than a period leaves the next one where it was due
def test_a_request_that_is_a_little_late_does_not_move_the_next_one() -> None:
    guard = GuardRequests(every(0.125), 8.0)
    assert sent(guard, 8.0, 8.1875, 8.25, 8.3125, 8.375) == [8.0, 8.1875, 8.25, 8.375]


# due at 8.125 ── sent at 8.25, a whole period late ── the period begins anew there
def test_after_a_whole_period_without_a_tick_the_period_begins_anew() -> None:
    guard = GuardRequests(every(0.125), 8.0)
    assert sent(guard, 8.0, 8.25, 8.3125, 8.375) == [8.0, 8.25, 8.375]
    late = GuardRequests(every(0.125), 8.0)
    assert sent(late, 8.0, 8.3125, 8.375, 8.4375) == [8.0, 8.3125, 8.4375]


def every(period_s: float) -> WatchdogConfig:
    """Node 1, guarded with this period."""
    long = replace(guarded(1), drive_heartbeat_s=5.0 * period_s)
    assert long.guard_period_s == period_s
    return long


def sent(guard: GuardRequests, *ticks: float) -> list[float]:
    """At which of these times [s] it sends."""
    return [at for at in ticks if guard.tick(at)]


def test_a_node_with_two_motors_is_requested_once() -> None:
    plain = config((1, 0), (1, 1))
    both = replace(plain, drives=tuple(replace(drive, guarded=True) for drive in plain.drives))
    assert len(GuardRequests(both, 0.0).tick(0.0)) == 1


@pytest.mark.parametrize(("heartbeat_s", "guard_ms"), [(0.05, 10), (0.3, 60), (0.33, 66), (0.299, 59), (1.0, 200)])
def test_the_node_life_time_ends_before_the_timeout_of_heartbeats(heartbeat_s: float, guard_ms: int) -> None:
    assert guard_time_ms(heartbeat_s) == guard_ms
    assert guard_ms * LIFE_TIME_FACTOR < 1000 * heartbeat_s
    assert replace(config(), drive_heartbeat_s=heartbeat_s).guard_period_s == pytest.approx(guard_ms / 1000)


ANSWERS: tuple[tuple[str, bytes, list[int | None]], ...] = (
    ("alternating", b"\x05\x85\x05\x85", [5, 5, 5, 5]),
    ("the first with the toggle bit", b"\x85\x05", [5, 5]),
    ("one is lost", b"\x05\x05\x85", [5, None, 5]),
    ("stuck", b"\x85\x85\x85", [5, None, None]),
    ("pre-operational", b"\x7f\xff\x05", [0x7F, 0x7F, 5]),
    ("restarted", b"\x05\x85\x00\x7f", [5, 5, 0, 0x7F]),
    ("restarted, the toggle bit as before", b"\x7f\x00\x7f", [0x7F, 0, 0x7F]),
    ("no state has it", b"\x05\x80\x85", [5, None, 5]),
)


def by_the_watchdog() -> Callable[[bytes], bytes | None]:
    return GuardAnswers().take_answer


def by_the_driver() -> Callable[[bytes], bytes | None]:
    answers = of_the_driver.GuardAnswers()

    def take(data: bytes) -> bytes | None:
        found = answers.take_answer(DriverFrame(0x701, data))
        return None if found is None else found.data

    return take


@pytest.mark.parametrize("taker", [by_the_watchdog, by_the_driver])
@pytest.mark.parametrize(("data", "states"), [row[1:] for row in ANSWERS], ids=[row[0] for row in ANSWERS])
def test_an_answer_counts_when_its_toggle_bit_has_changed(
    taker: Callable[[], Callable[[bytes], bytes | None]], data: Iterable[int], states: list[int | None]
) -> None:
    take = taker()
    found = [take(bytes([byte])) for byte in data]
    assert [None if each is None else each[0] for each in found] == states


def test_both_sides_send_the_same_request() -> None:
    ours, theirs = frames.guard_request(5), of_the_driver.guard_request(5)
    assert (ours.cob_id, ours.data, ours.remote) == (theirs.cob_id, theirs.data, theirs.remote) == (0x705, b"", True)


def test_guarded_drives_that_answer_are_driven_and_are_requested_all_the_time() -> None:
    story = GuardedStory()
    story.drive_at(400, 2.0)
    assert story.watchdog.status.state is State.WATCHING
    assert len(requests(story, 0.0)) == pytest.approx(2.0 / GUARDED_S, abs=2)
    assert story.watchdog.dropped_frames == 0


# 0 s its firmware hangs, its CAN controller answers on ── 0.3 s drive silent
def test_a_drive_whose_toggle_bit_is_stuck_counts_as_silent() -> None:
    story = GuardedStory()
    story.drive_at(400)
    story.left.stuck, since = True, story.t
    story.run(0.35)
    status = story.watchdog.status
    assert (status.verdict.cause.name, status.verdict.node_id) == ("DRIVE_SILENT", 1)
    assert story.since(since, 0x501)[0][0] - since == pytest.approx(0.3, abs=GUARDED_S)


def test_one_answer_that_is_lost_trips_nothing() -> None:
    story = GuardedStory()
    story.drive_at(400)
    story.left.toggle ^= 0x80  # it answered, and nobody received it
    story.run(1.0)
    assert story.watchdog.status.state is State.WATCHING


# 0 s another master requests node 1 too, as often: the drive would turn on without us ── 1 s foreign master
def test_answers_to_requests_of_another_master_trip() -> None:
    story = GuardedStory()
    story.drive_at(400)
    since = story.t
    while story.watchdog.status.state is State.WATCHING and story.t < since + 3.0:
        story.run(GUARDED_S)
        story.watchdog.on_frame(0x701, bytes([story.left.toggle | story.left.nmt]), story.t)
    verdict = story.watchdog.status.verdict
    assert (verdict.cause.name, verdict.node_id) == ("FOREIGN_MASTER", 1)
    assert "more answers to node guarding than one each 0.060 s" in verdict.detail
    assert story.t - since < 2.0


def test_its_requests_go_on_after_a_trip_and_are_withheld_with_its_heartbeat() -> None:
    story = GuardedStory()
    story.drive_at(400)
    story.left.hears_quick_stop = story.left.hears_pdo = story.left.hears_sdo = story.left.hears_nmt = False
    story.driver = story.filter = False  # the lease runs out, and node 1 obeys nothing
    assert _run_to(story, Step.DISABLE_VOLTAGE)
    reached = story.t
    story.run(0.05)
    assert requests(story, reached - GUARDED_S)
    assert _run_to(story, Step.HEARTBEAT_WITHHELD)
    withheld = story.t
    story.run(1.0)
    assert requests(story, withheld + 0.001) == []
    assert story.since(withheld + 0.001, 0x77E) == []


def _run_to(story: Story, step: Step) -> bool:
    for _ in range(2000):
        story.run(0.001)
        if story.watchdog.status.step is step:
            return True
    return False
