"""`canbase bus scan` as a command before simulated drives, in virtual time. On a bus: bus/test_adopt_command.py."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from canbase_commissioning.onbus.scan_command import _print
from canbase_commissioning.scan_rows import ScanRow
from support.command_world import CommandWorld, canbase


def test_it_finds_both_drives_and_says_what_they_are(world: CommandWorld) -> None:
    done = world.canbase("bus", "scan", "--seconds", "0.3", "--json")
    table = world.canbase("bus", "scan", "--seconds", "0.3")
    assert done.exit_code == 0, done.stderr
    rows = json.loads(done.stdout)
    assert [(row["node_id"], row["profile"], row["in_robot"]) for row in rows] == [
        (1, "generic", "left_wheel"),
        (2, "generic", "right_wheel"),
    ]
    assert rows[0]["heartbeat"] == "off (1017h = 0)"
    assert "node 1, 2: answers SDO and sends nothing; its heartbeat is off (1017h = 0)" in done.stderr
    assert "canbase simulated drive" in table.stdout
    assert "\x1b[" not in table.stdout


def test_eighty_columns_break_no_name(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    what, state = "canbase simulated drive (CiA 402 drive)", "pre-operational"
    joints = "front_right_wheel, rear_right_wheel"
    _print([ScanRow(2, what, state, "100 ms", "maxon_epos4", 0xFB, 0x61500000, 0x1700000, 7, "", joints)], False)
    words = capsys.readouterr().out.split()
    assert {state, "maxon_epos4", "front_right_wheel", "rear_right_wheel"} <= set(words)


def test_two_drives_with_one_node_id_are_named_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world = CommandWorld(tmp_path, monkeypatch, factory_fresh=True)
    robot_yaml = world.config.read_text(encoding="utf-8")
    world.config.write_text(robot_yaml.replace("\nbus:\n", "\nbus:\n  bitrate: 125000\n"), encoding="utf-8")
    done = world.canbase("bus", "scan", "--seconds", "0.3", "--json")
    assert done.exit_code == 1
    assert "node 1: two drives or more answer. canbase bus adopt gives each drive a separate node id" in done.stderr
    row = json.loads(done.stdout)[0]
    assert (row["node_id"], row["serial"]) == (1, None)


def test_a_drive_of_robot_yaml_that_does_not_answer_is_1_and_its_node_is_named(world: CommandWorld) -> None:
    world.suffer(2, "cut")
    done = world.canbase("bus", "scan", "--seconds", "0.3")
    assert done.exit_code == 1
    assert "node 2 of robot.yaml is not on the bus" in done.stderr


def test_where_another_master_speaks_it_only_listens_unless_told_otherwise(world: CommandWorld) -> None:
    world.repeat(0x080, b"", 0.02)
    quiet = world.canbase("bus", "scan", "--seconds", "0.3", "--json")
    assert world.said == []
    assert "another master is on this bus:\n  SYNC" in quiet.stderr
    assert "use --yes to read anyway" in quiet.stderr
    assert [row["vendor_id"] for row in json.loads(quiet.stdout)] == [None, None]
    asking = world.canbase("bus", "scan", "--seconds", "0.3", "--json", "--yes")
    assert asking.exit_code == 0
    assert [row["profile"] for row in json.loads(asking.stdout)] == ["generic", "generic"]


def test_a_bus_that_cannot_be_opened_is_1_with_advice() -> None:
    done = canbase("bus", "scan", "--channel", "can77")
    assert done.exit_code == 1
    assert "the CAN bus socketcan can77 cannot be opened" in done.stderr
    assert "ip -details link show" in done.stderr or "This Linux has no SocketCAN" in done.stderr


def test_an_empty_bus_is_1(world: CommandWorld) -> None:
    for node_id in (1, 2):
        world.suffer(node_id, "silent")
    done = world.canbase("bus", "scan", "--seconds", "0.1")
    assert done.exit_code == 1
    assert "do the simulated drives run" in done.stderr


def test_help_has_examples() -> None:
    done = canbase("bus", "scan", "--help")
    assert done.exit_code == 0
    assert "canbase bus scan --channel can0" in done.stdout
