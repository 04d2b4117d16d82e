"""When the base counts as standing after the order to stop: samples with times on them, dense at each limit."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_action_server.along_track import BasePose
from canbase_action_server.inputs import Driver, Inputs, Odometry
from canbase_action_server.standstill import Standstill, StandstillLimits, StandstillVerdict
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import Received
from canbase_runtime.watchdog_view import WatchdogView
from support.action_plant import Plant, replaced

STILL = StandstillLimits(
    linear_mps=0.005,
    angular_radps=0.02,
    noise_mps=0.05,
    noise_radps=0.2,
    odometry_timeout_s=0.2,
    driver_timeout_s=0.3,
    deceleration_mps2=1.0,
    give_up_s=3.0,
)


def moving_at(received: float, linear_mps: float, angular_radps: float = 0.0) -> Inputs:
    odometry = replace(Plant().odometry(received), linear_mps=linear_mps, angular_radps=angular_radps)
    return Inputs(Received(odometry, received))


def test_standing_is_seen_for_a_while_after_the_order_had_time_to_act() -> None:
    # ordered 0.0 ... counts from 0.15 ... moves at 0.2 ... stands from 0.3 ... held for 0.1 s: 0.4
    watch = Standstill(STILL, began=0.0, speed_mps=0.1)
    samples = [(0.05, 0.0), (0.16, 0.0), (0.2, -0.006), (0.3, 0.005), (0.35, -0.005), (0.39, 0.0), (0.41, 0.0)]
    seen = [watch.judge(moving_at(at, speed), at) for at, speed in samples]
    assert seen == [StandstillVerdict.WAIT] * 6 + [StandstillVerdict.STANDS]


def test_turning_is_not_standing() -> None:
    watch = Standstill(STILL, began=0.0, speed_mps=0.1)
    seen = {watch.judge(moving_at(cycle * 0.05, 0.0, 0.03), cycle * 0.05) for cycle in range(60)}
    assert seen == {StandstillVerdict.WAIT}
    assert watch.judge(moving_at(3.0, 0.0, 0.03), 3.0) is StandstillVerdict.STILL_MOVES


STANDS = Driver(DriverState.ENABLED, "none", "", WatchdogView.OK, "none", standstill=True, hears_command=True)


@pytest.mark.parametrize(
    ("linear_mps", "angular_radps", "seen"),
    [(0.02, 0.0, True), (-0.02, 0.15, True), (0.051, 0.0, False), (0.0, 0.21, False)],
)
def test_a_noisy_velocity_is_no_motion_where_the_driver_reports_standstill(
    linear_mps: float, angular_radps: float, seen: bool
) -> None:
    """t   0  ordered to stop ── 0.2  the pose is still, odom shows some speed ── 0.4  status: standstill"""
    noisy, after = (moving_at(at_s, linear_mps, angular_radps) for at_s in (0.2, 0.41))
    after_a_moment = replaced(after, 0.41, driver=STANDS)

    def judged(*samples: Inputs) -> StandstillVerdict:
        watch = Standstill(STILL, began=0.0, speed_mps=0.3)
        return [watch.judge(each, each.odometry.received_at_s) for each in samples][-1]

    assert judged(after_a_moment) is StandstillVerdict.WAIT, "a pose alone shows no motion"
    assert judged(noisy, replaced(after, 0.14, driver=STANDS)) is StandstillVerdict.WAIT, (
        "of before the order could act"
    )
    assert judged(noisy, replaced(after, 0.41, driver=replace(STANDS, standstill=False))) is StandstillVerdict.WAIT
    assert judged(noisy, after) is StandstillVerdict.WAIT
    assert (judged(noisy, after_a_moment) is StandstillVerdict.STANDS) is seen


@pytest.mark.parametrize("moved", [BasePose(0.0011, 0.0, 0.0), BasePose(0.0, -0.0011, 0.0), BasePose(0.0, 0.0, 0.0041)])
def test_a_pose_that_moves_shows_motion(moved: BasePose) -> None:
    watch = Standstill(STILL, began=0.0, speed_mps=0.3)
    for at_s, pose in ((0.2, BasePose(0.0, 0.0, 0.0)), (0.41, moved)):
        odometry = Odometry(at_s, pose, 0.02, 0.0)
        assert watch.judge(replaced(Inputs(), at_s, odometry=odometry, driver=STANDS), at_s) is StandstillVerdict.WAIT


def test_an_old_word_of_the_driver_is_no_word() -> None:
    watch = Standstill(STILL, began=0.0, speed_mps=0.1)
    assert (
        watch.judge(Inputs(driver=Received(STANDS, 0.14)), 0.2) is StandstillVerdict.WAIT
    )  # received before the order could act
    assert watch.judge(Inputs(driver=Received(STANDS, 0.19)), 0.5) is StandstillVerdict.WAIT  # 0.31 s old
    assert watch.judge(Inputs(driver=Received(STANDS, 0.2)), 0.5) is StandstillVerdict.STANDS


@pytest.mark.parametrize(("speed_mps", "at_s"), [(0.3, 0.95), (-0.5, 1.15), (0.0, 0.65)])
def test_without_any_word_it_has_had_time_to_stop(speed_mps: float, at_s: float) -> None:
    """0.15 s until it shows, its braking with 2 m/s² (half of what 1 m/s² takes), and half a second."""
    for limits, braking_s in ((STILL, abs(speed_mps)), (replace(STILL, deceleration_mps2=2.0), abs(speed_mps) / 2.0)):
        watch = Standstill(limits, began=0.0, speed_mps=speed_mps)
        done_s = 0.15 + braking_s + 0.5
        assert watch.judge(Inputs(), done_s - 1e-9) is StandstillVerdict.WAIT
        assert watch.judge(Inputs(), done_s) is StandstillVerdict.NOT_MEASURED
    assert 0.15 + abs(speed_mps) + 0.5 == pytest.approx(at_s)


def test_the_word_of_the_driver_counts_from_the_moment_at_which_the_order_must_show() -> None:
    watch = Standstill(STILL, began=0.0, speed_mps=0.1)
    assert watch.judge(Inputs(driver=Received(STANDS, 0.15)), 0.2) is StandstillVerdict.STANDS


def test_odometry_counts_from_that_moment_and_must_stand_for_exactly_a_tenth_of_a_second() -> None:
    watch = Standstill(STILL, began=-0.15, speed_mps=0.1)  # counts from 0.0, and 0.1 s later is exact
    assert watch.judge(moving_at(0.0, 0.005, 0.02), 0.0) is StandstillVerdict.WAIT  # both exactly at their limit
    assert watch.judge(moving_at(0.1, -0.005, -0.02), 0.1) is StandstillVerdict.STANDS


def test_what_was_seen_before_odometry_was_silent_is_forgotten() -> None:
    watch = Standstill(STILL, began=0.0, speed_mps=0.1)
    assert watch.judge(moving_at(0.2, 0.0), 0.2) is StandstillVerdict.WAIT
    assert watch.judge(moving_at(0.2, 0.0), 0.45) is StandstillVerdict.WAIT  # 0.25 s old
    assert watch.judge(moving_at(0.46, 0.0), 0.46) is StandstillVerdict.WAIT
    assert watch.judge(moving_at(0.56, 0.0), 0.56) is StandstillVerdict.STANDS


@pytest.mark.parametrize(
    ("began_s", "first", "then_s", "then", "stands"),
    [
        pytest.param(0.0, BasePose(3.0, -2.0, 1.0), 0.41, BasePose(3.0, -2.0, 1.0), True, id="far from the origin"),
        pytest.param(0.0, BasePose(0.0, 0.0, 0.0), 0.41, BasePose(0.001, 0.0, 0.0), True, id="0.005 m/s for 0.2 s"),
        pytest.param(0.0, BasePose(0.0, 0.0, 0.0), 0.41, BasePose(0.0, 0.0, 0.004), True, id="0.02 rad/s for 0.2 s"),
        pytest.param(0.0, BasePose(0.0, 0.0, 0.0), 0.41, BasePose(0.00101, 0.0, 0.0), False, id="farther"),
        pytest.param(0.0, BasePose(0.0, 0.0, 0.0), 0.41, BasePose(0.0, 0.0, 0.00401), False, id="turned farther"),
        pytest.param(0.0, BasePose(0.0, 0.0, 3.1415), 0.41, BasePose(0.0, 0.0, -3.1415), True, id="across half a turn"),
        pytest.param(
            0.05, BasePose(0.0, 0.0, 0.0), 0.4, BasePose(0.0, 0.0, 0.0), True, id="0.2 s, from the first that counts"
        ),
        pytest.param(0.0, BasePose(0.0, 0.0, 0.0), 0.3999, BasePose(0.0, 0.0, 0.0), False, id="for less than 0.2 s"),
    ],
)
def test_a_noisy_base_stands_where_its_pose_has_not_moved_for_a_fifth_of_a_second(
    began_s: float, first: BasePose, then_s: float, then: BasePose, stands: bool
) -> None:
    """The first sample at 0.2 s; velocities exactly at the noise."""
    watch = Standstill(STILL, began=began_s, speed_mps=0.3)
    for at_s, pose in ((0.2, first), (then_s, then)):
        odometry = Odometry(at_s, pose, 0.05, -0.2)
        verdict = watch.judge(replaced(Inputs(), at_s, odometry=odometry, driver=STANDS), at_s)
    assert verdict is (StandstillVerdict.STANDS if stands else StandstillVerdict.WAIT)


@pytest.mark.parametrize(("first_s", "second_s", "stands"), [(0.19, 0.2, True), (0.18, 0.19, False)])
def test_a_pose_counts_from_the_last_sample_before_the_order_must_show(
    first_s: float, second_s: float, stands: bool
) -> None:
    """It must show at 0.2 s; what was seen before that may still have been on its way to the wheels."""
    watch = Standstill(STILL, began=0.05, speed_mps=0.3)
    for at_s in (first_s, second_s, first_s + 0.2):
        odometry = Odometry(at_s, BasePose(0.0, 0.0, 0.0), 0.05, -0.2)
        verdict = watch.judge(replaced(Inputs(), at_s, odometry=odometry, driver=STANDS), at_s)
    assert verdict is (StandstillVerdict.STANDS if stands else StandstillVerdict.WAIT)
