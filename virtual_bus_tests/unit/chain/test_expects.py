"""A drive that has lost its polarity agrees with itself in everything, and turns its wheel the other way."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from canbase_commissioning.edits import edited, expects_edits, with_edits
from canbase_config.commissioned import mark, uncommissioned_mps
from canbase_config.drive import Identity
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_config.scale_objects import Expected
from canbase_driver.boot.sequence import BootReport
from canbase_driver.boot.settings import STOPS_BY_NOTHING
from canbase_driver.drives import drive_group
from canbase_driver.drives.canopen_node import CanopenNode
from canbase_driver.motion.kinematics import Twist2D
from canbase_runtime.driver_state import DriverState
from canbase_sim.cia301.dictionary import key
from canbase_sim.odd.draw import OddDrive
from canbase_sim.odd.oddity import Drawn, with_manner
from canbase_sim.personality import PERSONALITIES, Extra, Personality
from canbase_watchdog.trip_cause import TripCause
from support.chain_world import FORWARD, World, bench_robot
from support.personalities import set_personality

POLARITY = key(0x607E)
REVERSED = 0xC0
"""Velocities and positions count the other way (CiA 402-2, 607Eh)."""
IT_IS = Expected(index=0x607E, value=0)
"""As it was when the wheels were measured."""


def after_power_on(monkeypatch: pytest.MonkeyPatch, value: int, notation: Extra | None = None) -> None:
    """All drives have 607Eh with this value; `notation`: and 6089h."""
    found = PERSONALITIES.get("generic", Personality())
    extras = {**found.extras, POLARITY: Extra("B", value, writable=True)}
    extras |= {} if notation is None else {key(0x6089): notation}
    set_personality(monkeypatch, "generic", replace(found, extras=extras))


def robot(*expected: Expected) -> Robot:
    drives = [
        drive.model_dump() | {"expects": [each.model_dump() for each in expected]} for drive in bench_robot().drives
    ]
    return Robot.model_validate(bench_robot().model_dump() | {"drives": drives})


def test_as_long_as_it_keeps_its_polarity_it_drives_forward(monkeypatch: pytest.MonkeyPatch) -> None:
    after_power_on(monkeypatch, 0)
    world = World(robot(IT_IS))
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)


def test_with_another_one_it_turns_the_other_way_and_agrees_with_everybody(monkeypatch: pytest.MonkeyPatch) -> None:
    """Why there is `expects`: no encoder contradicts, so neither driver nor watchdog can see it."""
    after_power_on(monkeypatch, REVERSED)
    world = World(robot())
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(-FORWARD.linear_mps, rel=0.02)
    assert world.core.state is DriverState.ENABLED


@pytest.mark.parametrize("value", [0x40, 0x80, REVERSED])
def test_a_drive_that_has_lost_it_gets_no_power(monkeypatch: pytest.MonkeyPatch, value: int) -> None:
    after_power_on(monkeypatch, value)
    world = World(robot(IT_IS))
    world.run(3.0)
    assert world.core.state is not DriverState.ENABLED
    problem = world.snapshot.drives[0].boot_problem
    assert f"607Eh:0 (polarity) of left_wheel is {value}, and was 0 when its wheel was measured" in problem
    assert "canbase bus params restore" in problem
    assert "take 607Eh:0 out of `expects` of left_wheel in robot.yaml" in problem


def test_one_that_does_not_show_the_object_gets_none_either() -> None:
    world = World(robot(Expected(index=0x60A9, value=1)))
    world.run(3.0)
    assert world.core.state is not DriverState.ENABLED
    assert "60A9h:0 (SI unit velocity) of left_wheel cannot be read" in world.snapshot.drives[0].boot_problem


def test_a_negative_value_is_compared_in_the_width_of_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    """6089h is an INTEGER8: -3 is FDh on the bus."""
    after_power_on(monkeypatch, 0, Extra("b", -3))
    world = World(robot(Expected(index=0x6089, value=-3)))
    world.enable()


@pytest.mark.parametrize("index", [0x607E, 0x60A9, 0x6091, 0x6891, 0x6097])
def test_another_client_that_writes_one_in_motion_is_a_stop(index: int) -> None:
    world = World()
    world.drive()
    world.inject(0x601, bytes((0x2F, index & 0xFF, index >> 8, 0, 0xC0, 0, 0, 0)).hex())
    assert world.run(0.1, lambda: watchdog_cause(world) is not TripCause.NONE)
    assert watchdog_cause(world) is TripCause.FOREIGN_MASTER
    assert world.stands_after(1.5) < 0.8


def watchdog_cause(world: World) -> TripCause:
    assert world.watchdog is not None
    return world.watchdog.status.verdict.cause


def test_commissioning_notes_what_the_drives_have_and_the_mark_holds_for_it(tmp_path: Path) -> None:
    base, scale = bench_robot(), (Expected(index=0x607E, value=REVERSED), Expected(index=0x6091, sub=1, value=20))
    boots = {1: report(1, left_wheel=scale), 2: report(2)}
    edits = expects_edits(base, boots)
    assert [str(edit) for edit in edits] == ["drives[0].expects: none → 607Eh:0 = 192, 6091h:1 = 20"]
    after = with_edits(base, edits)
    assert after.drives[0].expects == scale
    assert after.drives[1].expects == ()
    assert mark(after, "scale") != mark(base, "scale")
    assert mark(after, "directions") == mark(base, "directions")
    assert expects_edits(after, boots) == []
    text = edited(sample("bench").read_text(encoding="utf-8"), edits)
    assert "- {index: 0x607E, sub: 0, value: 192}" in text
    assert "- {index: 0x6091, sub: 1, value: 20}" in text
    (tmp_path / "robot.yaml").write_text(text, encoding="utf-8")
    assert load_robot(tmp_path / "robot.yaml").robot.drives[0].expects == scale


def report(node_id: int, **scale: tuple[Expected, ...]) -> BootReport:
    return BootReport(node_id, Identity(), STOPS_BY_NOTHING, (), scale=scale)


def test_the_boot_of_commissioning_reads_all_that_the_drive_has(monkeypatch: pytest.MonkeyPatch) -> None:
    after_power_on(monkeypatch, 0)
    monkeypatch.setattr(drive_group, "CanopenNode", partial(CanopenNode, identify=True))
    world = World()
    world.enable()
    boot = world.core._drives.nodes[0].report
    assert boot is not None
    counts = world.robot.drives[0].counts_per_motor_rev
    assert boot.scale["left_wheel"] == (
        IT_IS,
        Expected(index=0x608F, sub=1, value=counts),
        Expected(index=0x608F, sub=2, value=1),
    )


def in_rpm(monkeypatch: pytest.MonkeyPatch, objects: dict[int, Extra]) -> None:
    """All drives count in rpm; robot.yaml has 0.1rpm."""
    found = PERSONALITIES.get("generic", Personality())
    set_personality(monkeypatch, "generic", replace(found, extras=objects, target_unit="rpm", actual_unit="rpm"))


def with_unit(unit: str, *expected: Expected) -> Robot:
    base = robot(*expected)
    drives = [drive.model_dump() | {"velocity_unit": unit} for drive in base.drives]
    return Robot.model_validate(base.model_dump() | {"drives": drives})


# 60A9h = rpm, velocity_unit: 0.1rpm: 0.2 m/s commanded, 1.24 m driven
def test_a_unit_that_the_drive_reports_and_robot_yaml_contradicts_gets_no_power(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    in_rpm(monkeypatch, {key(0x60A9): Extra("I", 0x00B4_4700)})
    world = World()
    world.command = FORWARD
    assert not world.run(3.0, lambda: any(world.powered))
    problem = world.snapshot.drives[0].boot_problem
    assert "60A9h:0 = 00B44700h (SI unit velocity) of left_wheel: one bit of 60FFh and 606Ch is 1 rev/min" in problem
    assert "robot.yaml has velocity_unit: 0.1rpm, so its wheel would turn 10 times as fast as commanded" in problem
    assert "In robot.yaml, set `velocity_unit: rpm` for left_wheel" in problem
    assert "add {index: 0x60A9, sub: 0, value: 11814656} to its `expects`" in problem


def test_the_value_of_the_message_cures_it(monkeypatch: pytest.MonkeyPatch) -> None:
    in_rpm(monkeypatch, {key(0x60A9): Extra("I", 0x00B4_4700)})
    world = World(with_unit("rpm"))
    world.drive(seconds=1.0)
    assert world.truth.linear_mps == pytest.approx(FORWARD.linear_mps, rel=0.02)


def test_a_drive_that_reports_a_unit_it_does_not_use_drives_once_the_wheel_was_measured(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = PERSONALITIES.get("generic", Personality())
    set_personality(monkeypatch, "generic", replace(found, extras={key(0x60A9): Extra("I", 0x00B4_4700)}))
    World(with_unit("0.1rpm", Expected(index=0x60A9, value=0x00B4_4700))).enable()


@pytest.mark.parametrize("code", [0x0602_0000, 0x0601_0001, 0x0800_0000])
def test_a_drive_that_does_not_report_its_unit_gets_power(monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    """Whatever it aborts with; how fast it may go then is the filter's: `uncommissioned_mps`."""
    odd = {n: OddDrive(0, (Drawn("", with_manner(refused_reads={key(0x60A9): code})),)) for n in (1, 2)}
    world = World(odd=odd)
    world.enable()


# no proof: 0.08 m/s, a tenth of the limit; the drives count 10 times as much
def test_without_a_proof_a_unit_that_is_wrong_by_10_stays_within_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    in_rpm(monkeypatch, {})
    wired = bench_robot().model_copy(update={"bus": load_robot(sample("example_can0")).robot.bus})
    world = World()
    world.enable()
    world.command = Twist2D(uncommissioned_mps(wired), 0.0)
    assert world.command.linear_mps == pytest.approx(wired.limits.linear_mps / 10.0)
    fastest = 0.0
    begin_m = world.truth.travel_m
    for _ in range(1500):
        world.run(0.002)
        fastest = max(fastest, abs(world.truth.linear_mps))
    assert watchdog_cause(world) is TripCause.FEEDBACK_IMPLAUSIBLE
    assert fastest <= 1.05 * wired.limits.linear_mps, "its velocity loop swings over"
    assert world.truth.travel_m - begin_m < 0.7
    assert not any(world.powered)
