"""Who may begin without a record of stops: simulated drives. Real ones begin latched, and need one reset."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_cli.stack import Stack
from canbase_config.load import load_robot, sample
from canbase_runtime.latch_file import PARTS, LatchFile, latch_folder
from canbase_runtime.latch_record import Defect


def started(folder: Path, monkeypatch: pytest.MonkeyPatch, robot: str, *, sim: bool) -> dict[str, Defect]:
    """What each part finds that `canbase up` of a user starts who has never started one."""
    environment = {"XDG_STATE_HOME": str(folder)}
    monkeypatch.setattr(Stack, "_spawn", lambda _stack, _part: None)
    Stack(sample(robot), sim=sim, env=environment).start()
    name = load_robot(sample(robot)).robot.name
    records = latch_folder(environment, folder, name)
    return {part: LatchFile(records, part, name).open().defect for part in PARTS}


@pytest.mark.parametrize(("robot", "sim"), [("bench", True), ("bench", False), ("example_can0", True)])
def test_simulated_drives_begin_clear(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, robot: str, sim: bool) -> None:
    """Those of `canbase up`, and any on a bus without a wire."""
    assert set(started(tmp_path, monkeypatch, robot, sim=sim).values()) == {Defect.NONE}


def test_real_drives_begin_latched_whoever_starts_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The services' records are another user's; a container has none after each start; a new name has none either."""
    assert set(started(tmp_path, monkeypatch, "example_can0", sim=False).values()) == {Defect.MISSING}
