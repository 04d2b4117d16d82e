"""What stops drives whose PDOs the boot had to choose otherwise: without SYNC, or with one TPDO for each motor."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_runtime.driver_state import DriverState
from canbase_sim.faults import KINDS
from canbase_sim.personality import PERSONALITIES, Personality
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import World, world_of
from support.personalities import NO_SYNC, set_personality, with_tpdos

ONE_TPDO = with_tpdos(PERSONALITIES["inverter"], 1)
BOTH = replace(ONE_TPDO, missing=ONE_TPDO.missing | NO_SYNC.missing)


@pytest.fixture(
    params=[("generic", NO_SYNC), ("inverter", ONE_TPDO), ("inverter", BOTH)],
    ids=["without SYNC", "one TPDO", "one TPDO without SYNC"],
)
def world(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> World:
    kind, personality = request.param
    assert isinstance(personality, Personality)
    set_personality(monkeypatch, kind, personality)
    return world_of(kind)


def test_when_its_tpdos_stop_the_base_stops_within_the_time_limit_of_the_feedback(world: World) -> None:
    watchdog = world.watchdog
    assert watchdog is not None
    world.drive()
    KINDS["tpdo_lost"][0](world.node, world.now_s)
    start = world.now_s
    assert world.run(
        1.0,
        lambda: watchdog.status.verdict.cause is not TripCause.NONE or world.core.state is not DriverState.ENABLED,
    )
    assert world.now_s - start <= world.robot.timeouts.feedback_s + 0.03


def test_when_the_driver_dies_the_watchdog_stops_it(world: World) -> None:
    world.drive()
    world.kill_driver()
    assert world.stands_after(1.0) < 0.6


def test_when_the_computer_dies_it_stops_by_itself(world: World) -> None:
    world.drive()
    world.kill_driver()
    world.watchdog = None
    assert world.stands_after(2.0) < 0.8
