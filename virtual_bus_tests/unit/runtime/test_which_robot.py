"""Which robot a command means: as named; else the one that runs or is installed here; else that of the folder."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_commissioning.onbus.bus_session import choose_bus
from canbase_config.load import sample
from canbase_runtime import which_robot as rule
from canbase_runtime.which_robot import Meant, NoRobotError, choose

HERE = {Path("/etc/canbase/robot.yaml"): "installed"}
TWO = {**HERE, Path("/home/me/other.yaml"): "runs here"}
LOCAL = Path("/home/me/robot.yaml")
WAIT = """
import socket, sys, time
holder = socket.socket(socket.AF_UNIX)
holder.bind("\\0" + sys.argv[1])
holder.listen()
print(flush=True)
time.sleep(60)
"""


def test_the_command_line_comes_first_then_the_environment() -> None:
    assert choose(Path("a.yaml"), "b.yaml", TWO, LOCAL, "") == Meant(Path("a.yaml"))
    assert choose(None, "b.yaml", TWO, LOCAL, "") == Meant(Path("b.yaml"), "CANBASE_ROBOT")


def test_the_robot_of_this_computer_comes_before_that_of_the_folder() -> None:
    assert choose(None, "", HERE, LOCAL, "") == Meant(Path("/etc/canbase/robot.yaml"), "installed")
    assert choose(None, "", {}, LOCAL, "") == Meant(LOCAL, "in this folder")


def test_of_several_robots_none_is_meant() -> None:
    with pytest.raises(NoRobotError, match="several robots") as caught:
        choose(None, "", TWO, LOCAL, "")
    assert "/etc/canbase/robot.yaml (installed); /home/me/other.yaml (runs here)" in str(caught.value)


def test_without_any_the_error_has_the_ways_and_why_a_file_does_not_count() -> None:
    with pytest.raises(NoRobotError, match=r"--config FILE.*CANBASE_ROBOT.*--bench"):
        choose(None, "", {}, None, "")
    with pytest.raises(NoRobotError, match=r"and /x/robot.yaml belongs to user 7"):
        choose(None, "", {}, None, "/x/robot.yaml belongs to user 7")


def test_installed_robots_are_those_with_a_list_of_files(tmp_path: Path) -> None:
    assert rule.installed(tmp_path) == {}
    (tmp_path / "installed").mkdir()
    (tmp_path / "installed/robot.txt").touch()
    (tmp_path / "installed/notes").touch()
    (tmp_path / "can1.yaml").touch()
    assert rule.installed(tmp_path) == {tmp_path / "robot.yaml": "installed"}


def test_a_folder_that_cannot_be_read_is_no_empty_one(tmp_path: Path) -> None:
    (tmp_path / "installed").touch()
    with pytest.raises(NoRobotError, match="only root and the group canbase see"):
        rule.installed(tmp_path)


@contextmanager
def holds(task: str, *words: str, cwd: Path) -> Iterator[Path]:
    """A process that has this task and these words on its command line; a table of sockets with it."""
    name = f"canbase.{task}.test:{os.getpid()}"
    command = [sys.executable, "-c", WAIT, name, "canbase_cli", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=cwd)
    try:
        assert process.stdout is not None
        process.stdout.readline()
        table = cwd / "unix"
        lines = rule.SOCKETS.read_text().splitlines()
        table.write_text("\n".join([lines[0], *(line for line in lines if name in line)]))
        yield table
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("task", ["driver", "velocity process"])
@pytest.mark.parametrize("words", [("--config", "my.yaml"), ("-c", "my.yaml"), ("--config=my.yaml",)])
def test_a_process_of_this_user_shows_its_robot(tmp_path: Path, task: str, words: tuple[str, ...]) -> None:
    (tmp_path / "my.yaml").touch()
    with holds(task, "driver", *words, cwd=tmp_path) as table:
        assert rule.running((), table) == {tmp_path / "my.yaml": "runs here"}


def test_other_tasks_show_none(tmp_path: Path) -> None:
    with holds("watchdog", "--config", "/x.yaml", cwd=tmp_path) as table:
        assert rule.running((), table) == {}
    assert rule.running((), tmp_path / "none") == {}


def test_a_robot_that_runs_and_whose_file_cannot_be_seen_is_not_overlooked(tmp_path: Path) -> None:
    with holds("driver", "driver", cwd=tmp_path) as table, pytest.raises(NoRobotError, match=r"names none\. Name the"):
        rule.running((), table)
    gone = ("--config", "gone.yaml")
    with holds("driver", "driver", *gone, cwd=tmp_path) as table, pytest.raises(NoRobotError, match="No such file"):
        rule.running((), table)


def test_in_a_container_a_file_of_that_name_is_another_one(tmp_path: Path) -> None:
    (tmp_path / "my.yaml").touch()
    seen = tmp_path / "proc" / "7" / "root" / (tmp_path / "my.yaml").relative_to("/")
    seen.parent.mkdir(parents=True)
    seen.touch()
    assert "sees another" in rule._elsewhere(tmp_path / "my.yaml", tmp_path / "proc" / "7")
    seen.unlink()
    seen.hardlink_to(tmp_path / "my.yaml")
    assert rule._elsewhere(tmp_path / "my.yaml", tmp_path / "proc" / "7") == ""


def test_the_services_of_an_installed_robot_name_it_to_everybody(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their executable is seen by root and their own user alone."""
    monkeypatch.setattr("canbase_runtime.own_process.refusal", lambda *_words: "cannot be checked")
    installed = tmp_path / "robot.yaml"
    with holds("driver", "driver", "--config", str(installed), cwd=tmp_path) as table:
        assert rule.running({installed: "installed"}, table) == {installed: "runs here"}
        with pytest.raises(NoRobotError, match="cannot be checked"):
            rule.running((), table)


def test_a_name_that_another_user_has_bound_is_no_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with holds("driver", "driver", "--config", "/x.yaml", cwd=tmp_path) as table:
        monkeypatch.setattr(rule, "_users", lambda: {os.geteuid() + 1})
        assert rule.running((), table) == {}
        monkeypatch.setenv("SUDO_UID", str(os.geteuid()))
        with pytest.raises(NoRobotError, match=f"belongs to user {os.geteuid()}"):
            rule.running((), table)


def test_a_socket_that_takes_no_call_belongs_to_a_robot_that_cannot_be_seen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_address: str) -> None:
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(rule, "holder_at", full)
    with holds("driver", "driver", cwd=tmp_path) as table, pytest.raises(NoRobotError, match="temporarily unavailable"):
        rule.running((), table)


def test_a_socket_whose_process_has_ended_shows_none(tmp_path: Path) -> None:
    with holds("driver", "--config", "/x.yaml", cwd=tmp_path) as table:
        pass
    assert rule.running((), table) == {}


def test_a_robot_yaml_of_this_user_alone_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "robot.yaml"
    assert rule.in_folder(path) == (None, "")
    path.touch(0o644)
    assert rule.in_folder(path) == (path, "")
    for changed, mode in ((path, 0o646), (tmp_path, 0o777)):
        before = changed.stat().st_mode
        changed.chmod(mode)
        assert rule.in_folder(path) == (None, f"others may write {path} or its folder")
        changed.chmod(before)
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert rule.in_folder(path) == (None, f"{path} belongs to user {path.stat().st_uid}")


def test_a_link_to_a_robot_yaml_does_not_count(tmp_path: Path) -> None:
    (tmp_path / "other.yaml").touch()
    (tmp_path / "robot.yaml").symlink_to("other.yaml")
    assert rule.in_folder(tmp_path / "robot.yaml") == (None, f"{tmp_path / 'robot.yaml'} is no regular file")


@pytest.mark.parametrize("component", ["driver", "velocity", "action-server", "watchdog", "sim"])
def test_a_component_runs_for_no_robot_that_only_is_here(component: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CANBASE_ROBOT")
    monkeypatch.setattr(rule, "which_robot", lambda given: Meant(sample("bench"), "installed"))
    found = CliRunner().invoke(app, ["serve", component])
    assert (found.exit_code, found.stdout) == (2, "")
    assert found.stderr.startswith("canbase: name the robot: --config FILE, or CANBASE_ROBOT=FILE.")


def test_without_a_bus_on_the_line_a_tool_has_the_bus_and_the_robot_that_are_meant() -> None:
    bus, robot = choose_bus(None, None, None, None)
    assert robot is not None
    assert (robot.name, robot.bus) == ("bench", bus)
    assert choose_bus(None, None, "can3", None)[1] is None
    bus, robot = choose_bus(sample("example_can0"), None, "can3", None)
    assert (bus.channel, robot and robot.name) == ("can3", "example")


def test_a_command_names_the_robot_that_it_means(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = sample("bench")
    named = CliRunner().invoke(app, ["print", "urdf", "--config", str(bench)])
    assert (named.exit_code, named.stderr) == (0, "")
    meant = CliRunner().invoke(app, ["print", "urdf"])
    assert (meant.exit_code, meant.stdout) == (0, named.stdout)
    assert meant.stderr == f"robot bench: {bench} (CANBASE_ROBOT)\n"
    monkeypatch.delenv("CANBASE_ROBOT")
    monkeypatch.setattr(rule, "which_robot", lambda given: choose(given, "", {}, None, ""))
    none = CliRunner().invoke(app, ["print", "urdf"])
    assert (none.exit_code, none.stdout) == (2, "")
    assert none.stderr.startswith(
        "canbase: no robot is named, and none of this user runs or is installed here. Name the robot: --config FILE"
    )


def test_the_bench_is_named_once(tmp_path: Path) -> None:
    both = CliRunner().invoke(app, ["inject", "node1", "heal", "--bench", "--config", str(sample("bench"))])
    assert both.exit_code == 2
    assert "give --config or --bench, not both" in both.output
