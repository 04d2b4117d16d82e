"""The hash of a configuration: the same robot has it everywhere, and another one never."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_config.commissioned import mark
from canbase_config.fingerprint import configuration_sha256
from canbase_config.load import load_robot
from canbase_config.profile_file import profile_path
from canbase_config.robot import Robot
from support.robot_files import GOOD, LAST_LINE, write


def sha256_of(folder: Path, changes: dict[int, str] | None = None) -> str:
    folder.mkdir(exist_ok=True)
    return configuration_sha256(load_robot(write(folder, changes or {})).robot)


def number(line: str) -> int:
    return GOOD.splitlines().index(line) + 1


def with_own_profile(folder: Path, more: str = "") -> str:
    folder.mkdir()
    text = profile_path("generic").read_text(encoding="utf-8")
    (folder / "own.yaml").write_text(text + more, encoding="utf-8")
    changes = {number(f"    node_id: {n}"): f"    node_id: {n}\n    profile: own.yaml" for n in (1, 2)}
    return sha256_of(folder, changes)


def test_it_does_not_depend_on_where_the_file_and_its_profiles_lie(tmp_path: Path) -> None:
    assert with_own_profile(tmp_path / "laptop") == with_own_profile(tmp_path / "robot")


def test_a_file_of_ones_own_with_the_same_contents_is_the_same_kind_of_drive(tmp_path: Path) -> None:
    assert with_own_profile(tmp_path / "own") == sha256_of(tmp_path / "canbase")


def test_files_of_one_computer_change_nothing(tmp_path: Path) -> None:
    moved = {LAST_LINE: "  socket: $XDG_RUNTIME_DIR/lease.sock\nblack_box:\n  folder: /var/lib/here"}
    assert sha256_of(tmp_path / "a", moved) == sha256_of(tmp_path / "b")


def test_what_canbase_commission_writes_about_itself_changes_nothing(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, {})).robot
    values = robot.model_dump()
    values["commissioned"] = {"directions": mark(robot, "directions")}
    values["drives"] = [{**drive, "identity": {"vendor_id": 1, "serial": 7}} for drive in values["drives"]]
    assert configuration_sha256(Robot.model_validate(values)) == configuration_sha256(robot)


@pytest.mark.parametrize(
    ("line", "changed"),
    [
        ("  wheel_radius_m: 0.1", "  wheel_radius_m: 0.11"),
        ("  deceleration_mps2: 1.0", "  deceleration_mps2: 1.1"),
        ("    side: left", "    side: left\n    direction: -1"),
        ("    required: false", "    required: true"),
    ],
)
def test_any_other_value_makes_another_configuration(tmp_path: Path, line: str, changed: str) -> None:
    assert sha256_of(tmp_path / "a", {number(line): changed}) != sha256_of(tmp_path / "b")


def test_another_value_in_the_profile_of_a_drive_makes_another_configuration(tmp_path: Path) -> None:
    assert with_own_profile(tmp_path / "a", "\nstart: {settle_s: 1.5}\n") != with_own_profile(tmp_path / "b")
