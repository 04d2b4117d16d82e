"""A drive in its fault reaction takes no controlword, and its sensor lies: NMT reset node takes its power.

Real driver core, real watchdog, simulated drives whose loops close on the faulty sensor.
"""

from __future__ import annotations

import pytest

from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_sim.faults import KINDS
from canbase_watchdog.ladder import RUNGS, Step
from canbase_watchdog.watchdog import State
from support.chain_world import World

RESET = b"\x81\x01"


def in_its_fault_reaction(lie: str, mps: float = 0.5) -> World:
    """Driving; the encoder of the left drive lies, and the drive finds that something else is wrong."""
    world = World()
    world.drive(Twist2D(mps, 0.0), 1.2)
    KINDS[lie][0](world.node, world.now_s)
    KINDS["fault"][0](world.node, world.now_s)
    return world


def resets(world: World) -> list[float]:
    return [at for at, frame in world.log if frame.cob_id == 0 and frame.data == RESET]


@pytest.mark.parametrize(("lie", "mps"), [("encoder_reversed", 0.2), ("encoder_frozen", 0.8)])
def test_a_drive_whose_sensor_lies_in_the_fault_reaction_loses_its_power_within_a_second(lie: str, mps: float) -> None:
    """fault reaction ── found ── power off, 0.1 s ── heartbeat withheld, relay open, 0.1 s ── NMT reset node."""
    world = in_its_fault_reaction(lie, mps)
    begin, watchdog = world.now_s, world.watchdog
    assert watchdog is not None
    assert world.run(1.0, lambda: not world.powered[0])
    assert len(resets(world)) == 1
    assert resets(world)[0] - begin < 0.7
    assert watchdog.status.state is State.TRIPPED
    assert not watchdog.keeps_relay
    world.run(2.0)
    assert not any(world.powered)
    assert world.core.state is DriverState.LATCHED
    assert len(resets(world)) == 1


def test_the_rung_comes_after_power_off_and_the_relay() -> None:
    world = in_its_fault_reaction("encoder_reversed")
    watchdog = world.watchdog
    assert watchdog is not None
    entered: dict[Step, float] = {}

    def look() -> bool:
        entered.setdefault(watchdog.status.step, world.now_s)
        return not world.powered[0]

    world.run(1.0, look)
    assert entered[Step.HEARTBEAT_WITHHELD] - entered[Step.DISABLE_VOLTAGE] <= RUNGS[Step.DISABLE_VOLTAGE].obey_s + 0.02
    waits_s = entered[Step.RESET_NODE] - entered[Step.HEARTBEAT_WITHHELD]
    assert 0.02 < waits_s <= RUNGS[Step.HEARTBEAT_WITHHELD].obey_s + 0.05
    assert resets(world) == [pytest.approx(entered[Step.RESET_NODE], abs=0.003)]


def test_it_has_forgotten_1016h_and_is_configured_by_the_next_boot_before_it_gets_power() -> None:
    world = in_its_fault_reaction("encoder_reversed")
    world.run(1.0, lambda: bool(resets(world)))
    world.run(0.05)
    assert world.node.dictionary.values[key(0x1016, 1)] == 0
    KINDS["heal"][0](world.node, world.now_s)
    world.command = Twist2D.ZERO
    assert world.run(4.0, lambda: world.truth.standing_s > 0.5)
    assert world.reset().done
    world.run(4.0, lambda: world.core.state is DriverState.ENABLED)
    assert world.core.state is DriverState.ENABLED
    assert world.node.dictionary.values[key(0x1016, 1)] != 0


@pytest.mark.parametrize("kind", ["encoder_lost", "silent"])
def test_a_drive_that_obeyed_or_is_not_heard_is_never_reset(kind: str) -> None:
    world = World()
    world.drive(Twist2D(0.5, 0.0), 1.2)
    KINDS[kind][0](world.node, world.now_s)
    world.run(1.5)
    assert world.watchdog is not None
    assert world.watchdog.status.state is State.TRIPPED
    assert resets(world) == []
