"""The whole chain in virtual time: the pose over restarts, wraps and jumps, and robots with other drives."""

from __future__ import annotations

import itertools
import math

import pytest

from canbase_config.robot import Robot
from canbase_driver.causes import DriverCause
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.motion.kinematics import Twist2D
from canbase_driver.motion.odometry import Pose2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.frame import Frame as BenchFrame
from canbase_sim.world.bench import BenchParameters
from support.chain_world import FORWARD, World, bench_robot, robot_of, world_of

OVERCURRENT = 0x2310
TPDOS = range(0x181, 0x500)


@pytest.fixture
def world(kind: str) -> World:
    """At 0.3 m/s."""
    world = world_of(kind)
    world.drive()
    return world


def test_a_drive_that_was_switched_off_and_on_is_booted_again_and_waits_for_a_reset(world: World) -> None:
    world.node.power_cycle(world.now_s, off_s=0.5)
    world.run(0.7)
    before = world.snapshot
    assert not before.odometry.valid
    world.run(12.0)  # nobody saw the wheel stop: the watchdog waits until it must have rolled out
    after = world.snapshot
    assert after.state is DriverState.LATCHED
    assert after.odometry.valid
    # a guarded drive reports its NMT state on request alone, and the tripped watchdog withholds its requests
    assert after.drives[0].nmt_state is (None if world.is_guarded else NmtState.OPERATIONAL)
    assert world.powered == [False, False]
    # its encoder starts anew elsewhere: no jump of the pose, and the way that nobody could measure is reported
    assert (after.odometry.pose.x_m, after.odometry.pose.y_m, after.odometry.pose.yaw_rad) == pytest.approx(
        (before.odometry.pose.x_m, before.odometry.pose.y_m, before.odometry.pose.yaw_rad), abs=1e-3
    )
    assert after.odometry.travel_losses >= 1
    assert after.odometry.pose_covariance[0] > before.odometry.pose_covariance[0] + 0.1**2
    assert world.recovered()
    assert world.snapshot.odometry.pose.yaw_rad == pytest.approx(before.odometry.pose.yaw_rad, abs=0.01)


def test_the_pose_never_jumps_while_a_drive_is_switched_off_and_on(world: World) -> None:
    world.node.power_cycle(world.now_s, off_s=0.3)
    poses = []
    for _ in range(300):
        world.run(0.01)
        poses.append(world.snapshot)
    steps = [
        abs(b.odometry.pose.x_m - a.odometry.pose.x_m) + abs(b.odometry.pose.yaw_rad - a.odometry.pose.yaw_rad)
        for a, b in itertools.pairwise(poses)
    ]
    assert max(steps) < 0.3 * 0.01 * 1.5 + 0.01


@pytest.mark.parametrize(("waited_s", "counts"), [(0.099, True), (0.101, False)])
def test_feedback_that_waited_while_the_driver_stood_still_does_not_pass_for_fresh(
    world: World, waited_s: float, counts: bool
) -> None:
    """t   0  cycle, SYNC, answers ── the process stands still ── waited_s: it goes on and reads the answers"""
    went_on_at = world.now_s + waited_s
    core, dropped = world.core, world.core.frames_dropped
    core.tick(world.now_s)
    world.bench.on_frame(BenchFrame(0x080, b""), world.now_s)
    # those without SYNC say theirs in the next 10 ms
    answers = [each for ms in range(11) for each in world.bench.tick(world.now_s + ms / 1000) if each.cob_id in TPDOS]
    for answer in answers:
        core.on_frame(Frame(answer.cob_id, answer.data), went_on_at)
    assert core.snapshot(went_on_at).odometry.valid is counts
    assert core.frames_dropped == dropped + (0 if counts else len(answers))


@pytest.mark.parametrize(
    "robot",
    [
        robot_of((1, 0, "left"), (1, 1, "right")),
        robot_of((1, 0, "right"), (1, 1, "left")),
        robot_of((1, 0, "left"), (2, 0, "right"), (3, 0, "left"), (4, 0, "right")),
        robot_of((1, 0, "left"), (1, 1, "right"), (2, 0, "left"), (2, 1, "right")),
    ],
    ids=["two axes on a node", "the other way round", "four wheels", "four wheels on two nodes"],
)
def test_other_robots_drive_their_arc_and_stop_all_wheels_for_the_fault_of_one(robot: Robot) -> None:
    world = World(robot)
    world.drive(Twist2D(0.3, 0.5), seconds=1.0)
    truth, snapshot = world.truth, world.snapshot
    assert (truth.linear_mps, truth.angular_radps) == pytest.approx((0.3, 0.5), abs=0.01)
    assert (snapshot.odometry.pose.x_m, snapshot.odometry.pose.y_m, snapshot.odometry.pose.yaw_rad) == pytest.approx(
        (truth.x_m, truth.y_m, truth.yaw_rad), abs=1e-3
    )
    world.node.fail(0, OVERCURRENT)
    assert world.stands_after() < 0.25
    assert world.core.state is DriverState.LATCHED
    assert world.recovered()


@pytest.mark.parametrize("offset", [2**31 - 2000, -(2**31) + 2000])
def test_the_encoder_goes_round_at_32_bits_while_driving_and_nobody_sees_it(offset: int) -> None:
    world = World(parameters=BenchParameters(encoder_offset=offset))
    first = world.node.axes[0].position()
    world.drive(Twist2D(0.3 if offset > 0 else -0.3, 0.0), seconds=1.0)
    assert world.node.axes[0].position() * first < 0  # it went round
    world.command = Twist2D.ZERO
    world.run(1.0)
    assert world.snapshot.odometry.pose.x_m == pytest.approx(world.truth.x_m, abs=1e-4)
    assert world.snapshot.odometry.travel_losses == 0


def test_an_encoder_that_jumps_for_good_is_no_motion_of_the_base_and_is_reported(world: World) -> None:
    before = world.snapshot
    world.node.axes[0].encoder_offset += 1_000_000  # 7.7 m at the rim
    world.run(0.5)
    after = world.snapshot
    assert after.odometry.pose.x_m == pytest.approx(before.odometry.pose.x_m + 0.15, abs=0.02)
    assert after.odometry.pose.yaw_rad == pytest.approx(before.odometry.pose.yaw_rad, abs=0.01)
    assert after.odometry.travel_losses == 1
    assert after.odometry.valid


def test_a_counter_that_wraps_stops_the_base_at_the_second_time(world: World) -> None:
    """The pose would miss travel each 0.5 m, and no navigation would know."""
    for wraps in range(2):
        assert world.snapshot.state is DriverState.ENABLED, wraps
        world.node.axes[0].encoder_offset -= 1 << 16
        world.run(1.0)
    finding = world.snapshot.finding
    assert (world.snapshot.state, finding.cause) == (DriverState.LATCHED, DriverCause.FEEDBACK_IMPLAUSIBLE)
    assert "6064h has jumped twice" in finding.detail
    assert world.powered == [False, False]
    assert world.recovered()


def test_jumps_while_nothing_has_power_are_no_wrap() -> None:
    """0 s: latched by motor_driver/stop; the base is pushed, and its encoder jumps twice ── then it drives again."""
    world = World()
    world.drive()
    world.core.request_stop()
    world.run_until(DriverState.LATCHED, 2.0)
    for _ in range(2):
        world.node.axes[0].encoder_offset -= 1 << 16
        world.run(0.5)
    assert world.recovered()
    assert world.snapshot.state is DriverState.ENABLED


def test_the_pose_is_set_at_a_standstill_only_and_the_way_goes_on_from_there() -> None:
    world = World()
    world.drive()
    moving = world.core.set_pose(Pose2D(), world.now_s)
    assert (moving.done, moving.sentence.split(":")[0]) == (False, "refused")
    world.command = Twist2D.ZERO
    world.run(1.0)
    assert world.snapshot.odometry.pose.x_m > 0.1
    for wrong in (math.nan, math.inf, 1e300, -1e300, 1.000001e6):
        for pose in (Pose2D(wrong, 0.0, 0.0), Pose2D(0.0, wrong, 0.0), Pose2D(0.0, 0.0, wrong)):
            assert not world.core.set_pose(pose, world.now_s).done, pose
    assert world.snapshot.odometry.pose_resets == 0
    assert world.core.set_pose(Pose2D(1.0, 2.0, math.pi / 2), world.now_s).done
    fresh = world.snapshot
    assert (fresh.odometry.pose.x_m, fresh.odometry.pose.y_m, fresh.odometry.pose.yaw_rad) == (1.0, 2.0, math.pi / 2)
    assert fresh.odometry.pose_resets == 1
    assert world.core.set_pose(Pose2D(1.0, 2.0, math.pi / 2), world.now_s).done
    assert world.snapshot.odometry.pose_resets == 2  # also where nothing jumps
    world.command = FORWARD
    world.run(1.0)
    snapshot = world.snapshot
    assert snapshot.odometry.pose.x_m == pytest.approx(1.0, abs=0.01)
    assert snapshot.odometry.pose.y_m > 2.15
    assert snapshot.odometry.pose_covariance[0] > fresh.odometry.pose_covariance[0]


@pytest.mark.parametrize(("grip_mps2", "slips"), [(4.0, False), (0.5, True)])
def test_a_stop_that_is_harder_than_the_floor_permits_makes_the_pose_uncertain(grip_mps2: float, slips: bool) -> None:
    """From 0.5 m/s, by the ordinary ramp."""
    robot = bench_robot()
    settings = robot.odometry.model_copy(update={"grip_mps2": grip_mps2, "travel_error_m": 1e-5, "radius_error": 1e-5})
    world = World(robot.model_copy(update={"odometry": settings}))
    world.drive(Twist2D(0.5, 0.0), seconds=2.0)
    world.command = Twist2D.ZERO
    world.run(2.0)
    assert (world.snapshot.odometry.pose_covariance[0] > 0.03**2) is slips
    assert world.snapshot.odometry.twist_covariance[0] < 1e-5  # it has ended
