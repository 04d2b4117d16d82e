"""The whole watchdog in virtual time after a trip: what stays latched, and what a reset needs.

Everything goes in steps of 1 ms; the watchdog ticks every 5 ms. Wheels brake with 1 m/s².
"""

from __future__ import annotations

import pytest

from canbase_watchdog.frames import Frame
from canbase_watchdog.watchdog import Answer
from support.watchdog_story import FAULT, SOD, FakeDrive, Story
from support.watchdog_story_looks import driving, tripped, until_tripped

STATE = 0x1FE


def stopped() -> Story:
    """Tripped by a lost lease, standing, the filter back with zeros and the driver obedient."""
    story = driving()
    story.filter = False
    until_tripped(story)
    story.run(1.0)
    story.filter = True
    story.run(0.3)
    return story


def test_a_trip_is_latched_until_a_reset() -> None:
    story = stopped()
    story.run(2.0)
    assert tripped(story)
    assert story.reset(7) == Answer.DONE
    story.run(0.005)
    assert story.since(story.t, STATE)[0][1].data[:4].hex(" ") == "01 00 00 00"
    assert story.since(story.t, STATE)[0][1].data[6:].hex(" ") == "07 01"
    story.drive_at(200)
    assert not tripped(story)


def test_a_reset_without_a_trip_says_so() -> None:
    story = Story()
    story.run(0.5)
    assert story.reset(1) == Answer.NOT_TRIPPED


def test_no_reset_while_the_cause_stands() -> None:
    story = stopped()
    story.filter = False
    story.run(0.3)
    assert story.reset(1) == Answer.CAUSE_STANDS
    assert tripped(story)


def test_no_reset_while_a_wheel_still_turns() -> None:
    story = driving()
    story.filter = False
    until_tripped(story)
    story.filter = True
    story.run(0.1)
    assert story.reset(1) == Answer.CAUSE_STANDS


def test_no_reset_while_the_filter_or_the_driver_orders_motion() -> None:
    story = stopped()
    story.ordered_mps = 0.1
    story.run(0.1)
    assert story.reset(1) == Answer.VELOCITY_ORDERED
    story.ordered_mps = None
    story.run(0.1)
    story.obedient, story.word, story.speed, story.ordered_mps = False, 0x06, 1, 0.0
    story.run(0.1)
    assert story.reset(2) == Answer.VELOCITY_ORDERED
    story.speed = 0
    story.run(0.05)
    assert story.reset(3) == Answer.DONE


def test_copies_of_a_request_are_not_answered_again() -> None:
    story = stopped()
    assert story.reset(1) == Answer.DONE
    story.run(0.5)
    assert story.reset(1) == Answer.DONE
    story.run(0.6)
    assert story.reset(1) == Answer.NOT_TRIPPED  # too late for a copy


@pytest.mark.parametrize("data", ["", "01", "01 52 53 55", "00 52 53 54", "01 52 53 54 00"])
def test_what_is_no_request_resets_nothing(data: str) -> None:
    story = stopped()
    story.put(Frame(0x27E, bytes.fromhex(data)))
    assert tripped(story)
    assert story.watchdog.dropped_frames == 1


def test_after_the_driver_died_a_new_one_can_reset() -> None:
    story = driving()
    story.driver = False
    story.run(1.5)
    assert story.reset(1) == Answer.CAUSE_STANDS
    story.driver = True
    story.run(0.3)
    assert story.reset(2) == Answer.DONE


def test_after_a_drive_was_silent_its_heartbeat_is_enough_to_reset() -> None:
    left, right = FakeDrive(1), FakeDrive(2)
    story = driving(left, right)
    left.mute = True
    story.run(1.5)
    assert story.reset(1) == Answer.CAUSE_STANDS
    left.mute, left.words[0], left.speed[0] = False, SOD, 0
    story.run(0.5)
    assert left.nmt == 0x7F  # the driver has not started it again yet
    assert story.reset(2) == Answer.DONE


def test_a_drive_in_fault_is_stopped_when_it_stands() -> None:
    story = driving()
    story.drives[0].words[0] = FAULT
    story.filter = False
    story.run(2.0)
    assert story.watchdog.status.settled
