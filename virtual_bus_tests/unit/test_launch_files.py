"""What can be held of the launch files where ROS 2's launch is not installed: each name in them leads somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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
