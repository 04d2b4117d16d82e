"""Who may begin without a record of stops: simulated drives. Real ones begin latched, and need one reset."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from canbase_base.latch_file import LatchFile
from canbase_base.latch_folder import PARTS, latch_folder
from canbase_base.latch_record import Defect
from canbase_cli.main import app
from canbase_cli.services import clear_first_records
from canbase_config.load import load_robot, sample


def started(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str, *, simulated: bool) -> set[Defect]:
    """What the parts find that a user starts who has never started one."""
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    clear_first_records(load_robot(sample(name)).robot, simulated=simulated)
    return found(folder, name)


def found(folder: Path, name: str) -> set[Defect]:
    robot = load_robot(sample(name)).robot.name
    records = latch_folder({"XDG_STATE_HOME": str(folder)}, folder, robot)
    return {LatchFile(records, part, robot).open().defect for part in PARTS}


@pytest.mark.parametrize(("robot", "sim"), [("bench", True), ("bench", False), ("example_can0", True)])
def test_simulated_drives_begin_clear(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, robot: str, sim: bool) -> None:
    """Those of `canbase up`, and any on a bus without a wire."""
    assert started(tmp_path, monkeypatch, robot, simulated=sim) == {Defect.NONE}


def test_real_drives_begin_latched_whoever_starts_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The services' records are another user's; a container has none after each start; a new name has none either."""
    assert started(tmp_path, monkeypatch, "example_can0", simulated=False) == {Defect.MISSING}


@pytest.mark.parametrize(("name", "defect"), [("bench", Defect.NONE), ("example_can0", Defect.MISSING)])
@pytest.mark.parametrize(("part", "last"), [("driver", "_claim"), ("watchdog", "leave_stop_file")])
def test_a_part_that_is_started_alone_or_by_a_launch_file_follows_the_same_rule(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, defect: Defect, part: str, last: str
) -> None:
    def end(*_: object) -> None:
        raise typer.Exit(3)

    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(f"canbase_cli.services.{last}", end)
    assert CliRunner().invoke(app, ["serve", part, "--config", str(sample(name))]).exit_code == 3
    assert found(tmp_path, name) == {defect}
