"""What a whole robot says on its topics, and what those that it listens on make it do. It needs its laser scanner."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from canbase.msg import DriverStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import BatteryState, JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from canbase_action_server.client import Drive, DriveResult
from canbase_action_server.goal_errors import RejectedError
from canbase_action_server.outcome import ErrorCode
from canbase_config.bus_load import cyclic_load
from support import api_page
from support.ros_harness import merged, robot_values
from support.running_robot import PATIENT, RESTS_M, own_domain, robot_on
from support.sros2_policy import allowed, present
from support.surroundings import BLOCKED_M, World, scan

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

NODES = ("velocity_mux", "safety_filter", "motor_driver", "drive_distance_server")
DRIVES = robot_values(Path())["drives"]
SUPPLY = {"name": "dc_link", "index": 0x6079, "bits": 32, "scale": 0.001, "unit": "V", "period_s": 0.1}
WATCHES_OUT = merged(
    PATIENT,
    {
        "safety": {"scan": {"required": True, "timeout_s": 1.0}},
        "drives": [DRIVES[0] | {"values": [SUPPLY]}, DRIVES[1]],
        "battery": {"full_v": 27.0, "empty_v": 22.0, "design_capacity_ah": 20.0},
    },
)


@pytest.fixture(scope="module")
def running() -> Iterator[World]:
    with own_domain() as domain, robot_on(domain, changes=WATCHES_OUT, start=False) as robot:
        robot.stack.start()
        world = World(robot)
        world.scan.message = scan()
        robot.wait_whole()
        yield world


@pytest.fixture
def world(running: World) -> World:
    running.heal()
    return running


def ended(goal: Drive) -> DriveResult:
    result = goal.wait(20.0)
    assert result is not None
    return result


def test_odom_and_joint_states_agree_with_each_other_and_with_the_truth(world: World) -> None:
    joints = world.node.record(JointState, "joint_states")
    world.node.wait_for(lambda: joints.last, 10.0, "joint_states")
    first, before_m = joints.messages[-1], world.robot.odometry()
    assert world.robot.driven(0.3)
    world.node.spin_for(0.3)
    last, odom, truth = joints.messages[-1], world.robot.odom.messages[-1], world.robot.truth()
    assert list(last.name) == ["left_wheel", "right_wheel"]
    turned_rad = [after - before for after, before in zip(last.position, first.position, strict=True)]
    assert turned_rad == pytest.approx([3.0, 3.0], abs=0.05)  # 0.3 m on wheels of 0.1 m
    assert math.dist(before_m, world.robot.odometry()) == pytest.approx(0.3, abs=0.005)
    assert odom.header.frame_id == "odom"
    assert odom.child_frame_id == "base_link"
    pose = odom.pose.pose
    assert (pose.position.x, pose.position.y) == pytest.approx((truth.x_m, truth.y_m), abs=0.01)
    assert math.hypot(pose.orientation.z, pose.orientation.w) == pytest.approx(1.0)
    assert pose.position.z == pose.orientation.x == pose.orientation.y == 0.0
    assert odom.pose.covariance[0] > 0.0
    assert odom.twist.covariance[0] > 0.0


def test_a_battery_whose_voltage_no_drive_measures_is_published_as_not_present(running: World) -> None:
    """The drives of the bench measure none."""
    batteries = running.node.record(BatteryState, "battery_state")
    running.node.wait_for(lambda: len(batteries.messages) >= 2, 10.0, "battery_state")
    battery = batteries.messages[-1]
    assert not battery.present
    assert math.isnan(battery.voltage)
    assert battery.design_capacity == 20.0


def test_named_values_of_a_drive_come_ten_times_a_second_with_their_unit(running: World) -> None:
    values = running.node.record(DiagnosticArray, "motor_driver/values")
    diagnostics = running.node.record(DiagnosticArray, "/diagnostics")
    running.node.spin_for(2.0)
    assert 15 <= len(values.messages) <= 25
    (left,) = values.messages[-1].status
    assert left.name.endswith("drive left_wheel")
    (only,) = left.values
    assert only.key == "dc_link [V]"
    assert 20.0 < float(only.value) < 30.0
    shown = {each.key for array in diagnostics.messages for status in array.status for each in status.values}
    assert "dc_link [V]" in shown


def test_tf_says_what_odom_says(running: World) -> None:
    tf2_msgs = pytest.importorskip("tf2_msgs.msg", reason="the ROS wheels have no tf2_msgs")
    recorder = running.node.record(tf2_msgs.TFMessage, "tf")
    running.node.wait_for(lambda: recorder.last, 10.0, "tf")
    transform, odom = recorder.messages[-1].transforms[0], running.robot.odom.messages[-1]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_link")
    assert transform.transform.translation.x == pytest.approx(odom.pose.pose.position.x, abs=RESTS_M)


def test_stamps_of_the_odometry_rise_and_its_pose_can_be_reset_at_a_standstill(world: World) -> None:
    assert world.robot.driven(0.05)
    client = world.node.node.create_client(Trigger, "motor_driver/reset_odometry")
    world.node.wait_for(client.service_is_ready, 10.0, "motor_driver/reset_odometry")
    future = client.call_async(Trigger.Request())
    world.node.wait_for(future.done, 10.0, "its answer")
    answer = future.result()
    assert answer is not None
    assert answer.success, answer.message
    world.node.spin_for(0.3)
    assert world.robot.odometry() == pytest.approx((0.0, 0.0), abs=1e-6)
    stamps = [(odom.header.stamp.sec, odom.header.stamp.nanosec) for odom in world.robot.odom.messages]
    assert all(before < after for before, after in itertools.pairwise(stamps))


def test_status_tells_that_all_is_well(world: World) -> None:
    """For a moment of each standstill the drives are "switched on": the stand is proven without torque."""

    def with_torque() -> DriverStatus | None:
        status = world.robot.wait_state(DriverStatus.ENABLED)
        return status if status.drives[0].state == "operation enabled" else None

    status = world.node.wait_for(with_torque, 2.0, "the torque again, after the proof of a stand")
    assert status is not None
    assert (status.cause, status.watchdog, status.watchdog_cause) == ("none", DriverStatus.WATCHDOG_OK, "none")
    assert status.standstill
    assert status.command_fresh
    assert [(drive.joint, drive.node_id, drive.state) for drive in status.drives] == [
        ("left_wheel", 1, "operation enabled"),
        ("right_wheel", 2, "operation enabled"),
    ]
    assert all(drive.stops_by_itself and drive.error_code == 0 for drive in status.drives)


def test_doctor_finds_nothing_wrong_with_a_whole_robot(world: World) -> None:
    doctor = world.robot.command("doctor", "--config", str(world.robot.config), "--seconds", "1.5")
    assert world.robot.exit_code(doctor) == 0, doctor.log()


def test_doctor_finds_a_scanner_that_stamps_nothing(world: World) -> None:
    sound, world.scan.prepare = world.scan.prepare, lambda message: message
    try:
        words = ("--symptom", "only-in-simulation", "--seconds", "1.5")
        doctor = world.robot.command("doctor", "--config", str(world.robot.config), *words)
        assert world.robot.exit_code(doctor) == 1
    finally:
        world.scan.prepare = sound
    assert "The first check that fails: stamps of the sensors" in doctor.log()


def test_diagnostics_have_an_entry_for_each_part_and_none_is_an_error(world: World) -> None:
    recorder = world.node.record(DiagnosticArray, "/diagnostics")
    parts = {
        "motor_driver",
        "bus",
        "watchdog",
        "drive left_wheel",
        "drive right_wheel",
        "velocity_mux",
        "safety_filter",
    }

    def told() -> dict[str, DiagnosticStatus]:
        return {entry.name: entry for message in recorder.messages for entry in message.status}

    def is_well() -> bool:
        return len(told()) >= len(parts) and all(entry.level != DiagnosticStatus.ERROR for entry in told().values())

    world.node.wait_for(is_well, 20.0, "/diagnostics of each part, and none an error")
    assert set(told()) == {f"bench: {part}" for part in parts}


def test_the_load_of_the_bus_is_measured_and_near_the_planned_one(world: World) -> None:
    planned = cyclic_load(world.robot.robot)
    told = world.robot.status
    world.node.wait_for(lambda: 0.5 * planned < told.messages[-1].bus_load < 1.5 * planned, 20.0, "the load")


def test_a_joystick_drives_and_its_silence_stops(world: World) -> None:
    world.joystick.message = TwistStamped()
    world.joystick.message.twist.linear.x = 0.2
    world.robot.wait_speed(0.19)
    world.node.spin_for(0.5)
    assert world.robot.truth().linear_mps == pytest.approx(0.2, abs=0.02)
    assert world.robot.odom.messages[-1].twist.twist.linear.x == pytest.approx(0.2, abs=0.02)
    assert world.mux.messages[-1].active == "joystick"
    world.joystick.message = None
    world.robot.wait_standing()


def test_a_joystick_that_sends_no_number_moves_nothing(world: World) -> None:
    began_s = time.monotonic()
    world.joystick.message = TwistStamped()
    world.joystick.message.twist.linear.x = math.nan
    refused = world.joystick_refused()
    world.node.wait_for(lambda: world.joystick_refused() > refused, 10.0, "its refusal")
    assert world.robot.moved_since(began_s, 1.0) < RESTS_M


def test_an_obstacle_ahead_stops_the_base_and_ends_the_goal(world: World) -> None:
    goal, began_s = world.drive(), time.monotonic()
    world.scan.message = scan(BLOCKED_M)
    assert ended(goal).code is ErrorCode.BLOCKED
    assert world.robot.moved_since(time.monotonic(), 0.5) < RESTS_M
    assert not world.wait_event(began_s, "safety_filter", "obstacle").latched


def test_a_silent_scanner_stops_the_base_and_ends_the_goal(world: World) -> None:
    goal = world.drive()
    world.scan.message = None
    assert ended(goal).code is ErrorCode.SCAN_LOST
    assert world.robot.moved_since(time.monotonic(), 0.5) < RESTS_M


def test_the_emergency_stop_stops_the_base_and_ends_the_goal(world: World) -> None:
    goal, began_s = world.drive(), time.monotonic()
    world.estop.message = Bool(data=True)
    assert ended(goal).code is ErrorCode.ESTOP
    assert world.robot.moved_since(time.monotonic(), 0.5) < RESTS_M
    world.wait_event(began_s, "safety_filter", "estop")
    assert rejected(world)  # pressed still

    released_s = time.monotonic()
    world.estop.message = Bool(data=False)
    assert world.robot.moved_since(released_s, 1.0) < RESTS_M  # the release alone moves nothing
    assert rejected(world)  # it is latched
    assert world.robot.run("reset") == 0
    assert world.robot.driven(0.05)


def rejected(world: World) -> bool:
    """A goal that the server does not accept."""
    with pytest.raises(RejectedError):
        world.robot.client.send(0.1, 0.2)
    return True


def test_a_trip_of_the_watchdog_stops_the_base_and_ends_the_goal(world: World) -> None:
    goal = world.drive()
    world.robot.sim.fault(1, "frozen_encoder")
    try:
        assert ended(goal).code is ErrorCode.WATCHDOG
        assert world.robot.moved_since(time.monotonic(), 0.5) < RESTS_M
        assert world.robot.wait_state(DriverStatus.LATCHED).watchdog == DriverStatus.WATCHDOG_TRIPPED
    finally:
        world.robot.sim.fault(1, "heal")


def test_the_shipped_sros2_policy_allows_each_node_all_that_it_has(running: World) -> None:
    """Under enforcement a node ends at the first endpoint that it may not make."""
    for node in NODES:
        has, may = present(running.node.node, node), allowed(node)
        assert has["publish"] | has["subscribe"], node
        assert {way: names - may[way] for way, names in has.items()} == {way: set() for way in has}, node


def test_the_page_of_the_ros_api_has_what_each_node_has(running: World) -> None:
    """Names, types, reliability and durability, of docs/ros_api.md; the graph does not show the depth."""
    for node in NODES:
        found = api_page.present(running.node.node, node)
        missing = api_page.documented(node) - found
        assert found - api_page.documented(node) == set(), node
        assert {endpoint.name for endpoint in missing} <= api_page.OPTIONAL, node
