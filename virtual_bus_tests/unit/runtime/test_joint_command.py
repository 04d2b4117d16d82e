"""Wheel speeds of ros2_control as a velocity of the base: what is followed, and what is refused with its reason."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_driver.drive_units import AxisUnits
from canbase_driver.motion.kinematics import Twist2D, wheel_speeds
from canbase_runtime.joint_command import BaseVelocity, Refusal, base_velocity

BENCH = load_robot(sample("bench")).robot
"""Wheels of 0.1 m, 0.5 m apart, standstill below 5 mm/s at the rim."""
_LEFT, _RIGHT = BENCH.drives
FOUR = BENCH.model_copy(
    update={
        "drives": tuple(
            drive.model_copy(update={"joint": f"{end}_{drive.side}", "node_id": number})
            for number, (end, drive) in enumerate(
                [("front", _LEFT), ("rear", _LEFT), ("front", _RIGHT), ("rear", _RIGHT)], start=1
            )
        )
    }
)
"""Two wheels on each side."""
FOUR_JOINTS = ["front_left", "rear_left", "front_right", "rear_right"]
JOINTS = ["left_wheel", "right_wheel"]


@dataclass
class Message:
    """As sensor_msgs/JointState."""

    name: Sequence[str] = field(default_factory=lambda: list(JOINTS))
    velocity: Sequence[float] = (0.0, 0.0)
    position: Sequence[float] = ()
    effort: Sequence[float] = ()


def near(linear_mps: float, angular_radps: float) -> object:
    """A base velocity but for rounding."""
    return pytest.approx((linear_mps, angular_radps), abs=1e-9)


def velocity(message: Message, robot: Robot = BENCH) -> tuple[float, float]:
    found = base_velocity(message, robot)
    assert isinstance(found, BaseVelocity), found
    return found.linear_mps, found.angular_radps


def why(message: Message, robot: Robot = BENCH) -> str:
    found = base_velocity(message, robot)
    assert isinstance(found, Refusal), found
    return found.why


def test_both_wheels_alike_drive_straight_and_a_faster_right_one_turns_left() -> None:
    assert velocity(Message(velocity=[4.0, 4.0])) == near(0.4, 0.0)
    assert velocity(Message(velocity=[2.0, 3.0])) == near(0.25, 0.2)
    assert velocity(Message(velocity=[-1.0, -1.0])) == near(-0.1, 0.0)


def test_the_order_of_the_joints_does_not_matter() -> None:
    swapped = Message(name=["right_wheel", "left_wheel"], velocity=[3.0, 2.0])
    assert base_velocity(swapped, BENCH) == base_velocity(Message(velocity=[2.0, 3.0]), BENCH)


@given(linear_mps=st.floats(-2.0, 2.0), angular_radps=st.floats(-3.0, 3.0), ratio=st.sampled_from((1.0, 0.97)))
def test_it_is_the_inverse_of_the_drivers_split(linear_mps: float, angular_radps: float, ratio: float) -> None:
    robot = BENCH.model_copy(update={"base": BENCH.base.model_copy(update={"wheel_ratio": ratio})})
    left_mps, right_mps = wheel_speeds(Twist2D(linear_mps, angular_radps), robot.base.track_m)
    radii_m = [AxisUnits(drive, robot.base).radius_m for drive in robot.drives]
    message = Message(velocity=[left_mps / radii_m[0], right_mps / radii_m[1]])
    assert velocity(message, robot) == near(linear_mps, angular_radps)


def test_zero_of_every_wheel_is_exactly_zero_and_of_one_wheel_it_is_not() -> None:
    assert base_velocity(Message(velocity=[0.0, -0.0]), BENCH) == BaseVelocity(0.0, 0.0)
    drifting = velocity(Message(FOUR_JOINTS, [0.0, 0.04, 0.0, -0.04]), FOUR)
    assert drifting == near(0.0, -0.016)  # 4 mm/s at the rims: no zero that arms a source
    opposed = velocity(Message(FOUR_JOINTS, [0.02, -0.02, 0.02, -0.02]), FOUR)
    assert opposed == near(0.002, 0.0)  # nor do speeds that cancel each other


def test_wheels_of_one_side_have_one_speed_within_what_counts_as_standstill() -> None:
    assert velocity(Message(FOUR_JOINTS, [3.0] * 4), FOUR) == near(0.3, 0.0)
    assert velocity(Message(FOUR_JOINTS, [3.0, 3.049, 3.0, 3.0]), FOUR) == near(0.30245, -0.0098)
    assert why(Message(FOUR_JOINTS, [3.0, 3.0, 3.0, 3.051]), FOUR) == (
        "the wheels on the right differ: front_right 3.000, rear_right 3.051 rad/s "
        "(base.standstill_mps allows 0.050 rad/s); a side has one speed"
    )
    assert "the wheels on the left differ" in why(Message(FOUR_JOINTS, [3.0, -3.0, 0.0, 0.0]), FOUR)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("wheel", [0, 1])
def test_a_speed_that_is_no_number_is_refused(number: float, wheel: int) -> None:
    speeds = [1.0, 1.0]
    speeds[wheel] = number
    assert f"the speed of {JOINTS[wheel]} is {number:g}" in why(Message(velocity=speeds))


def test_finite_speeds_whose_sum_is_not_finite_are_refused() -> None:
    broad = BENCH.model_copy(update={"base": BENCH.base.model_copy(update={"wheel_radius_m": 1.0})})
    assert "infinity" in why(Message(velocity=[1.7e308, 1.7e308]), broad)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (Message(["left_wheel"], [1.0]), "1 joints instead of 2; robot.yaml has drives[…].joint: left_wheel, right_"),
        (Message([*JOINTS, "gripper"], [1.0, 1.0, 0.0]), "3 joints instead of 2; robot.yaml has drives[…].joint: left"),
        (Message(["left_wheel", "wheel_right"], [1.0, 1.0]), "no drive turns the joint wheel_right; robot.yaml has"),
        (Message(["left_wheel", "left_wheel"], [1.0, 1.0]), "no speed for the joint right_wheel, another one is named"),
        (Message(JOINTS, [1.0]), "1 velocities for 2 joints"),
        (Message(JOINTS, []), "0 velocities for 2 joints"),
        (Message(JOINTS, [1.0, 1.0, 1.0]), "3 velocities for 2 joints"),
        (Message(JOINTS, [1.0, 1.0], position=[0.0, 0.0]), "it has positions or efforts, as measured joint_states do"),
        (Message(JOINTS, [1.0, 1.0], effort=[0.0, 0.0]), "it has positions or efforts, as measured joint_states do"),
        (Message([], []), "0 joints instead of 2"),
    ],
)  # fmt: skip
def test_a_message_of_another_form_is_refused_with_what_robot_yaml_has(message: Message, text: str) -> None:
    assert why(message).startswith(text)


def test_a_huge_message_and_hostile_names_give_a_short_line() -> None:
    assert len(why(Message(["x" * 1000] * 100_000, [0.0] * 100_000))) < 300
    hostile = why(Message(["a\nINFO stop released" + "x" * 1000, "\x1b[2J"], [0.0, 0.0]))
    assert "\n" not in hostile
    assert "\x1b" not in hostile
    assert len(hostile) < 300
