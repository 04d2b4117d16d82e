"""The robot under the simulated drives: friction, ramps, coupling, slip, pose; and its servo."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_sim.plant.base import Base, MountedWheel, PlantParameters
from canbase_sim.plant.motor import Motor

STEP_S = PlantParameters().step_s
TRACK_M = 0.5


class Robot:
    """A base with one wheel on each side and its clock."""

    def __init__(self, body: PlantParameters | None = None, wheels_per_side: int = 1) -> None:
        self.body = body or PlantParameters()
        count = 2 * wheels_per_side
        self.left = [self.body.motor(count) for _ in range(wheels_per_side)]
        self.right = [self.body.motor(count) for _ in range(wheels_per_side)]
        left, right = ([MountedWheel(motor, 1) for motor in side] for side in (self.left, self.right))
        self.base = Base(self.body, TRACK_M, 0.005, left, right, now_s=0.0)
        self.now_s = 0.0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.base.step(self.now_s)

    def order(self, left: float, right: float, slope: float = 1.0) -> None:
        for motors, goal in ((self.left, left), (self.right, right)):
            for motor in motors:
                if not motor.powered:
                    motor.power_on()
                motor.run(goal, slope, slope)

    def release(self) -> None:
        for motor in self.left + self.right:
            motor.power_off()


def test_a_ramp_of_1_mps2_is_followed_within_7_mm_per_s_and_without_overshoot() -> None:
    robot = Robot()
    robot.order(0.5, 0.5)
    worst, fastest = 0.0, 0.0
    for _ in range(round(1.0 / STEP_S)):
        robot.run(STEP_S)
        worst = max(worst, abs(robot.left[0].demand_mps - robot.base.v_left_mps))
        fastest = max(fastest, robot.base.v_left_mps)
    assert worst < 0.007
    assert fastest < 0.507
    assert robot.base.v_mps == pytest.approx(0.5, abs=1e-4)


def test_after_a_ramp_to_zero_it_stands_still_and_does_not_ring() -> None:
    robot = Robot()
    robot.order(0.3, 0.3)
    robot.run(1.0)
    robot.order(0.0, 0.0)
    robot.run(0.3 + 0.15)
    where = robot.base.travel_left_m
    for _ in range(500):
        robot.run(STEP_S)
        assert abs(robot.base.v_left_mps) < 1e-3
    assert robot.base.travel_left_m == pytest.approx(where, abs=2e-5)
    assert robot.base.resting


def test_an_unpowered_robot_coasts_to_rest_by_friction() -> None:
    """12 N of dry friction and 16 N·s/m on 36 kg from 0.5 m/s: v stops after (m/d)·ln(1 + d·v/F) = 1.15 s."""
    robot = Robot()
    robot.order(0.5, 0.5)
    robot.run(1.5)
    robot.release()
    robot.run(1.10)
    assert robot.base.v_mps > 0.005
    robot.run(0.10)
    assert robot.base.v_mps == 0.0
    assert robot.base.resting


def test_at_rest_nothing_ever_changes() -> None:
    robot = Robot()
    robot.run(1.0)
    assert (robot.base.x_m, robot.base.v_left_mps, robot.base.time_of_motion) == (0.0, 0.0, 0.0)


def test_turning_in_place_stays_in_place() -> None:
    """Rims at ±0.2 m/s on a track of 0.5 m: 0.8 rad/s."""
    robot = Robot()
    robot.order(-0.2, 0.2)
    robot.run(2.0)
    assert robot.base.w_radps == pytest.approx(0.8, abs=1e-3)
    assert (robot.base.x_m, robot.base.y_m) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert robot.base.yaw_rad == pytest.approx(0.8 * 1.9, abs=0.01)  # 0.2 s of ramp count half


def test_an_arc_ends_where_geometry_says() -> None:
    robot = Robot()
    robot.order(0.2, 0.3)
    robot.run(6.0)
    left, right = robot.base.travel_left_m, robot.base.travel_right_m
    yaw = (right - left) / TRACK_M
    assert robot.base.turned_rad == pytest.approx(yaw, abs=1e-9)
    # after the ramps the radius is constant: 0.25 / 0.1 · 0.5 = 1.25 m
    ramps = Robot()
    ramps.order(0.2, 0.3)
    ramps.run(0.5)
    x0, y0, yaw0 = ramps.base.x_m, ramps.base.y_m, ramps.base.turned_rad
    x = x0 + 1.25 * (sin(yaw) - sin(yaw0))
    y = y0 - 1.25 * (cos(yaw) - cos(yaw0))
    assert (robot.base.x_m, robot.base.y_m) == pytest.approx((x, y), abs=1e-4)


def test_heading_is_kept_between_minus_pi_and_pi() -> None:
    robot = Robot()
    robot.order(-0.5, 0.5)
    robot.run(4.0)
    assert robot.base.turned_rad > 2 * pi
    assert -pi <= robot.base.yaw_rad < pi


def test_pushing_one_side_drags_the_other() -> None:
    """The mass couples the sides: the left wheel is off, and turns."""
    robot = Robot(replace(PlantParameters(), coulomb_n=0.5, viscous_nspm=0.0, yaw_gyration_m=0.1))
    robot.right[0].power_on()
    robot.right[0].run(0.5, 1.0, 1.0)
    robot.run(0.3)
    assert robot.base.v_right_mps > 0.2
    assert abs(robot.base.v_left_mps) > 0.01


def test_payload_makes_a_torque_limited_start_slower() -> None:
    way = []
    for factor in (1.0, 3.0):
        robot = Robot(replace(PlantParameters(), payload_factor=factor))
        robot.order(1.0, 1.0, slope=100.0)
        robot.run(0.1)
        way.append(robot.base.v_mps)
    light, heavy = way
    assert heavy < 0.5 * light
    assert robot.left[0].saturated


def test_slip_shows_in_the_truth_and_not_at_the_wheels() -> None:
    robot = Robot(replace(PlantParameters(), slip_left=0.1))
    robot.order(0.2, 0.2)
    robot.run(2.0)
    assert robot.base.travel_left_m == pytest.approx(robot.base.travel_right_m)
    assert robot.base.travel_m == pytest.approx(0.95 * robot.base.travel_left_m)
    assert robot.base.yaw_rad == pytest.approx(0.1 * robot.base.travel_left_m / TRACK_M)


def test_four_wheels_share_the_work() -> None:
    robot = Robot(wheels_per_side=2)
    robot.order(0.4, 0.4)
    robot.run(1.5)
    assert robot.base.v_mps == pytest.approx(0.4, abs=1e-3)
    assert robot.left[0].force_n == pytest.approx(robot.left[1].force_n)


def test_backward_counts_in_the_path_and_not_in_the_travel() -> None:
    robot = Robot()
    for goal in (0.2, -0.2):
        robot.order(goal, goal)
        robot.run(2.0)
    robot.order(0.0, 0.0)
    robot.run(1.0)
    assert robot.base.path_m > 0.6
    assert robot.base.travel_m < 0.1


def test_the_time_of_the_last_motion_is_kept() -> None:
    robot = Robot()
    robot.order(0.1, 0.1)
    robot.run(0.5)
    robot.order(0.0, 0.0)
    robot.run(1.0)
    assert robot.base.time_of_motion == pytest.approx(0.6, abs=0.02)


@pytest.mark.parametrize(
    "wrong",
    [{"mass_kg": 0.0}, {"coulomb_n": -1.0}, {"slip_left": 1.0}, {"step_s": float("nan")}, {"bandwidth_radps": 600.0}],
)
def test_a_body_that_cannot_be_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        replace(PlantParameters(), **wrong)


speeds = st.floats(-2.0, 2.0)


@settings(max_examples=60, deadline=None)
@given(
    left=speeds,
    right=speeds,
    coulomb=st.floats(0.0, 50.0),
    gyration=st.floats(0.01, 1.0),
    wheel=st.floats(0.01, 10.0),
)
def test_without_power_energy_never_rises(
    left: float, right: float, coulomb: float, gyration: float, wheel: float
) -> None:
    body = PlantParameters(coulomb_n=coulomb, yaw_gyration_m=gyration, wheel_mass_kg=wheel)
    robot = Robot(body)
    robot.base.v_left_mps, robot.base.v_right_mps = left, right
    before = robot.base.kinetic_energy_j
    for _ in range(400):
        robot.run(STEP_S)
        energy = robot.base.kinetic_energy_j
        assert energy <= before + 1e-12
        before = energy


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(speeds, st.floats(0.1, 50.0)), min_size=1, max_size=6))
def test_force_never_exceeds_the_limit_and_speed_stays_near_what_was_ordered(orders: list[tuple[float, float]]) -> None:
    robot = Robot()
    for goal, slope in orders:
        robot.order(goal, goal, slope)
        for _ in range(100):
            robot.run(STEP_S)
            assert abs(robot.left[0].force_n) <= robot.body.peak_force_n
            assert abs(robot.base.v_left_mps) < 2.3


def test_the_end_of_a_stop_is_told_once() -> None:
    told: list[float] = []
    robot = Robot()
    robot.order(0.3, 0.3)
    robot.run(1.0)
    for motor in robot.left + robot.right:
        motor.stop(2.0, lambda: told.append(robot.now_s))
    start = robot.now_s
    robot.run(1.0)
    assert len(told) == 2
    assert all(0.14 <= time - start <= 0.19 for time in told)


def test_enabling_at_speed_starts_from_that_speed() -> None:
    motor = Motor(mass_kg=18.0, bandwidth_radps=200.0, peak_force_n=90.0, dt=STEP_S)
    motor.step(0.4)
    motor.power_on()
    assert motor.demand_mps == 0.4
    assert motor.step(0.4) == 0.0


def test_a_wheel_that_slips_turns_and_moves_the_base_less() -> None:
    """Both rims at 0.5 m/s, the left one with half of its way: 0.375 m/s and a turn to the left."""
    robot = Robot()
    robot.order(0.5, 0.5)
    robot.base.grip("left", 0.5)
    assert not robot.base.is_as_configured
    robot.run(1.0)
    assert robot.base.v_left_mps == pytest.approx(0.5, abs=0.005)
    assert robot.base.v_mps == pytest.approx(0.375, abs=0.005)
    assert robot.base.w_radps == pytest.approx(0.25 / TRACK_M, abs=0.01)
    robot.base.grip("left", 1.0)
    assert robot.base.is_as_configured


def test_a_base_with_one_side_in_the_air_turns_about_it() -> None:
    robot = Robot()
    robot.base.lift("right", True)
    robot.order(0.5, 0.5)
    robot.run(1.5)
    assert robot.base.v_right_mps == pytest.approx(0.5, abs=0.02), "it turns in the air"
    assert robot.base.v_mps == pytest.approx(0.25, abs=0.01)
    assert robot.base.w_radps < -0.9
    robot.base.lift("right", False)
    assert robot.base.is_as_configured
    robot.run(1.0)
    assert robot.base.v_mps == pytest.approx(0.5, abs=0.01)


def test_a_motor_without_a_coupling_turns_alone_and_its_wheel_rolls_out() -> None:
    """t   0 both at 0.5 m/s; the left coupling breaks, and zero is commanded"""
    robot = Robot()
    robot.order(0.5, 0.5)
    robot.run(1.0)
    rotor = robot.base.uncouple(robot.left[0])
    robot.order(0.0, 0.0)
    robot.run(0.6)
    assert rotor.speed_mps == pytest.approx(0.0, abs=0.01), "the motor stops as ordered"
    assert 0.1 < rotor.travel_m < 0.16, "0.5 m/s at 1 m/s²"
    assert robot.base.v_left_mps > 0.03, "the wheel rolls on"
    assert abs(robot.base.v_right_mps) < 0.01
    robot.run(3.0)
    assert robot.base.v_left_mps == 0.0, "friction stops it"
    assert not robot.base.is_as_configured
