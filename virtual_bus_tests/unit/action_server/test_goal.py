"""Goals as stories in virtual time: what happens on the way, when the base stands, and what the client is told."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_action_server.along_track import BasePose
from canbase_action_server.goal import GoalPhase
from canbase_action_server.goal_request import DriveRequest
from canbase_action_server.inputs import Mux, Odometry, Safety
from canbase_action_server.motion import BaseTwist
from canbase_action_server.outcome import ErrorCode, Status
from canbase_config.stopping import standstill_s
from canbase_runtime.driver_state import DriverState
from canbase_runtime.stop_cause import StopCause
from support.action_plant import (
    GOOD_SAFETY,
    Plant,
    Story,
    bench_robot,
    drive,
    goal_run,
    good_inputs,
    replaced,
    value,
)

OBSTACLE = replace(GOOD_SAFETY, stops=True, cause=StopCause.OBSTACLE, detail="0.12 m ahead")


def safety(story: Story, state: Safety) -> None:
    story.inputs = replaced(story.inputs, story.now_s, safety=state)


def driver(story: Story, **changes: object) -> None:
    changed = replace(value(story.inputs.driver), **changes)  # type: ignore[arg-type]
    story.inputs = replaced(story.inputs, story.now_s, driver=changed)


def cancel(story: Story) -> None:
    story.inputs = replace(story.inputs, cancel_requested=True)


def lose_odometry(story: Story) -> None:
    story.odometry_alive = False


def lose_driver(story: Story) -> None:
    story.odometry_alive = False
    story.silent.add("driver")


def zero_from(story: Story, start_s: float) -> bool:
    return all(twist == BaseTwist() for at_s, twist in story.orders if at_s >= start_s)


def test_a_cancel_at_full_speed_ends_after_the_ramp_and_not_before() -> None:
    # 0.5 m/s at 1.0 m/s² need 0.5 s; then 0.1 s of standing are watched.
    story = drive(Plant(), 3.0, 0.5, at={2.0: cancel})
    end = story.run()
    assert (end.status, end.code) == (Status.CANCELED, ErrorCode.CANCELED)
    assert 2.6 <= story.ended_at <= 3.0
    assert story.coast() < 0.0002
    assert zero_from(story, 2.02)
    assert end.overshoot_m == 0.0


def test_a_cancel_before_the_first_motion_still_waits_for_what_was_ordered() -> None:
    # At 0.05 s orders are on their way, and odometry has seen nothing: that the base stands proves nothing yet.
    story = drive(Plant(dead_time_s=0.04, lag_s=0.05), 3.0, 0.5, at={0.05: cancel})
    assert story.run().code is ErrorCode.CANCELED
    assert story.ended_at >= 0.05 + 0.25
    assert story.coast() < 0.0002


def test_an_obstacle_that_stays_ends_the_goal_and_one_bad_scan_does_not() -> None:
    glitch = {2.0: lambda s: safety(s, OBSTACLE), 2.2: lambda s: safety(s, GOOD_SAFETY)}
    assert drive(Plant(), 1.0, 0.3, at=glitch).run().code is ErrorCode.OK
    story = drive(Plant(), 3.0, 0.3, at={2.0: lambda s: safety(s, OBSTACLE)})
    end = story.run()
    assert end.code is ErrorCode.BLOCKED
    assert "0.12 m ahead" in end.message
    assert zero_from(story, 2.35)


# 1 s in front of a scanner that reads nothing there, with blind_mps 0 ── away: the base must not go on by itself
@pytest.mark.parametrize(
    "cause",
    [
        StopCause.SCAN_BLIND,
        StopCause.BLIND,
        StopCause.COMMAND_STALE,
        StopCause.SHUTDOWN,
        StopCause.UNKNOWN,
    ],
)
def test_every_stop_of_the_filter_that_stays_ends_the_goal(cause: StopCause) -> None:
    held = replace(GOOD_SAFETY, stops=True, cause=cause, detail="why it stops")
    story = drive(Plant(), 3.0, 0.3, at={2.0: lambda s: safety(s, held), 3.0: lambda s: safety(s, GOOD_SAFETY)})
    end = story.run()
    assert end.code is ErrorCode.BLOCKED
    assert "why it stops" in end.message
    assert "obstacle" not in end.message
    assert zero_from(story, 2.35)


def test_odometry_lost_ends_on_the_word_of_the_driver() -> None:
    # Lost at 2.0, noticed at 2.2; the driver goes on telling that the base stands.
    at = {2.0: lose_odometry, 2.6: lambda s: driver(s, standstill=True)}
    at[1.9] = lambda s: driver(s, standstill=False)
    story = drive(Plant(), 3.0, 0.3, at=at)
    end = story.run()
    assert end.code is ErrorCode.ODOMETRY_LOST
    assert "nothing told" not in end.message
    assert 2.6 <= story.ended_at <= 2.65


def test_odometry_and_driver_lost_ends_after_the_braking_time_and_says_that_nothing_was_measured() -> None:
    story = drive(Plant(), 3.0, 0.3, at={2.0: lose_driver})
    end = story.run()
    assert end.code is ErrorCode.ODOMETRY_LOST
    assert "nothing confirms that it did" in end.message
    # 2.2 s + 0.15 s to settle + 0.3 s of braking + 0.5 s in reserve
    assert story.ended_at == pytest.approx(3.17, abs=0.05)
    assert story.coast() < 0.0002


def test_a_server_that_stood_still_does_not_drive_on_with_what_arrives_then() -> None:
    # It hangs from 1.0 s to 3.0 s. Then the newest odometry is taken in first, and looks fresh.
    robot, plant = bench_robot(), Plant()
    goal = goal_run(robot, 3.0, 0.3, plant.odometry(0.0))
    for tick in range(51):
        goal.tick(good_inputs(plant.odometry(tick * 0.02)), tick * 0.02)
    order = goal.tick(good_inputs(plant.odometry(3.0)), 3.0)
    assert order.twist == BaseTwist()
    assert goal.phase is GoalPhase.STOPPING


def test_a_fault_during_the_stop_of_a_cancel_is_the_cause() -> None:
    at = {2.0: cancel, 2.1: lambda s: driver(s, state=DriverState.LATCHED, cause="drive_fault", detail="left 2310h")}
    end = drive(Plant(), 3.0, 0.5, at=at).run()
    assert (end.status, end.code) == (Status.ABORTED, ErrorCode.DRIVE_FAULT)
    assert "left 2310h" in end.message


def test_a_base_that_does_not_stop_is_not_called_canceled() -> None:
    def runaway(story: Story) -> None:
        cancel(story)
        story.plant.deceleration_mps2 = 1e-6

    story = drive(Plant(), 3.0, 0.3, at={2.0: runaway})
    end = story.run()
    assert end.code is ErrorCode.DRIVE_FAULT
    assert "standstill is not confirmed in time: odom has 0.300 m/s, 0.000 rad/s (base.standstill_mps 0.005)" in (
        end.message
    )
    assert story.ended_at == pytest.approx(2.0 + standstill_s(bench_robot()), abs=0.05)


def test_a_base_that_is_stuck_makes_no_progress() -> None:
    story = drive(Plant(stuck=True), 1.0, 0.3)
    assert story.run().code is ErrorCode.NO_PROGRESS
    assert 2.0 < story.ended_at < 2.5


def test_a_base_that_sticks_within_the_tolerance_has_arrived() -> None:
    def stick(story: Story) -> None:
        story.plant.stuck = True

    probe = drive(Plant(), 0.3, 0.3)
    probe.run()
    story = drive(Plant(), 0.3, 0.3, at={probe.ended_at - 0.45: stick})
    end = story.run()
    assert end.code is ErrorCode.OK
    assert end.traveled_m == pytest.approx(0.3, abs=0.005)


def test_a_base_that_was_pushed_back_at_the_end_drives_on() -> None:
    def push_back(story: Story) -> None:
        story.plant.x_m -= 0.02  # heading 0.3 rad: 0.019 m along the line

    probe = drive(Plant(), 0.3, 0.3)
    probe.run()
    story = drive(Plant(), 0.3, 0.3, at={probe.ended_at - 0.1: push_back})
    end = story.run()
    assert end.code is ErrorCode.OK
    assert end.traveled_m == pytest.approx(0.3, abs=0.005)
    assert story.ended_at > probe.ended_at + 0.3


def test_odometry_that_jumps_is_not_driven_on() -> None:
    def jump(story: Story) -> None:
        story.plant.x_m -= 0.5

    end = drive(Plant(), 3.0, 0.3, at={2.0: jump}).run()
    assert end.code is ErrorCode.ODOMETRY_LOST
    assert "jumped" in end.message


@pytest.mark.parametrize("jump_m", [0.0, 0.001, 0.05, 0.0999, -0.0999])
def test_a_pose_that_is_set_anew_during_a_goal_ends_it_whatever_its_size(jump_m: float) -> None:
    def set_pose(story: Story) -> None:
        story.plant.x_m += jump_m
        driver(story, pose_resets=4)

    story = drive(Plant(yaw_rad=0.0), 0.4, 0.2, at={0.0: lambda s: driver(s, pose_resets=3), 1.0: set_pose})
    end = story.run()
    assert end.code is ErrorCode.ODOMETRY_LOST
    assert "was reset" in end.message
    assert zero_from(story, 1.02)
    assert story.ended_at < 1.7


def test_poses_that_were_set_before_the_goal_do_not_matter() -> None:
    story = drive(Plant(), 0.4, 0.2, at={0.0: lambda s: driver(s, pose_resets=2**32 - 1)})
    assert story.run().code is ErrorCode.OK


def test_a_pose_that_is_set_anew_while_the_base_comes_to_stand_is_no_success() -> None:
    story = drive(Plant(yaw_rad=0.0), 0.1, 0.2, at={})
    arrived = drive(Plant(yaw_rad=0.0), 0.1, 0.2)
    assert arrived.run().code is ErrorCode.OK

    def set_pose(story: Story) -> None:
        story.plant.x_m -= 0.05
        driver(story, pose_resets=1)

    story.at = {arrived.ended_at - 0.05: set_pose}
    assert story.run().code is ErrorCode.ODOMETRY_LOST


@pytest.mark.parametrize(("distance_m", "slip"), [(2.0, 1.2), (2.0, -1.2), (-2.0, 1.2), (-2.0, -1.2)])
def test_a_base_that_is_carried_off_its_line_ends_at_once_and_names_offset_angle_and_wheel(
    distance_m: float, slip: float
) -> None:
    # One wheel turns slower than ordered: more curvature [rad/m] than the steering may order against it (0.5).
    story = drive(Plant(yaw_rad=0.0, slip=slip), distance_m, 0.3)
    end = story.run()
    turned_rad = story.plant.yaw_rad
    assert end.code is ErrorCode.DRIVE_FAULT
    assert "beside the line and turned away by" in end.message
    assert ("left wheel" if turned_rad * distance_m > 0.0 else "right wheel") in end.message
    assert abs(turned_rad) < 0.35
    assert story.coast() < 0.0002


def test_a_base_that_ends_beside_its_line_is_no_success() -> None:
    # The last centimetre: pushed aside while it comes to stand, after the way was gone.
    def push(story: Story) -> None:
        story.plant.y_m += 0.051

    arrived = drive(Plant(yaw_rad=0.0), 0.3, 0.2)
    assert arrived.run().code is ErrorCode.OK
    story = drive(Plant(yaw_rad=0.0), 0.3, 0.2, at={arrived.ended_at - 0.08: push})
    end = story.run()
    assert end.code is ErrorCode.DRIVE_FAULT
    assert "+0.051 m beside the line" in end.message


@pytest.mark.parametrize(("lateral_m", "heading_rad", "ends"), [
    (0.0499, 0.0, False), (0.0501, 0.0, True), (-0.0499, 0.0, False), (-0.0501, 0.0, True),
    (0.0, 0.199, False), (0.0, 0.201, True), (0.0, -0.199, False), (0.0, -0.201, True),
])  # fmt: skip
def test_the_tolerances_of_the_course_are_those_of_robot_yaml(lateral_m: float, heading_rad: float, ends: bool) -> None:
    motion = DriveRequest(1.0, 0.2).motion(bench_robot(), Odometry(0.0, BasePose(0.0, 0.0, 0.0), 0.0, 0.0))
    assert motion.observe(Odometry(0.02, BasePose(0.05, lateral_m, heading_rad), 0.2, 0.0))
    assert bool(motion.strayed(0.05, 0.2)) is ends


def test_a_base_that_rolls_over_the_distance_is_not_a_success() -> None:
    def brakes_fade(story: Story) -> None:
        story.plant.deceleration_mps2 = 0.3

    end = drive(Plant(), 1.0, 0.5, at={1.5: brakes_fade}).run()
    assert end.code is ErrorCode.OVERSHOOT
    assert "rolled past the goal" in end.message
    assert end.overshoot_m > 0.005
    assert end.traveled_m == pytest.approx(1.0 + end.overshoot_m, abs=0.001)


def test_an_ended_goal_orders_nothing() -> None:
    robot, start = bench_robot(), Plant().odometry(0.0)
    goal = goal_run(robot, 1.0, 0.3, start)
    inputs = replace(good_inputs(start), shutdown=True)
    now_s, end = 0.0, None
    while end is None:
        now_s += 0.02
        inputs = replace(good_inputs(Plant().odometry(now_s)), shutdown=True)
        end = goal.tick(inputs, now_s).end
    assert (goal.phase, end.code) == (GoalPhase.ENDED, ErrorCode.SHUTDOWN)
    with pytest.raises(RuntimeError, match="has ended"):
        goal.tick(inputs, now_s)


def test_feedback_comes_at_its_rate() -> None:
    robot, plant = bench_robot(), Plant()
    goal = goal_run(robot, 1.0, 0.3, plant.odometry(0.0))
    orders = [goal.tick(good_inputs(plant.odometry(cycle * 0.02)), cycle * 0.02) for cycle in range(100)]
    assert 17 <= len([order for order in orders if order.feedback]) <= 21  # 2 s at 10 Hz


def test_a_base_that_another_source_took_over_is_not_said_to_stand() -> None:
    """The joystick takes over at 0.3 m/s and drives on: the goal ends at once, and nothing was seen standing."""

    def take_over(story: Story) -> None:
        story.inputs = replaced(story.inputs, story.now_s, mux=Mux(active="joystick"))

    story = drive(Plant(), 3.0, 0.3, at={2.0: take_over})
    end = story.run()
    assert end.code is ErrorCode.TAKEN_OVER
    assert not end.stands
    assert "belongs to another source now, and may be moving" in end.message
    assert drive(Plant(), 0.5, 0.3).run().stands
