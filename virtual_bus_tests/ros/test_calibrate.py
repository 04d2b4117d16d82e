"""`canbase setup calibrate` on a whole robot whose robot.yaml is 2 % off: real processes, a simulated scanner in a
room."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from canbase_cli.goal import CANCELED
from canbase_cli.stack import Stack
from canbase_commissioning.umbmark.planar import Array, compose, pose
from canbase_config.load import load_robot
from canbase_sim.control import control_path
from support.room import BEAMS, FURNISHED, NOISE_M, ranges_m
from support.ros_harness import merged
from support.running_robot import PATIENT, READY_S, RunningRobot, own_domain, robot_on

pytestmark = pytest.mark.ros

WRONG = {
    "base": {"wheel_radius_m": 0.1, "track_m": 0.5},
    "odometry": {"travel_error_m": 0.0005, "publish_tf": False},  # the simulated floor does not slip
    "safety": {"scan": {"required": False, "x_m": 0.15}},
}
TRUE = {"base": {"wheel_radius_m": 0.101, "wheel_ratio": 0.98, "track_m": 0.49}}
"""Of the simulated drives and their base: 0.102 m on the left, 0.1 m on the right."""
IN_THE_ROOM = pose(0.0, 0.0, 0.1)
MOUNT = pose(0.15, 0.0, 0.0)
SQUARES = ("--side", "1.0", "--squares", "1", "--speed", "0.5", "--turn-speed", "1.2", "--yes")
CALIBRATE_S = 600.0
ANGLES_RAD: Array = np.linspace(-math.pi, math.pi, BEAMS, endpoint=False)


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    """Its drives turn wheels of another size than its robot.yaml has."""
    with own_domain() as domain, robot_on(domain, changes=merged(PATIENT, WRONG), start=False) as made:
        made.command("serve", "sim", "--config", str(other_file(made)))
        made.node.wait_for(control_path(made.robot).exists, READY_S, "the simulated drives")
        made.stack = Stack(made.config, sim=False, logs=made.folder, env=os.environ | made.env)
        made.stack.start()
        made.wait_whole()
        scanner(made)
        yield made
        made.stack.stop()  # before its drives


def other_file(robot: RunningRobot) -> Path:
    yaml, path = YAML(typ="safe"), robot.folder / "true.yaml"
    yaml.dump(merged(yaml.load(robot.config), TRUE), path)
    return path


def scanner(robot: RunningRobot) -> None:
    """Publishes what a scanner on the base sees of the room, 20 times a second."""
    rng = np.random.default_rng(1)
    repeater = robot.node.repeat(LaserScan, "scan", 20.0)

    def prepare(message: LaserScan) -> LaserScan:
        truth = robot.truth()
        at = compose(compose(IN_THE_ROOM, pose(truth.x_m, truth.y_m, truth.yaw_rad)), MOUNT)
        seen_m = ranges_m(FURNISHED, at, ANGLES_RAD) + NOISE_M * rng.standard_normal(BEAMS)
        return LaserScan(
            header=Header(stamp=robot.node.node.get_clock().now().to_msg(), frame_id="laser"),
            angle_min=float(ANGLES_RAD[0]),
            angle_max=float(ANGLES_RAD[-1]),
            angle_increment=math.tau / BEAMS,
            range_min=0.05,
            range_max=12.0,
            ranges=[float(each) for each in seen_m],
        )

    repeater.prepare = prepare
    repeater.message = LaserScan()


def test_ctrl_c_stops_the_base(robot: RunningRobot) -> None:
    calibrate = robot.command("setup", "calibrate", str(robot.config), *SQUARES)
    robot.wait_speed(0.2, timeout_s=READY_S)
    calibrate.interrupt()
    assert robot.exit_code(calibrate, READY_S) == CANCELED, calibrate.log()
    ended_s = time.monotonic()
    assert robot.moved_since(ended_s, 1.0) < 0.001
    assert "interrupted; the base is at standstill" in calibrate.log()
    assert load_robot(robot.config).robot == robot.robot


@pytest.mark.skipif("CANBASE_CALIBRATE" not in os.environ, reason="CANBASE_CALIBRATE=1: 80 s on a quiet computer")
def test_a_robot_yaml_that_is_2_percent_off_is_right_afterwards(robot: RunningRobot) -> None:
    calibrate = robot.command("setup", "calibrate", str(robot.config), *SQUARES, "--write")
    assert robot.exit_code(calibrate, CALIBRATE_S) == 0, calibrate.log()
    print(calibrate.log())
    base = load_robot(robot.config).robot.base
    true = load_robot(robot.folder / "true.yaml").robot.base
    for side in ("left", "right"):
        assert base.radius_m(side) == pytest.approx(true.radius_m(side), rel=0.002), calibrate.log()
    assert base.track_m == pytest.approx(true.track_m, rel=0.005), calibrate.log()
    assert "Restart canbase" in calibrate.log()


def test_with_publish_tf_false_the_transform_is_left_to_a_filter(robot: RunningRobot) -> None:
    assert robot.odom.last is not None
    publishers = robot.node.node.get_publishers_info_by_topic("tf")
    assert "motor_driver" not in [each.node_name for each in publishers]
