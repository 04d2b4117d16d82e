"""The aggregator's parameters of a robot.yaml: every entry of /diagnostics is in one group, and none is missed."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from ruamel.yaml import YAML
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.aggregator import parameter_file, parameters
from canbase_config.diagnostics import PERIOD_S, TIMEOUT_S, entry_names, hardware_id
from canbase_config.drive import Identity
from canbase_config.load import load_robot, sample, samples
from canbase_config.robot import Robot
from canbase_driver.ros.diagnostics import diagnostics_message
from canbase_velocity import filter_diagnostics, mux_messages
from canbase_velocity.decision import PASSED, Decision
from canbase_velocity.mux import Mux
from canbase_velocity.twist import ZERO
from support.aggregator_stand_in import ERROR, OK, STALE, WARN, Aggregator
from support.filter_inputs import given_that
from support.snapshots import LEFT, SNAPSHOT

FILE = Path(__file__).parents[3] / "deploy" / "diagnostics" / "aggregator.yaml"
BENCH = load_robot(sample("bench")).robot
STAMP = Time(sec=1_700_000_000)


def published(robot: Robot) -> list[DiagnosticStatus]:
    """What the three nodes of a healthy robot publish in one second."""
    drives = [
        dataclasses.replace(LEFT, joint=drive.joint, node_id=drive.node_id, axis=drive.axis) for drive in robot.drives
    ]
    snapshot = dataclasses.replace(SNAPSHOT, drives=tuple(drives))
    mux = Mux(robot.mux.sources, robot.mux.locks, foreign_lock=False, status_timeout_s=1.0)
    decision = Decision(PASSED.action, PASSED.cause, "", "", ZERO)
    return [
        *diagnostics_message(snapshot, STAMP, robot=robot.name).status,
        *mux_messages.diagnostics(mux.decide(0.0), robot.name, (), STAMP).status,
        *filter_diagnostics.diagnostics(decision, given_that(), robot.name, 0, 0, STAMP).status,
    ]


@pytest.mark.parametrize("name", samples())
def test_every_entry_of_every_sample_is_in_exactly_one_group(name: str) -> None:
    robot = load_robot(sample(name)).robot
    aggregator = Aggregator(parameters(robot))
    aggregator.take(published(robot), 1.0)
    assert aggregator.other == []
    assert len(aggregator.paths()) == len(published(robot)) == len(entry_names(robot))
    assert {status.name for status in published(robot)} == set(entry_names(robot))


def test_an_aggregator_shows_the_parts_by_short_names_below_their_groups() -> None:
    aggregator = Aggregator(parameters(BENCH))
    assert sorted(aggregator.paths()) == [
        "/canbase/bench/Driver/bus",
        "/canbase/bench/Driver/motor_driver",
        "/canbase/bench/Drives/left_wheel",
        "/canbase/bench/Drives/right_wheel",
        "/canbase/bench/Safety/safety_filter",
        "/canbase/bench/Safety/velocity_mux",
        "/canbase/bench/Safety/watchdog",
    ]


def test_what_never_comes_or_no_longer_comes_makes_its_group_an_error() -> None:
    """1.0 s: all but the filter; 7.0 s: the driver's process has died, the mux goes on."""
    aggregator = Aggregator(parameters(BENCH))
    drives, driver, safety = (f"/canbase/bench/{group}" for group in ("Drives", "Driver", "Safety"))
    assert set(aggregator.levels(0.0).values()) == {STALE}
    entries = [entry for entry in published(BENCH) if "safety_filter" not in entry.name]
    aggregator.take(entries, 1.0)
    assert aggregator.levels(1.0) == {drives: OK, driver: OK, safety: ERROR}
    aggregator.take(published(BENCH), 2.0)
    assert aggregator.levels(2.0)[safety] == OK
    aggregator.take([entry for entry in entries if "mux" in entry.name], 7.5)
    assert aggregator.levels(7.5) == {drives: STALE, driver: STALE, safety: ERROR}


def test_one_lost_message_is_no_error() -> None:
    assert TIMEOUT_S >= 3 * PERIOD_S


def test_two_robots_with_similar_names_share_one_aggregator() -> None:
    first, second = (BENCH.model_copy(update={"name": name}) for name in ("r1", "r11"))
    keys = parameters(first)
    keys["analyzers"]["ros__parameters"].update(parameters(second)["analyzers"]["ros__parameters"])
    aggregator = Aggregator(keys)
    aggregator.take([*published(first), *published(second)], 1.0)
    assert aggregator.other == []
    assert len(set(aggregator.paths())) == len(aggregator.paths()) == 2 * len(entry_names(BENCH))


def test_a_warning_of_one_drive_is_the_level_of_its_group() -> None:
    aggregator = Aggregator(parameters(BENCH))
    entries = published(BENCH)
    next(entry for entry in entries if "left" in entry.name).level = DiagnosticStatus.WARN
    aggregator.take(entries, 1.0)
    assert aggregator.levels(1.0)["/canbase/bench/Drives"] == WARN


def test_the_file_in_deploy_is_that_of_the_bench() -> None:
    assert FILE.read_text(encoding="utf-8") == parameter_file(BENCH)
    assert YAML(typ="safe").load(FILE) == parameters(BENCH)
    assert "&" not in FILE.read_text(encoding="utf-8")  # rcl reads no aliases


def test_the_command_prints_it() -> None:
    done = CliRunner().invoke(app, ["print", "aggregator", str(sample("bench"))])
    assert (done.exit_code, done.stdout) == (0, parameter_file(BENCH))


def test_a_hardware_id_is_the_device_where_its_serial_number_is_known_and_else_its_place() -> None:
    drive: Any = BENCH.drives[1]
    assert hardware_id("bench", drive.model_copy(update={"identity": Identity()})) == "bench node 2 axis 0"
    some = Identity(vendor_id=0x2E1, product_code=0x1001)
    assert hardware_id("bench", drive.model_copy(update={"identity": some})) == "bench node 2 axis 0"
    full = some.model_copy(update={"serial": 0xBEEF})
    known = drive.model_copy(update={"identity": full})
    assert hardware_id("bench", known) == "000002E1:00001001:0000BEEF axis 0"
    moved = known.model_copy(update={"node_id": 9})
    assert hardware_id("other", moved) == hardware_id("bench", known)
