"""The supply of the simulated drives: it sags with the load, and rises when they brake."""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_sim.plant.base import PlantParameters
from canbase_sim.plant.battery import COPPER_W, RESISTANCE_OHM, REST_V, Battery
from support.chain_world import World, world_of


def loaded(force_n: float, speed_mps: float) -> Battery:
    """With one motor that gives this force at this speed."""
    motor = PlantParameters().motor(2)
    motor.force_n, motor.speed_mps = force_n, speed_mps
    return Battery([motor])


def test_without_load_it_has_its_voltage_at_rest() -> None:
    assert loaded(0.0, 1.0).voltage_v == REST_V


@pytest.mark.parametrize(("force_n", "speed_mps"), [(90.0, 0.0), (90.0, 1.0), (45.0, 0.3), (-90.0, 2.0)])
def test_power_and_resistance_make_the_sag(force_n: float, speed_mps: float) -> None:
    """Kirchhoff: the source gives what the motors take and what its resistance heats."""
    battery = loaded(force_n, speed_mps)
    current_a = (REST_V - battery.voltage_v) / RESISTANCE_OHM
    assert REST_V * current_a == pytest.approx(battery.power_w + RESISTANCE_OHM * current_a**2, abs=1e-6)
    assert (battery.voltage_v < REST_V) is (battery.power_w > 0.0)


def test_a_blocked_motor_takes_heat_alone() -> None:
    assert loaded(90.0, 0.0).power_w == COPPER_W
    assert loaded(-90.0, 0.0).power_w == COPPER_W


def test_it_gives_no_more_power_than_its_resistance_allows() -> None:
    assert loaded(90.0, 1000.0).voltage_v == REST_V / 2.0


def test_the_bench_shows_in_6079h_that_its_motors_work() -> None:
    world = world_of("elmo_gold")
    world.enable()
    world.run(2.0)
    assert world.snapshot.drives[0].voltage_v == REST_V
    world.command = Twist2D(0.5, 0.0)
    world.run(2.0)
    assert world.snapshot.drives[0].voltage_v == pytest.approx(world.bench.battery.voltage_v, abs=0.01)
    assert world.snapshot.drives[0].voltage_v < REST_V - 0.01


def test_both_axes_of_a_node_share_it() -> None:
    world = World()
    node = world.node
    for number in range(len(node.axes)):
        data = node.dictionary.get_data(0x6079 + 0x800 * number, 0)
        assert int.from_bytes(data, "little") == 1000 * REST_V
