"""Neutral start after pauses: the base has power, and a source is held back all the same. Times in s."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_config.mux import DEFAULT_SOURCES, MuxLock, MuxSource
from canbase_velocity.mux import Mux
from canbase_velocity.twist import ZERO
from canbase_velocity.unexpected_publishers import Foreign
from support.neutral_story import FORWARD, Story

HOLD = "the pause"
STICK_LOCK = MuxLock(topic="pause", priority=101, required=False)
REQUIRED_LOCK = MuxLock(topic="pause", priority=101, required=True, timeout_s=0.5)
STRANGER = Foreign("cmd_vel_joy", "/stranger", "geometry_msgs/msg/TwistStamped", "is not named", "joystick", True)


@pytest.fixture
def story() -> Story:
    return Story()


def lock_closes(story: Story) -> None:
    story.mux.on_lock(HOLD, True, story.now_s)


def lock_is_silent(story: Story) -> None:
    """The Story says nothing for it."""


def stranger_comes(story: Story) -> None:
    story.mux.on_foreign([STRANGER])


def scans_are_missing(story: Story) -> None:
    story.mux.on_scans("no usable scan for 1.0 s: scan_stale")


def all_is_well(story: Story) -> None:
    story.mux.on_lock(HOLD, False, story.now_s)
    story.mux.on_foreign([])
    story.mux.on_scans("")


PAUSES = [
    (STICK_LOCK, lock_closes, "locked: the pause holds"),
    (REQUIRED_LOCK, lock_is_silent, "locked: the pause has published nothing"),
    (STICK_LOCK, stranger_comes, "locked: /stranger"),
    (STICK_LOCK, scans_are_missing, "no usable scan"),
]


def paused(lock: MuxLock, sources: dict[str, MuxSource] = DEFAULT_SOURCES) -> Story:
    story = Story()
    story.mux = Mux(sources, {HOLD: lock}, foreign_lock=True)
    story.mux.on_lock(HOLD, False, story.now_s)
    return story


@pytest.mark.parametrize("seconds", [0.02, 0.6, 5.0])
@pytest.mark.parametrize(("lock", "event", "reason"), PAUSES)
def test_a_stick_held_over_a_pause_is_not_followed_after_it(
    lock: MuxLock, event: Callable[[Story], None], reason: str, seconds: float
) -> None:
    if lock.required:
        seconds += lock.timeout_s
    story = paused(lock)
    story.release()
    assert story.followed("joystick", 0.2)
    event(story)
    story.run(seconds)
    all_is_well(story)
    story.ordered.clear()
    for _ in range(100):
        story.run(0.2)
        all_is_well(story)
    assert set(story.ordered) == {ZERO}
    assert story.decide().sources[0].reason.startswith(f"waiting for zero ({reason}")
    story.release()
    all_is_well(story)
    assert story.followed("joystick", 0.2)


def test_a_lock_that_opens_again_within_one_cycle_counts() -> None:
    story = paused(STICK_LOCK)
    story.release()
    assert story.followed("joystick", 0.2)
    story.mux.on_lock(HOLD, True, story.now_s)
    story.mux.on_lock(HOLD, False, story.now_s)
    assert not story.followed("joystick", 5.0)


def test_a_stick_that_is_pushed_in_a_radio_gap_across_a_lock_is_not_followed_by_its_old_zero() -> None:
    story = paused(STICK_LOCK)
    story.release()
    story.sends = {}
    story.run(0.4)
    lock_closes(story)
    story.run(0.5)
    all_is_well(story)
    assert not story.followed("joystick", 5.0)


def test_a_lock_below_a_stick_does_not_concern_it() -> None:
    story = paused(MuxLock(topic="pause", priority=99, required=False))
    story.release()
    assert story.followed("joystick", 0.2)
    lock_closes(story)
    story.run(1.0)
    all_is_well(story)
    assert story.run(0.02).twist == FORWARD


@pytest.mark.parametrize(("lock", "event", "reason"), [PAUSES[0], PAUSES[3]])
def test_navigation_goes_on_after_a_pause_unless_its_key_says_otherwise(
    lock: MuxLock, event: Callable[[Story], None], reason: str
) -> None:
    strict = {"navigation": DEFAULT_SOURCES["navigation"].model_copy(update={"neutral_after_s": None})}
    for sources, goes_on in ((DEFAULT_SOURCES, True), (strict, False)):
        story = paused(lock, sources)
        story.release("navigation")
        assert story.followed("navigation", 0.2)
        event(story)
        story.run(3.0)
        all_is_well(story)
        assert (story.run(1.0).twist == FORWARD) is goes_on


@pytest.mark.parametrize("locked", [False, True])
def test_a_lock_with_two_publishers_holds_whatever_the_last_one_said(locked: bool) -> None:
    story = paused(MuxLock(topic="pause", priority=200, required=False))
    story.mux.on_publishers("pause", ["/gate", "/panel"])
    story.mux.on_lock(HOLD, locked, story.now_s)
    story.release()
    assert not story.followed("joystick", 1.0)
    story.mux.on_publishers("pause", ["/gate"])
    story.mux.on_lock(HOLD, False, story.now_s)
    story.release()
    assert story.followed("joystick", 0.2)
