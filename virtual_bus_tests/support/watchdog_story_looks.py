"""How a story is inspected: the watchdog's state, how fast the wheels are, and how long until something happens."""

from __future__ import annotations

from canbase_watchdog.ladder import Step
from canbase_watchdog.trip_cause import TripCause
from canbase_watchdog.watchdog import State
from support.watchdog_story import FakeDrive, Story


def cause(story: Story) -> TripCause:
    return story.watchdog.status.verdict.cause


def state(story: Story) -> State:
    return story.watchdog.status.state


def step(story: Story) -> Step:
    return story.watchdog.status.step


def tripped(story: Story) -> bool:
    return state(story) is State.TRIPPED


def speeds(story: Story) -> list[float]:
    return [speed for drive in story.drives for speed in drive.speed.values()]


def until_tripped(story: Story, limit_s: float = 1.0) -> float:
    """Run until it trips; seconds that it took."""
    begin = story.t
    while not tripped(story):
        assert story.t < begin + limit_s, "it did not trip"
        story.run(0.001)
    return story.t - begin


def until_still(story: Story, limit_s: float = 2.0) -> float:
    begin = story.t
    while any(abs(speed) > 0 for speed in speeds(story)):
        assert story.t < begin + limit_s, "the wheels still turn"
        story.run(0.001)
    return story.t - begin


def driving(*drives: FakeDrive, bits: int = 300) -> Story:
    story = Story(*drives)
    story.drive_at(bits, 1.2)
    assert speeds(story) == [bits] * len(speeds(story))
    return story
