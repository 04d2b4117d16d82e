"""What can be held of the launch files where ROS 2's launch is not installed: each name in them leads somewhere."""

from __future__ import annotations

import os
import re
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

import pytest

ROOT = Path(__file__).parents[3]
NODE = ROOT / "deploy" / "bin" / "node"
LAUNCH = sorted((ROOT / "deploy" / "launch").glob("*.launch.py"))
INSTALLED = re.search(r"foreach\(_node ([a-z_ ]+)\)", (ROOT / "CMakeLists.txt").read_text())


def test_robot_launch_starts_only_executables_that_are_installed() -> None:
    assert INSTALLED is not None
    started = re.findall(r'_part\(\s*"([a-z_]+)"', (ROOT / "deploy/launch/robot.launch.py").read_text())
    assert sorted(started) == sorted(INSTALLED[1].split())


@pytest.mark.parametrize("path", LAUNCH, ids=lambda path: path.name)
def test_launch_files_are_python(path: Path) -> None:
    compile(path.read_text(), path.name, "exec")


@pytest.mark.parametrize(
    ("name", "word"),
    [
        ("motor_driver", "--autostart"),
        ("velocity_mux", "safety filter"),
        ("drive_distance_server", "drive_distance"),
        ("watchdog", "stops the drives"),
        ("sim", "simulated drives"),
    ],
)
def test_each_executable_is_its_part(tmp_path: Path, name: str, word: str) -> None:
    executable = tmp_path / name
    executable.symlink_to(NODE)
    shown = subprocess.run([sys.executable, executable, "--help"], capture_output=True, text=True, check=True)
    assert word in shown.stdout


def test_a_launch_file_needs_nothing_but_what_ros2_launch_has() -> None:
    """Its Python is that of ROS 2, not the environment with our libraries: canbase_config itself, without a module."""
    imported = {
        name for path in LAUNCH for name in re.findall(r"^(?:from|import) (\S+)", path.read_text(), re.MULTILINE)
    }
    strangers = {name.partition(".")[0] for name in imported} - sys.stdlib_module_names
    assert strangers == {"launch", "launch_ros"}


def test_the_end_of_the_driver_ends_the_watchdog_which_ctrl_c_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """So the watchdog sees the base stop, and latches nothing. After 15 s launch sends SIGTERM to all."""
    names = ("", ".actions", ".conditions", ".event_handlers", ".events", ".events.process", ".substitutions")
    parts = {name: MagicMock() for name in (*(f"launch{name}" for name in names), "launch_ros", "launch_ros.actions")}
    for name, part in parts.items():
        monkeypatch.setitem(sys.modules, name, part)
    made: dict[str, MagicMock] = {}
    node = parts["launch_ros.actions"].Node
    node.side_effect = lambda **options: made.setdefault(options["executable"], MagicMock(options=options))

    runpy.run_path(str(ROOT / "deploy/launch/robot.launch.py"))["generate_launch_description"]()

    parts["launch.events"].matches_action.assert_called_once_with(made["watchdog"])
    matches = parts["launch.events"].matches_action.return_value
    end = parts["launch.events.process"].SignalProcess
    end.assert_called_once_with(signal_number=signal.SIGTERM, process_matcher=matches)
    emit = parts["launch.actions"].EmitEvent
    emit.assert_called_once_with(event=end.return_value)
    assert made["motor_driver"].options["on_exit"][0] is emit.return_value


PROJECT = """
cmake_minimum_required(VERSION 3.20)
project(alone NONE)
set(Python3_EXECUTABLE "/opt/venv/bin/python3")
{function}
{calls}
"""
"""What CMakeLists.txt does with programs, without ROS and colcon."""


@pytest.mark.parametrize(
    ("by", "first_line"), [("colcon", "#!/opt/venv/bin/python3"), ("pip", "#!/usr/bin/env python3")]
)
def test_a_program_of_colcon_names_the_python_of_its_build(tmp_path: Path, by: str, first_line: str) -> None:
    """`ros2 run` starts it where nobody has activated the environment with our libraries. pip may build elsewhere."""
    text = (ROOT / "CMakeLists.txt").read_text()
    function = re.search(r"^function\(canbase_install_program.*?^endfunction\(\)", text, re.MULTILINE | re.DOTALL)
    assert function is not None
    calls = "canbase_install_program(node lib/canbase sim)\ncanbase_install_program(canbase bin canbase)"
    (tmp_path / "CMakeLists.txt").write_text(PROJECT.format(function=function[0], calls=calls))
    for name in ("node", "canbase"):
        (tmp_path / name).write_bytes((ROOT / "deploy" / "bin" / name).read_bytes())

    made, installed = tmp_path / "made", tmp_path / "installed"
    subprocess.run(["cmake", "-S", tmp_path, "-B", made, f"-DSKBUILD={by == 'pip'}"], check=True, capture_output=True)
    subprocess.run(["cmake", "--install", made, "--prefix", installed], check=True, capture_output=True)

    for name, source in {"lib/canbase/sim": "node", "bin/canbase": "canbase"}.items():
        lines = (installed / name).read_text().splitlines()
        assert lines == [first_line, *(tmp_path / source).read_text().splitlines()[1:]]
        assert os.access(installed / name, os.X_OK)
