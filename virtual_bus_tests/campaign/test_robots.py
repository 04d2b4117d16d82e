"""The robots that are drawn, and the states of the world that excuse: what reaches a drive, what its encoder counts."""

from __future__ import annotations

import pytest

from canbase_campaign.outside import Surroundings
from canbase_campaign.reach import Reach
from canbase_campaign.robots import BITRATES, GRAVITY_MPS2, bitrates, draw_robot, robot_of, rolls_out
from canbase_campaign.shown import Shown
from canbase_campaign.world import World
from canbase_config.commissioned import uncommissioned
from canbase_config.robot import Robot
from canbase_sim.faults import apply
from canbase_velocity.twist import Twist

pytestmark = pytest.mark.campaign


@pytest.mark.parametrize("number", range(60))
def test_a_drawn_robot_passes_the_checks_and_can_do_what_its_file_states(number: int) -> None:
    drawn = draw_robot(number)
    body, limits, wheels = drawn.body, drawn.robot.limits, len(drawn.robot.drives)
    Robot.model_validate(drawn.robot.model_dump())
    assert not uncommissioned(drawn.robot), "it is as fast as its limits"
    assert set(bitrates(drawn.robot)) <= set(BITRATES)
    inertia_kg = body.mass_kg * body.payload_factor + wheels * body.wheel_mass_kg
    friction_n = wheels * body.coulomb_n
    assert wheels * body.peak_force_n + friction_n > inertia_kg * limits.emergency_deceleration_mps2 + abs(drawn.push_n)
    assert (body.coulomb_n + abs(drawn.push_n) / wheels) / body.peak_force_n <= 0.46, (
        "a wheel that creeps takes so much"
    )
    assert abs(drawn.push_n) < friction_n, "without power it stays on its slope"
    assert abs(drawn.push_n) <= body.mass_kg * body.payload_factor * GRAVITY_MPS2 * 0.1 + 0.1
    assert min(rolls_out(drawn)) > 0.0


def test_a_seed_has_its_robot_and_the_first_ones_have_the_sample() -> None:
    assert robot_of(24).number == 0
    assert robot_of(25) is robot_of(49) is draw_robot(1)
    robots = [draw_robot(number).robot for number in range(1, 60)]
    assert {len(robot.drives) for robot in robots} == {2, 4, 6, 8}
    assert len({robot.drives[0].profile for robot in robots}) == 11


@pytest.fixture
def driving() -> World:
    """0.3 m/s straight on."""
    world = World()
    Surroundings(world)
    world.enable()
    for _ in range(16):
        world.topics.publish("cmd_vel_joy", Twist(0.3, 0.0))
        world.clock.run_until(world.clock.now_s + 0.05)
    return world


def test_a_drive_is_out_of_reach_when_nobody_has_a_line_to_it_and_its_sensor_lies(driving: World) -> None:
    reach, nodes = Reach(driving), driving.drives.bench.nodes

    def lost() -> bool:
        reach.step(stands=False)
        return reach.lost

    assert not lost()
    driving.driver.die()
    driving.watchdog.die()
    assert not lost(), "it watches its masters, and stops by itself"
    apply(nodes, 1, "encoder_lost", driving.clock.now_s, {})
    assert lost()
    driving.watchdog.restart()
    assert not lost()
    driving.bus.disturbance.blocked.add(("watchdog", "drive1"))
    assert lost()
    driving.bus.disturbance.blocked.clear()
    driving.watchdog.fail_bus(True)
    assert lost()


def test_a_wheel_counts_in_the_measure_of_its_encoder(driving: World) -> None:
    shown = Shown(driving)
    shown.look()
    assert shown.left_mps == pytest.approx(0.3, abs=0.02)
    apply(driving.drives.bench.nodes, 1, "encoder_scaled", driving.clock.now_s, {"factor": 0.5})
    shown.look()
    assert (shown.left_mps, shown.right_mps) == pytest.approx((0.15, 0.3), abs=0.02)
    apply(driving.drives.bench.nodes, 1, "encoder_reversed", driving.clock.now_s, {})
    shown.look()
    assert shown.left_mps == pytest.approx(0.3, abs=0.02), "one that lies otherwise excuses nothing"
