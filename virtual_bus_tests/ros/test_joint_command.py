"""ros2_control drives the simulated robot: wheel speeds of its topic hardware as a source of the mux, over DDS."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import pytest
from canbase.msg import MuxSource, MuxState

from support.ros_harness import Recorder
from support.running_robot import LATCHED, PATIENT, RESTS_M, RunningRobot, own_domain, robot_on
from support.topic_hardware import TopicHardware

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

TIMEOUT_S = 0.3
TOPIC = "joint_command"
SOURCES = {
    "joystick": {"topic": "cmd_vel_joy", "priority": 100, "timeout_s": 0.3},
    "control": {"topic": TOPIC, "type": "joint_command", "priority": 60, "timeout_s": TIMEOUT_S},
    "action": {"topic": "cmd_vel_action", "priority": 40, "timeout_s": 0.3, "nodes": ["drive_distance_server"]},
}
LOADED_S = 0.3
"""A loaded computer is late by less than this."""


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    changes = {**PATIENT, "mux": {"sources": SOURCES}}
    with own_domain() as domain, robot_on(domain, changes=changes) as robot:
        yield robot


@pytest.fixture
def mux(robot: RunningRobot) -> Recorder[MuxState]:
    states = robot.node.record(MuxState, "velocity_mux/state", LATCHED)
    robot.node.wait_for(lambda: states.last, 10.0, "velocity_mux/state")
    return states


@pytest.fixture
def hardware(robot: RunningRobot) -> Iterator[TopicHardware]:
    """At rest: its controller has no command, and it publishes zeros."""
    made = TopicHardware(robot.node.node, ["left_wheel", "right_wheel"], TOPIC)
    robot.node.wait_for_subscriber(made.publisher)
    yield made
    made.alive = False
    robot.node.node.destroy_publisher(made.publisher)
    robot.wait_standing()
    robot.node.spin_for(1.2)  # the mux has seen in the ROS graph that it is gone


def control(mux: Recorder[MuxState]) -> MuxSource:
    last = mux.last
    assert last is not None
    return next(source for source in last.sources if source.name == "control")


def wait_followed(robot: RunningRobot, mux: Recorder[MuxState]) -> None:
    robot.node.wait_for(lambda: control(mux).standing == MuxSource.FOLLOWED, 10.0, f"control to drive: {mux.last}")


def test_a_controller_drives_and_reads_its_wheels_and_the_base_stops_when_its_process_dies(
    robot: RunningRobot, mux: Recorder[MuxState], hardware: TopicHardware
) -> None:
    wait_followed(robot, mux)  # its zeros have armed it
    hardware.set(2.0, 3.0)
    robot.wait_speed(0.24)
    robot.node.spin_for(0.7)
    truth = robot.truth()
    assert truth.linear_mps == pytest.approx(0.25, abs=0.01)
    assert truth.angular_radps == pytest.approx(0.2, abs=0.03)
    assert hardware.states == {"left_wheel": pytest.approx(2.0, abs=0.1), "right_wheel": pytest.approx(3.0, abs=0.1)}
    assert control(mux).delay_s < 0.1  # its stamps are watched
    died_s, hardware.alive = time.monotonic(), False
    robot.wait_standing()
    braking_s = 0.3 / robot.robot.limits.deceleration_mps2
    assert robot.standstill_after(died_s).after_s < TIMEOUT_S + 2 * braking_s + LOADED_S
    robot.node.wait_for(lambda: control(mux).standing == MuxSource.SILENT, 5.0, "the mux to say so")


def test_a_controller_that_begins_with_a_speed_is_followed_after_zero(
    robot: RunningRobot, mux: Recorder[MuxState], hardware: TopicHardware
) -> None:
    hardware.set(1.0, 1.0)
    robot.node.wait_for(lambda: control(mux).standing == MuxSource.UNARMED, 10.0, f"not followed: {mux.last}")
    assert robot.moved_since(time.monotonic(), 0.5) < RESTS_M
    hardware.set(0.0, 0.0)
    wait_followed(robot, mux)
    hardware.set(1.0, 1.0)
    robot.wait_speed(0.09)


def test_a_message_without_a_wheel_or_with_nan_moves_nothing_and_is_counted_with_its_reason(
    robot: RunningRobot, mux: Recorder[MuxState], hardware: TopicHardware
) -> None:
    wait_followed(robot, mux)
    before = control(mux).refused
    hardware.commands = {"left_wheel": 1.0}
    robot.node.wait_for(lambda: "1 joints instead of 2" in control(mux).reason, 10.0, f"why: {mux.last}")
    hardware.commands = {"left_wheel": 1.0, "right_wheel": math.nan}  # a controller that has not begun yet
    robot.node.wait_for(lambda: "the speed of right_wheel is nan" in control(mux).reason, 10.0, f"why: {mux.last}")
    assert control(mux).standing == MuxSource.SILENT
    assert control(mux).refused > before
    assert robot.moved_since(time.monotonic(), 0.5) < RESTS_M
