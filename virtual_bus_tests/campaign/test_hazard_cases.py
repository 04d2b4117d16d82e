"""Times of hazards.yaml on drawn robots, straight on, in curves and in place; and the worst of a lost encoder."""

from __future__ import annotations

from random import Random

import pytest

from campaign.hazard_cases import CASES, ROWS, Case, Motion, drawn_motions, tried
from canbase_campaign.cruise import Cruise
from canbase_campaign.robots import campaign_robot, draw_robot
from canbase_campaign.twins import JOYSTICK, Twin, drive
from canbase_config.robot import Robot
from canbase_config.stopping import max_wheel_mps
from canbase_driver.motion.braking import Braking
from canbase_hazards.formula import evaluate

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
BY_HOW = {case.how: case for case in CASES}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.how)
def test_a_time_holds_on_drawn_robots_at_drawn_motions(case: Case) -> None:
    runs = list(tried(case, range(4), motions=4, runs=1))
    assert len(runs) >= 4
    assert [str(each) for each in runs if not each.holds] == []


# straight on, a curve, in place, by 0.1 m/s or less: what an earlier formula did not hold for
@pytest.mark.parametrize(
    ("how", "number", "motion"),
    [
        ("repeats its last setpoints for ever, then zero is commanded", 0, Motion(0.8, 2.0)),
        ("repeats its last setpoints for ever, then zero is commanded", 4, Motion(0.692, 0.0)),
        ("repeats its last setpoints for ever, then zero is commanded", 18, Motion(0.0, 0.666)),
        ("repeats its last setpoints for ever, then zero is commanded", 36, Motion(0.0, 1.08)),
        ("ignores zero, then zero is commanded", 1, Motion(0.227, 0.0)),
        ("motor without force", 0, Motion(0.48, -1.452)),
        ("motor without force", 13, Motion(0.891, -2.122)),
        ("setpoints lost, then zero is commanded", 2, Motion(0.484, 0.84)),
    ],
)
def test_the_worst_motions_that_a_search_found(how: str, number: int, motion: Motion) -> None:
    case, drawn = BY_HOW[how], draw_robot(number)
    for seed in range(2):
        run = case.run(drawn, motion, seed)
        assert min(run.acts_s, run.time_s) <= case.within_s(drawn.robot), run


def given_up_after_s(robot: Robot, motion: Motion, share: float) -> float:
    """How long the driver waits for wheels that keep this share of the speed that its ramp leaves them at most."""
    braking, period_s = Braking(robot), 1.0 / robot.rates.control_hz
    speed_mps = abs(motion.linear_mps) + abs(motion.angular_radps) * robot.base.track_m / 2.0
    braking.begin(speed_mps, motion.angular_radps, 0.0, quick=False)
    cycle = 0
    while not braking.fails(max(share * braking.allowed_mps(cycle * period_s), 0.001), cycle * period_s):
        cycle += 1
    return cycle * period_s


def test_wheels_that_turn_after_zero_are_given_up_in_time_on_drawn_robots_in_turns_too() -> None:
    """The slowest wheel that is still tolerated; the driver's own deadline, standstill_s, comes on top."""
    row = ROWS["wheels_turn_after_zero"]
    for number in range(60):
        robot = draw_robot(number).robot
        limits = robot.limits
        corners = [Motion(v * limits.linear_mps, w * limits.angular_radps) for v in (0, 1) for w in (0, 1) if v or w]
        for motion in (*corners, *drawn_motions(robot, Random(number), 6)):
            speed_mps = abs(motion.linear_mps) + abs(motion.angular_radps) * robot.base.track_m / 2.0
            if speed_mps > max_wheel_mps(robot):
                continue
            assert given_up_after_s(robot, motion, 1.1) <= evaluate(row.within_s, robot), (number, motion)


LOST = Twin("encoder", "lost", drive("encoder_lost"), JOYSTICK, lies=True)
GIVES_MPS2 = 5.3
"""What the bench's motor gives a wheel without load, at the rated torque."""


# just below the jump that is noticed: jolt_mps2 × a cycle and the tolerance of a velocity, 0.25 m/s
@pytest.mark.parametrize("turn_radps", [-1.0, 0.0, 0.5, 1.0, 2.0])
def test_the_runaway_of_a_lost_encoder_has_its_worst_just_below_the_jump_at_any_turn(turn_radps: float) -> None:
    robot = campaign_robot()
    watchdog = robot.watchdog
    jump_mps = watchdog.jolt_mps2 / robot.rates.control_hz + watchdog.motion_tolerance_mps
    peaks = {}
    arm_mps = turn_radps * robot.base.track_m / 2.0
    for wheel_mps in (0.1, jump_mps - 0.01, jump_mps, jump_mps + 0.02, 0.4, 0.6, 0.8):
        linear_mps = wheel_mps - abs(arm_mps)
        if not -0.01 <= linear_mps <= robot.limits.linear_mps:
            continue
        cruise = Cruise(JOYSTICK, max(linear_mps, 0.0), turn_radps=turn_radps)
        peaks[wheel_mps] = max(cruise.fork(LOST, seed).peak_mps for seed in range(4))
    stated_mps = jump_mps + GIVES_MPS2 * (0.88 * watchdog.motion_missing_s + 2 / robot.rates.control_hz)
    assert max(peaks.values()) <= stated_mps, peaks
    assert stated_mps == pytest.approx(1.52, abs=0.005)
