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
    with pytest.raises(NoRobotError, match="whether a robot is installed cannot be seen"):
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
    with holds(task, "driver", *words, cwd=tmp_path) as table:
        assert rule.running(table) == {tmp_path / "my.yaml": "runs here"}


def test_other_tasks_and_processes_without_a_file_show_none(tmp_path: Path) -> None:
    with holds("driver", "driver", cwd=tmp_path) as table:
        assert rule.running(table) == {}
    with holds("watchdog", "--config", "/x.yaml", cwd=tmp_path) as table:
        assert rule.running(table) == {}
    assert rule.running(tmp_path / "none") == {}


def test_a_process_that_is_not_canbase_shows_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Anybody may bind the socket's name first, and write what he likes on his command line."""
    with holds("driver", "--config", "/x.yaml", cwd=tmp_path) as table:
        monkeypatch.setattr(rule, "_users", lambda: {os.geteuid() + 1})
        assert rule.running(table) == {}


def test_a_socket_whose_process_has_ended_shows_none(tmp_path: Path) -> None:
    with holds("driver", "--config", "/x.yaml", cwd=tmp_path) as table:
        pass
    assert rule.running(table) == {}


def test_a_robot_yaml_of_another_user_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "robot.yaml"
    assert rule.in_folder(path) == (None, "")
    path.touch()
    assert rule.in_folder(path) == (path, "")
    monkeypatch.setattr(os, "geteuid", lambda: path.stat().st_uid + 1)
    assert rule.in_folder(path) == (None, f"{path} belongs to user {path.stat().st_uid}")


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
    assert none.stderr.startswith("canbase: no robot is named, runs or is installed here. Name one: --config FILE")


def test_the_bench_is_named_once(tmp_path: Path) -> None:
    both = CliRunner().invoke(app, ["inject", "node1", "heal", "--bench", "--config", str(sample("bench"))])
    assert both.exit_code == 2
    assert "give --config or --bench, not both" in both.output
