"""Topics of sources by their full names: no source follows the robot itself, and none shares its topic."""

from __future__ import annotations

from canbase_velocity.own_topics import wrong_topic

OUTPUTS = ("/robot1/cmd_vel", "/robot1/cmd_vel_mux", "/robot1/joint_states")


def test_topics_of_their_own_are_right_also_those_of_another_robot() -> None:
    assert wrong_topic({"joystick": "/robot1/cmd_vel_joy", "leader": "/robot2/cmd_vel"}, OUTPUTS) == ""


def test_the_output_of_this_robot_is_no_source() -> None:
    assert wrong_topic({"joystick": "/robot1/joy", "loop": "/robot1/cmd_vel"}, OUTPUTS) == (
        "mux.sources.loop: its topic is /robot1/cmd_vel here, an output of this robot; give it another topic"
    )


def test_two_names_of_one_topic_are_one_source_too_many() -> None:
    assert wrong_topic({"joystick": "/robot1/joy", "panel": "/robot1/joy"}, OUTPUTS) == (
        "mux.sources.joystick and panel both have the topic /robot1/joy here; give each its own"
    )
