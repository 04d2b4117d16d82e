"""Named values in spare TPDOs, from the drive to the snapshot: they come in time, and nothing depends on them."""

from __future__ import annotations

import math
from typing import Any

import pytest

from canbase_config.robot import Robot
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from support.chain_world import World
from support.crews import robot_with
from support.personalities import NO_SYNC, set_personality

SUPPLY = {"name": "dc_link", "index": 0x6079, "bits": 32, "scale": 0.001, "unit": "V", "period_s": 0.1}
LAST_ERROR = {"name": "last_error", "index": 0x603F, "bits": 16, "period_s": 0.1}
TORQUE = {"name": "torque", "index": 0x6077, "bits": 16, "signed": True, "scale": 0.1, "unit": "%", "period_s": 0.02}


def robot(*values: dict[str, Any]) -> Robot:
    """Two generic drives; the left one has these values."""
    given = robot_with("generic").model_dump()
    given["drives"][0]["values"] = list(values)
    return Robot.model_validate(given)


def known(world: World) -> dict[str, float]:
    return {each.name: each.value for each in world.snapshot.drives[0].values}


@pytest.mark.parametrize("synchronous", [True, False])
def test_they_come_by_name_in_their_unit_as_often_as_their_period_says(
    monkeypatch: pytest.MonkeyPatch, synchronous: bool
) -> None:
    """TPDO3 each 0.1 s, TPDO4 each 0.02 s; also by a drive that refuses PDOs that wait for SYNC."""
    if not synchronous:
        set_personality(monkeypatch, "generic", NO_SYNC)
    world = World(robot(SUPPLY, LAST_ERROR, TORQUE))
    world.drive(seconds=0.5)
    counted = len(world.sent(0x381)), len(world.sent(0x481))
    world.run(2.0)
    came = len(world.sent(0x381)) - counted[0], len(world.sent(0x481)) - counted[1]
    assert abs(came[0] - 20) <= 1
    assert abs(came[1] - 100) <= 2
    assert known(world) == {
        "dc_link": pytest.approx(24.0, abs=4.0),
        "last_error": 0.0,
        "torque": pytest.approx(0, abs=99),
    }
    assert [each.unit for each in world.snapshot.drives[0].values] == ["V", "", "%"]
    assert world.snapshot.drives[1].values == ()


def test_an_object_that_the_drive_does_not_map_is_a_note_and_the_robot_drives() -> None:
    other = {"name": "firmware", "index": 0x100A, "bits": 32, "period_s": 0.1}
    world = World(robot(other, TORQUE))
    world.drive()
    assert world.core.state is DriverState.ENABLED
    notes = [note for note in world.snapshot.drives[0].boot_notes if "not published" in note]
    assert len(notes) == 1
    assert notes[0].startswith("firmware: not published, TPDO3: ")
    assert notes[0].endswith("see `values` of its drive in robot.yaml")
    assert math.isnan(known(world)["firmware"])
    assert not math.isnan(known(world)["torque"])
    assert world.sent(0x381) == []


def test_a_value_that_stops_coming_is_unknown_and_stops_nobody() -> None:
    world = World(robot(TORQUE))
    world.drive()
    world.node._tpdos[2].lost = True
    world.run(0.1)
    assert not math.isnan(known(world)["torque"])
    world.run(0.2)
    assert math.isnan(known(world)["torque"])
    assert world.core.state is DriverState.ENABLED


def test_a_drive_that_restarts_has_no_values_until_it_is_booted_again() -> None:
    world = World(robot(SUPPLY))
    world.drive()
    assert known(world)["dc_link"] > 0.0
    world.node.power_cycle(world.now_s, 0.5)
    world.run_until(DriverState.LATCHED, 5.0)
    assert math.isnan(known(world)["dc_link"])
    world.command = Twist2D.ZERO  # the watchdog waits until the wheel must have rolled out, and lets it be booted then
    assert world.run(20.0, lambda: not math.isnan(known(world)["dc_link"]))


def test_frames_that_pass_for_values_move_nothing_and_change_no_feedback() -> None:
    """380h + id is the second axis's status on a node with two motors; this one has one."""
    world = World(robot(TORQUE))
    world.drive()
    for data in ("37 02 FF FF FF 7F", "08", "FF 7F"):
        world.inject(0x381, data)
    world.run(0.01)
    assert world.core.state is DriverState.ENABLED
    assert world.snapshot.drives[0].velocity_radps == pytest.approx(3.0, rel=0.05)


@pytest.mark.parametrize("values", [(), (SUPPLY, LAST_ERROR, TORQUE)])
def test_when_the_driver_dies_the_base_stops_as_soon_as_without_values(values: tuple[dict[str, Any], ...]) -> None:
    world = World(robot(*values))
    world.drive()
    world.kill_driver()
    assert world.stands_after(1.0) < 0.45


def test_when_the_computer_dies_the_drive_with_values_stops_by_itself() -> None:
    world = World(robot(SUPPLY, TORQUE))
    world.drive()
    world.kill_driver()
    world.watchdog = None
    assert world.stands_after(2.0) < 0.8
