"""`canbase install` begins with clear records of stops, for a robot that never had any."""

from __future__ import annotations

import os
import pwd
from pathlib import Path

from canbase_deploy.actions import FirstRecords
from canbase_deploy.execute import Executor, first_records
from canbase_deploy.plan import install_plan
from canbase_runtime.latch_file import PARTS, LatchFile
from support.install_plans import request

ME = pwd.getpwuid(os.geteuid()).pw_name


def test_the_plan_makes_them_for_the_services_user_before_any_unit_is_written() -> None:
    plan = install_plan(request(), {})
    action = next(action for action in plan if isinstance(action, FirstRecords))
    assert str(action.folder) == f"/var/lib/canbase/{request().name}"
    assert (action.robot, action.user) == (request().robot.name, "canbase")


def test_clear_and_of_that_user(tmp_path: Path) -> None:
    folder = tmp_path / "lib" / "robot"
    first_records(folder, "carl", ME)
    assert all(not LatchFile(folder, part, "carl").open().latched for part in PARTS)
    assert folder.parent.stat().st_uid == os.geteuid()


def test_a_stop_is_never_forgotten_by_an_upgrade(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    first_records(folder, "carl", ME)
    (folder / "driver.latch").write_bytes(b"anything")
    first_records(folder, "carl", ME)
    assert LatchFile(folder, "driver", "carl").open().latched


def test_below_a_prefix_there_are_none_for_they_are_this_computers(tmp_path: Path) -> None:
    said: list[str] = []
    action = next(action for action in install_plan(request(), {}) if isinstance(action, FirstRecords))
    Executor(tmp_path, said.append).carry_out([action])
    assert (said, list(tmp_path.iterdir())) == ([], [])
