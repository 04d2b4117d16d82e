"""One axis at run time: feedback in bytes to SI, gaps and restarts, and the setpoint frame."""

from __future__ import annotations

import math

import pytest

from canbase_driver.cia301.pdo import NodeLayout, pack_setpoint
from canbase_driver.cia402 import DriveState, PowerGoal, decode_statusword, next_controlword
from canbase_driver.drives.axis import Axis
from canbase_driver.motion.limiter import Limiter
from support.chain_world import BITS_PER_MPS, bench_robot
from support.crews import robot_with

ENABLED, READY, UNKNOWN = 0x0637, 0x0631, 0x0000
COUNTS_PER_M = 4096 * 20 / (2.0 * math.pi * 0.1)


def axis(number: int = 0) -> Axis:
    """The left axis of the sample robot, or (1) the right one, mounted mirrored. 100 cycles a second."""
    robot = bench_robot()
    return Axis(robot.drives[number], NodeLayout(number + 1, (0,)), robot)


def status(word: int, counts: int) -> bytes:
    return word.to_bytes(2, "little") + counts.to_bytes(4, "little", signed=True)


def velocity(raw: int) -> bytes:
    return raw.to_bytes(4, "little", signed=True)


def test_before_anything_was_heard() -> None:
    left = axis()
    assert (left.state, left.statusword, left.velocity_mps, left.position_rad) == (None, 0, 0.0, 0.0)
    assert left.age_s(10.0) == math.inf
    assert not left.has_new_sample


@pytest.mark.parametrize(("number", "sign"), [(0, 1), (1, -1)])
def test_feedback_in_si_forward_positive(number: int, sign: int) -> None:
    wheel = axis(number)
    assert wheel.on_status(status(ENABLED, 1000), 10.0)
    assert wheel.on_status(status(ENABLED, 1000 + sign * round(0.003 * COUNTS_PER_M)), 10.01)
    assert wheel.on_velocity(velocity(sign * round(0.3 * BITS_PER_MPS)), 10.01)
    assert wheel.state is DriveState.OPERATION_ENABLED
    assert wheel.velocity_mps == pytest.approx(0.3, abs=1e-4)
    assert wheel.travel.travel_m == pytest.approx(0.003, abs=1e-5)
    assert wheel.position_rad == pytest.approx(0.03, abs=1e-4)
    assert wheel.age_s(10.05) == pytest.approx(0.04)


@pytest.mark.parametrize("length", [0, 1, 5, 7, 8])
def test_a_status_of_wrong_length_is_refused_and_changes_nothing(length: int) -> None:
    left = axis()
    left.on_status(status(ENABLED, 5), 10.0)
    left.on_velocity(velocity(0), 10.0)
    assert not left.on_status(bytes(length), 10.1)
    assert left.statusword == ENABLED
    assert left.age_s(10.1) == pytest.approx(0.1)


@pytest.mark.parametrize("length", [0, 3, 5, 8])
def test_a_velocity_of_wrong_length_is_refused_and_is_no_sample(length: int) -> None:
    left = axis()
    left.on_status(status(ENABLED, 5), 10.0)
    assert not left.on_velocity(bytes(length), 10.0)
    assert not left.has_new_sample


def test_a_sample_is_new_when_both_frames_of_a_sync_have_come_and_until_it_is_taken() -> None:
    left = axis()
    left.on_velocity(velocity(0), 10.0)
    assert not left.has_new_sample
    left.on_status(status(READY, 0), 10.0)
    left.on_velocity(velocity(0), 10.0)
    assert left.has_new_sample
    left.sample_taken()
    left.on_velocity(velocity(0), 10.0)
    assert not left.has_new_sample


def test_a_sample_from_before_a_silence_is_not_fresh() -> None:
    left = axis()
    assert not left.has_fresh_sample(10.0)
    left.on_status(status(READY, 0), 10.0)
    left.on_velocity(velocity(0), 10.0)
    feedback_s = bench_robot().timeouts.feedback_s
    assert left.has_fresh_sample(10.0 + 0.999 * feedback_s)
    assert not left.has_fresh_sample(10.0 + 1.001 * feedback_s)
    left.on_velocity(velocity(0), 11.0)  # its status got lost
    assert not left.has_fresh_sample(11.0)


def drives(wheel: Axis, way_m: float, speed_mps: float, now_s: float) -> None:
    wheel.on_status(status(ENABLED, round(way_m * COUNTS_PER_M)), now_s)
    wheel.on_velocity(velocity(round(speed_mps * BITS_PER_MPS)), now_s)


def test_an_enabled_wheel_that_loses_its_speed_at_once_stands_and_is_not_proven_to() -> None:
    """0.2 m/s until 10.2 s. Then it met something hard, or its encoder died. Without fresh values nothing stands."""
    left = axis()
    for n in range(21):
        drives(left, 0.002 * n, 0.2, 10.0 + 0.01 * n)
    assert not left.stands(10.2)
    for n in range(21, 60):
        drives(left, 0.04, 0.0, 10.0 + 0.01 * n)
    assert left.stands(10.59)
    assert not left.is_proven_to_stand(10.59)
    slow = axis()
    for n in range(60):
        drives(slow, 0.0, 0.0, 10.0 + 0.01 * n)
    assert slow.is_proven_to_stand(10.59)
    assert not slow.is_proven_to_stand(10.59 + 1.001 * bench_robot().timeouts.feedback_s)


@pytest.mark.parametrize(("torque_permille", "stalls"), [(799, False), (800, True), (-1000, True)])
def test_a_wheel_that_stalls_is_no_longer_believed_to_stand(torque_permille: int, stalls: bool) -> None:
    """0.3 m/s are ordered from 10 s on; the wheel does not move. health.stall_time_s is 0.22 s."""
    left = axis()
    left.target_mps = 0.3
    for n in range(24):
        left.on_status(status(ENABLED, 0), 10.0 + 0.01 * n)
        left.on_velocity(velocity(0) + torque_permille.to_bytes(2, "little", signed=True), 10.0 + 0.01 * n)
        assert not (left.stall.is_over and n < 22)
    assert left.stall.is_over is stalls
    assert left.stillness.doubt.startswith("stalls: ") is stalls


def test_a_gap_in_the_feedback_is_measured_in_time_so_nothing_of_the_way_is_lost() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    left.on_status(status(ENABLED, round(0.4 * COUNTS_PER_M)), 11.0)  # one frame later, but one second
    assert left.travel.travel_m == pytest.approx(0.4, abs=1e-4)
    assert (left.travel.referenced, left.losses) == (True, 0)


def test_the_same_way_within_one_cycle_is_a_jump() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    left.on_status(status(ENABLED, round(0.4 * COUNTS_PER_M)), 10.01)
    assert left.travel.travel_m == 0.0
    assert not left.travel.referenced


def test_a_gap_of_days_makes_no_step_possible_that_could_be_a_wrap() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    left.on_status(status(ENABLED, -(2**31)), 1e6)
    assert not left.travel.referenced


def test_after_a_restart_what_was_heard_no_longer_counts_and_the_travel_goes_on() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    left.on_status(status(ENABLED, 1000), 10.01)
    left.on_velocity(velocity(500), 10.01)
    way_m = left.travel.travel_m
    left.forget()
    assert (left.state, left.velocity_mps, left.age_s(10.02), left.has_new_sample) == (None, 0.0, math.inf, False)
    left.on_status(status(READY, 999_999), 10.5)
    assert left.travel.travel_m == way_m
    assert left.losses == 1


def test_to_forget_what_was_never_heard_loses_nothing() -> None:
    left = axis()
    left.forget()
    left.forget()
    assert left.losses == 0


@pytest.mark.parametrize(
    ("word", "goal", "controlword", "target"),
    [
        (ENABLED, PowerGoal.ON, 0x0F, 0.3),
        (READY, PowerGoal.ON, 0x07, 0.3),
        (ENABLED, PowerGoal.QUICK_STOP, 0x02, 0.0),
        (ENABLED, PowerGoal.OFF, 0x00, 0.0),
        (ENABLED, PowerGoal.RESET, 0x00, 0.0),
    ],
)
@pytest.mark.parametrize(("number", "sign"), [(0, 1), (1, -1)])
def test_the_setpoint_is_one_step_to_the_goal_and_has_a_target_only_on_the_way_on(
    word: int, goal: PowerGoal, controlword: int, target: float, number: int, sign: int
) -> None:
    wheel = axis(number)
    wheel.on_status(status(word, 0), 10.0)
    frame = wheel.setpoint(goal, 0.3, next_controlword(wheel.state, goal))
    assert frame.cob_id == 0x201 + number
    assert frame.data == pack_setpoint(controlword, sign * round(target * BITS_PER_MPS))
    assert wheel.target_mps == target


def test_each_value_has_its_own_age_and_the_oldest_is_that_of_the_axis() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    assert left.age_s(10.0) == math.inf  # no velocity yet
    left.on_velocity(velocity(100), 10.0)
    left.on_status(status(ENABLED, 5), 10.2)
    assert left.age_s(10.2) == pytest.approx(0.2)
    left.on_velocity(velocity(100), 10.2)
    left.on_velocity(velocity(100), 10.5)
    assert left.age_s(10.5) == pytest.approx(0.3)


def test_a_speed_of_less_than_half_a_bit_is_no_order() -> None:
    left, bit_mps = axis(), 1.0 / BITS_PER_MPS
    assert left.rests(0.49 * bit_mps)
    assert not left.rests(0.51 * bit_mps)
    left.setpoint(PowerGoal.ON, 0.49 * bit_mps, 0x0F)
    assert left.target_mps == 0.0
    assert left.rests(-0.49 * bit_mps)
    left.setpoint(PowerGoal.ON, 0.51 * bit_mps, 0x0F)
    assert left.target_mps == 0.51 * bit_mps
    assert not left.rests(0.0)


def test_the_left_and_the_right_axis() -> None:
    assert [axis(number).is_left for number in (0, 1)] == [True, False]


def test_torque_is_assumed_until_a_statusword_denies_it() -> None:
    left = axis()
    assert left.has_torque
    left.on_status(status(READY, 0), 10.0)
    assert not left.has_torque
    left.on_status(status(ENABLED, 0), 10.01)
    assert left.has_torque
    left.on_status(status(READY, 0), 10.02)
    left.forget()
    assert left.has_torque
    left.on_status(status(0x006E, 0), 10.03)  # a state that CiA 402 does not have
    assert left.state is None
    assert left.has_torque


FASTEST_MPS = Limiter(bench_robot().limits, bench_robot().base.track_m).wheel_mps


@pytest.mark.parametrize(
    ("cycles", "gap_s"), [(1, 0.001), (1, 0.01), (2, 0.02), (100, 1.0), (6000, 60.0), (6000, 90.0)]
)
def test_an_encoder_may_step_three_times_as_far_as_the_fastest_wheel_gets(cycles: int, gap_s: float) -> None:
    """Of a gap of more than a minute, a minute counts."""
    most_m = 3.0 * FASTEST_MPS * 0.01 * cycles
    for step_m, taken in ((0.99 * most_m, True), (1.01 * most_m, False)):
        left = axis()
        left.on_status(status(ENABLED, 0), 10.0)
        left.on_status(status(ENABLED, round(step_m * COUNTS_PER_M)), 10.0 + gap_s)
        assert left.travel.travel_m == pytest.approx(step_m if taken else 0.0, abs=1e-4)


@pytest.mark.parametrize(("counts", "taken"), [(1, True), (2, False)])
def test_a_coarse_encoder_may_step_one_count_in_a_cycle(counts: int, taken: bool) -> None:
    robot = bench_robot()
    drive = robot.drives[0].model_copy(update={"counts_per_motor_rev": 1})
    left = Axis(drive, NodeLayout(1, (0,)), robot)
    left.on_status(status(ENABLED, 0), 10.0)
    left.on_status(status(ENABLED, counts), 10.01)
    assert (left.travel.travel_m > 0.0) is taken


@pytest.mark.parametrize(("share", "due"), [(0.74, False), (0.76, True)])
def test_a_wheel_must_be_released_after_three_quarters_of_what_the_watchdog_waits(share: float, due: bool) -> None:
    left, impulse_s = axis(), bench_robot().watchdog.stand_impulse_s
    left.target_mps = 0.1
    for n in range(1 + round(share * impulse_s / 0.001)):
        left.on_status(status(ENABLED, 0), n * 0.001)
        left.on_velocity(velocity(0), n * 0.001)
    assert left.torque_evidence.must_release is due


def test_a_wheel_that_nothing_was_ordered_of_owes_no_release() -> None:
    left = axis()
    left.target_mps = 0.1
    for n in range(500):  # ready to switch on: its setpoint is no order
        left.on_status(status(READY, 0), n * 0.01)
        left.on_velocity(velocity(0), n * 0.01)
    for n in range(500, 1000):
        left.target_mps = 0.0
        left.on_status(status(ENABLED, 0), n * 0.01)
        left.on_velocity(velocity(0), n * 0.01)
    assert not left.torque_evidence.must_release
    assert left.stillness.doubt == ""


def test_losses_are_restarts_and_jumps_together() -> None:
    left = axis()
    left.on_status(status(ENABLED, 0), 10.0)
    for n in range(1, 4):
        left.on_status(status(ENABLED, 10**6 + n), 10.0 + 0.01 * n)
    assert left.losses == 1
    left.forget()
    assert left.losses == 2


def test_values_count_up_to_their_very_last_moment() -> None:
    left, feedback_s = axis(), bench_robot().timeouts.feedback_s
    drives(left, 0.0, 0.0, -0.01)
    drives(left, 0.0, 0.0, 0.0)
    assert left.stands(feedback_s)
    assert left.has_fresh_sample(feedback_s)
    assert not left.stands(math.nextafter(feedback_s, 1.0))
    assert not left.has_fresh_sample(math.nextafter(feedback_s, 1.0))


NOISY_MPS = 0.9 * bench_robot().watchdog.motion_tolerance_mps
"""Faster than standstill: only an encoder that stays where it is for 0.2 s shows that the wheel is at standstill."""


@pytest.mark.parametrize(
    ("gap", "stands"), [("none", True), ("of the timeout", True), ("longer", False), ("forgotten", False)]
)
def test_after_a_gap_standstill_needs_its_time_again(gap: str, stands: bool) -> None:
    left, feedback_s = axis(), bench_robot().timeouts.feedback_s
    for n in range(25):
        drives(left, 0.0, NOISY_MPS, -0.24 + 0.01 * n)
    assert left.stands(0.0)
    if gap == "forgotten":
        left.forget()
    after_s = {"of the timeout": feedback_s, "longer": math.nextafter(feedback_s, 1.0)}.get(gap, 0.01)
    drives(left, 0.0, NOISY_MPS, after_s)
    assert left.stands(after_s) is stands


# 10.00 s: 0.3 m/s, then the drive is lost ── its velocity is read by SDO
@pytest.mark.parametrize(
    ("speed_mps", "after_s", "trusted"),
    [(0.3, 0.02, True), (0.0, 0.02, False), (0.0, 5.0, True), (-0.3, 0.02, True), (0.6, 0.02, True)],
)
def test_a_velocity_read_after_a_restart_is_doubted_where_no_wheel_slows_down_so(
    speed_mps: float, after_s: float, trusted: bool
) -> None:
    left = axis()
    drives(left, 0.0, 0.3, 10.0)
    left.forget()
    left.forget()  # what was lost before stays known
    left.on_speed(round(speed_mps * BITS_PER_MPS), 10.0 + after_s)
    assert left.velocity_mps == pytest.approx(speed_mps, abs=1e-4)
    assert (left.stillness.doubt == "") is trusted
    if not trusted:
        assert left.stillness.doubt == "went from 0.30 to 0.00 m/s in 0.02 s"
    left.on_status(status(READY, 0), 10.0 + after_s)
    assert left.age_s(10.0 + after_s) == 0.0


def test_a_velocity_read_before_anything_was_received_is_believed() -> None:
    left = axis()
    left.on_speed(0, 10.0)
    assert left.stillness.doubt == ""


@pytest.mark.parametrize(("word", "controlword"), [(ENABLED, 0x7F), (READY, 0x07)])
def test_a_drive_in_mode_vl_runs_its_ramp_only_while_it_is_enabled(word: int, controlword: int) -> None:
    robot = robot_with("inverter")
    drive = robot.drives[0]
    wheel = Axis(drive, NodeLayout(drive.node_id, (0,), drive.kind), robot)
    state = decode_statusword(word)
    frame = wheel.setpoint(PowerGoal.ON, 0.0, next_controlword(state, PowerGoal.ON))
    assert int.from_bytes(frame.data[:2], "little") == controlword


def test_how_a_wheel_stopped_while_its_drive_restarted_is_unknown_and_no_lie() -> None:
    """0.3 m/s until 10.2 s. Its drive restarts, and reports standstill 5 s later: it may have braked meanwhile."""
    left = axis()
    for n in range(21):
        drives(left, 0.003 * n, 0.3, 10.0 + 0.01 * n)
    left.forget()
    for n in range(30):
        left.on_status(status(READY, 0), 15.0 + 0.01 * n)
        left.on_velocity(velocity(0), 15.0 + 0.01 * n)
    assert left.stillness.doubt == ""
    assert left.is_proven_to_stand(15.29)
