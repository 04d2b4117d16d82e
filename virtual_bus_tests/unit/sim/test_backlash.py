"""A motor with play between it and its wheel: it turns alone inside the play, and no blow makes energy."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_sim.plant.base import Base, LooseRotor, MountedWheel, PlantParameters
from canbase_sim.plant.motor import Motor

BODY = PlantParameters()
PLAY_M = 0.004


class Robot:
    """One wheel on each side; the left one has play."""

    def __init__(self, body: PlantParameters = BODY, play_m: float = PLAY_M, direction: int = 1) -> None:
        self.motors: list[Motor] = [body.motor(2), body.motor(2)]
        left, right = ([MountedWheel(motor, direction)] for motor in self.motors)
        self.base, self.now_s = Base(body, 0.5, 0.005, left, right, now_s=0.0), 0.0
        self.rotor: LooseRotor = self.base.loosen(self.motors[0], play_m)
        self.direction = direction

    @property
    def energy_j(self) -> float:
        return self.base.kinetic_energy_j + self.rotor.mass_kg * self.rotor.speed_mps**2 / 2.0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / BODY.step_s)):
            self.now_s += BODY.step_s
            self.base.step(self.now_s)

    def order(self, mps: float) -> None:
        for motor in self.motors:
            if not motor.powered:
                motor.power_on()
            motor.run(self.direction * mps, 1.0, 1.0)


@pytest.mark.parametrize("direction", [1, -1])
def test_the_base_follows_through_the_play(direction: int) -> None:
    robot = Robot(direction=direction)
    robot.order(0.4)
    robot.run(2.0)
    assert robot.base.v_left_mps == pytest.approx(0.4, abs=0.02)
    assert robot.rotor.travel_m == pytest.approx(direction * robot.base.travel_left_m, abs=PLAY_M)
    robot.order(0.0)
    robot.run(2.0)
    assert robot.base.v_left_mps == pytest.approx(0.0, abs=0.005)
    assert robot.rotor.speed_mps == pytest.approx(0.0, abs=0.005)


def test_inside_the_play_the_rotor_turns_alone() -> None:
    robot = Robot()
    robot.rotor.speed_mps = 0.1
    robot.run(PLAY_M / 2.0 / 0.1 * 0.8)
    assert robot.base.v_left_mps == 0.0
    assert robot.rotor.speed_mps == 0.1


def test_a_blow_makes_both_equally_fast() -> None:
    robot = Robot(PlantParameters(coulomb_n=0.0, viscous_nspm=0.0))
    robot.rotor.speed_mps = 1.0
    before_j = robot.energy_j
    robot.run(0.02)
    assert robot.base.v_left_mps == pytest.approx(robot.rotor.speed_mps)
    assert robot.base.v_left_mps > 0.0
    assert robot.energy_j < before_j


def test_a_wheel_that_friction_holds_stops_its_rotor_at_the_end_of_the_play() -> None:
    """90 N on one wheel are not enough against 200 N of friction."""
    robot = Robot(PlantParameters(coulomb_n=200.0))
    robot.order(0.5)
    robot.run(1.0)
    assert robot.base.travel_left_m == pytest.approx(0.0, abs=1e-4)
    assert abs(robot.rotor.ahead_m) < PLAY_M


@settings(max_examples=60, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(0.0002, 0.01), st.floats(0.05, 0.95))
def test_no_step_without_power_makes_energy(
    turns: float, left: float, right: float, play_m: float, share: float
) -> None:
    robot = Robot(PlantParameters(rotor_share=share), play_m)
    robot.rotor.speed_mps, robot.base.v_left_mps, robot.base.v_right_mps = turns, left, right
    robot.base.resting = False
    before_j = robot.energy_j
    for _ in range(500):
        robot.run(BODY.step_s)
        assert robot.energy_j <= before_j + 1e-9
        before_j = robot.energy_j


def test_the_mass_of_the_whole_stays_and_a_loose_base_does_not_rest() -> None:
    body = PlantParameters()
    tight = Base(body, 0.5, 0.005, [MountedWheel(body.motor(2), 1)], [MountedWheel(body.motor(2), 1)], 0.0)
    robot = Robot(body)
    for base in (tight, robot.base):
        base.v_left_mps = base.v_right_mps = 1.0
    robot.rotor.speed_mps = 1.0
    assert robot.energy_j == pytest.approx(tight.kinetic_energy_j)
    assert robot.base.rotor_kg == pytest.approx(1.5)
    robot.run(5.0)
    assert not robot.base.resting
    assert robot.base.is_as_configured


@pytest.mark.parametrize("share", [0.0, 1.0, -0.1])
def test_a_rotor_is_a_part_of_its_wheel(share: float) -> None:
    with pytest.raises(ValueError, match="rotor_share"):
        PlantParameters(rotor_share=share)
