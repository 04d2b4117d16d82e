"""`canbase setup install` begins with clear records of stops, for a robot that never had any."""

from __future__ import annotations

import itertools
import os
import pwd
import signal
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import pytest

from canbase_base.latch_file import LatchFile
from canbase_base.latch_folder import PARTS, SUFFIX
from canbase_deploy.actions import FirstRecords
from canbase_deploy.execute import Executor, as_user, first_records
from canbase_deploy.plan import install_plan
from support.install_plans import request

TRIES = 200
NOBODY = pwd.getpwnam("nobody")
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


# the user `nobody` owns the folder ── sees root make one in it ── moves it away, and puts links to root's file there
@pytest.mark.needs_root("make records for another user")
def test_a_user_who_replaces_what_is_made_in_his_folder_is_given_no_file_of_root(tmp_path: Path) -> None:
    for parent in (tmp_path, *tmp_path.parents):
        parent.chmod(parent.stat().st_mode | 0o011)
    victim, home = tmp_path / "victim", tmp_path / "lib"
    victim.write_text("root's")
    home.mkdir()
    os.chown(home, NOBODY.pw_uid, NOBODY.pw_gid)
    attacker = os.fork()
    if attacker == 0:
        try:
            replace_all(home, victim)
        finally:  # no second pytest
            os._exit(1)
    try:
        for number in range(TRIES):
            with suppress(OSError):  # he may break his own records
                first_records(home / f"robot{number}", "carl", NOBODY.pw_name)
    finally:
        os.kill(attacker, signal.SIGKILL)
        os.waitpid(attacker, 0)
    assert (victim.stat().st_uid, victim.stat().st_gid, victim.read_text()) == (0, 0, "root's")
    assert list(home.glob("taken*")), "he was never fast enough"


def replace_all(home: Path, victim: Path) -> NoReturn:
    """As nobody, for ever: a folder that appears becomes one whose files are links to `victim`."""
    os.setgid(NOBODY.pw_gid)
    os.setuid(NOBODY.pw_uid)
    for number in itertools.count():
        for name in [name for name in os.listdir(home) if name.startswith(".")]:
            with suppress(OSError):
                os.rename(home / name, home / f"taken{number}")
                os.mkdir(home / name)
                for part in PARTS:
                    os.symlink(victim, home / name / f"{part}{SUFFIX}")
    raise AssertionError


@pytest.mark.needs_root("make records for another user")
def test_the_records_belong_to_the_user_who_made_them(tmp_path: Path) -> None:
    for parent in (tmp_path, *tmp_path.parents):
        parent.chmod(parent.stat().st_mode | 0o011)
    folder = tmp_path / "lib" / "robot"
    assert first_records(folder, "carl", NOBODY.pw_name)
    owned = [folder.parent, folder, *folder.iterdir()]
    assert len(owned) == 2 + len(PARTS)
    assert {path.stat().st_uid for path in owned} == {NOBODY.pw_uid}


def test_what_that_user_may_not_do_is_reported_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "lib").write_text("no folder")
    with pytest.raises(NotADirectoryError, match=r"Not a directory: .*/lib"):
        first_records(tmp_path / "lib" / "robot", "carl", ME)


def test_a_defect_in_the_process_of_that_user_is_no_success() -> None:
    def broken() -> bool:
        raise MemoryError("no room")

    with pytest.raises(OSError, match="MemoryError: no room"):
        as_user(pwd.getpwnam(ME), broken)
    with pytest.raises(OSError, match="has died"):
        as_user(pwd.getpwnam(ME), lambda: os._exit(3))


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
