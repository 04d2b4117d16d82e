"""Neutral start and the nodes behind a topic: the zero of one does not arm another. Times in s."""

from __future__ import annotations

import pytest

from canbase_config.mux import DEFAULT_SOURCES
from canbase_velocity.twist import ZERO
from support.neutral_story import Story

STICK = DEFAULT_SOURCES["joystick"].topic
PLANNER = DEFAULT_SOURCES["navigation"].topic


@pytest.fixture
def story() -> Story:
    return Story()


def test_the_zero_of_one_joystick_node_does_not_arm_the_stick_of_another(story: Story) -> None:
    story.release()
    assert story.followed("joystick", 0.2)
    story.mux.on_publishers(STICK, ["/joy_teleop", "/phone"])  # somebody has started a second one
    assert story.run(0.02).twist == ZERO
    for _ in range(10):  # they take turns
        story.release()
        assert not story.followed("joystick", 0.1)
    told = f"2 publishers on {STICK} (/joy_teleop, /phone): give each a topic and a key of its own"
    assert story.decide().sources[0].reason == told
    story.mux.on_publishers(STICK, ["/phone"])  # the first one has ended
    assert not story.followed("joystick", 1.0)
    assert story.decide().sources[0].reason == f"waiting for zero ({told})"
    story.release()
    assert story.followed("joystick", 0.2)


# armed ── its node ends ── a minute ── another one begins with a pushed stick: not followed
@pytest.mark.parametrize("gone_s", [0.0, 0.5, 60.0])
def test_the_zero_of_a_joystick_node_that_has_ended_does_not_arm_the_next_one(story: Story, gone_s: float) -> None:
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    story.release()
    assert story.followed("joystick", 0.2)
    story.release()
    story.sends = {}
    if gone_s:
        story.mux.on_publishers(STICK, [], [])
        story.run(gone_s)
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["2f"])  # the same name
    assert not story.followed("joystick", 1.0)
    assert story.decide().sources[0].reason == f"waiting for zero (a publisher on {STICK} has ended)"
    story.release()
    assert story.followed("joystick", 0.2)


def test_the_first_publisher_that_is_seen_disarms_nobody(story: Story) -> None:
    """The graph is looked at every 0.5 s: the zero may be there before its sender is seen."""
    story.release()
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    assert story.followed("joystick", 0.2)
    story.mux.on_publishers(STICK, ["/joy_teleop"], ["1f"])
    assert story.followed("joystick", 0.2)


def test_a_planner_whose_node_is_started_again_goes_on(story: Story) -> None:
    story.mux.on_publishers(PLANNER, ["/controller_server"], ["1f"])
    story.run(2.5)
    assert story.followed("navigation", 0.2)
    story.mux.on_publishers(PLANNER, ["/controller_server"], ["2f"])
    assert story.followed("navigation", 0.2)


def test_many_nodes_of_a_planner_share_its_topic(story: Story) -> None:
    story.mux.on_publishers(PLANNER, ["/controller_server", "/behavior_server"])
    story.run(2.5)
    assert story.followed("navigation", 0.2)


# two planners, of two robots, drive by turns ── one has ended ── silence arms the other one
@pytest.mark.parametrize("gap_s", [0.1, 3.0])
def test_the_planners_of_two_namespaces_are_not_followed_and_no_silence_arms_them(story: Story, gap_s: float) -> None:
    both = ["/controller_server", "/robot2/controller_server", ""]
    story.run(2.5)
    assert story.followed("navigation", 0.2)
    story.mux.on_publishers(PLANNER, both)
    assert not story.followed("navigation", 0.5)
    assert f"3 publishers on {PLANNER}" in story.decide().sources[1].reason
    story.sends = {}
    story.run(gap_s)
    assert not story.followed("navigation", 0.5)
    story.mux.on_publishers(PLANNER, both[:1])
    assert not story.followed("navigation", 0.5)
    story.sends = {}
    story.run(2.5)
    assert story.followed("navigation", 0.2)


@pytest.mark.parametrize("name", DEFAULT_SOURCES)
@pytest.mark.parametrize("second", ["/a", "/robot2/a"])
def test_a_second_publisher_on_each_source_of_the_sample_robot(story: Story, name: str, second: str) -> None:
    story.release(name)
    assert story.followed(name, 0.2)
    story.mux.on_publishers(DEFAULT_SOURCES[name].topic, ["/a", second])
    assert story.followed(name, 0.2) is (name != "joystick" and second == "/a")


def test_planners_of_two_namespaces_that_robot_yaml_names_are_followed() -> None:
    planner = DEFAULT_SOURCES["navigation"].model_copy(update={"nodes": ("/nav/controller_server", "/dock/server")})
    story = Story({**DEFAULT_SOURCES, "navigation": planner})
    story.mux.on_publishers(PLANNER, [*planner.nodes, "/behavior_server"])
    story.run(2.5)
    assert story.followed("navigation", 0.2)


def test_a_topic_that_is_no_source_and_no_lock_concerns_nobody(story: Story) -> None:
    story.release()
    story.mux.on_publishers("elsewhere", ["/a", "/b"])
    assert story.followed("joystick", 0.2)
