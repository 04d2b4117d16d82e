"""The programs of docs/actions.md drive a whole robot: in Python, and in C++ where rclcpp is installed."""

from __future__ import annotations

import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from ament_index_python.packages import PackageNotFoundError, get_package_prefix

from ros.conftest import Spawn
from support.running_robot import RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(400)]

PAGE = Path(__file__).parents[2] / "docs" / "actions.md"
MOST_LINES = 40
BUILD_S = 300.0


def program(name: str) -> str:
    """The block below the mark `<!-- program: name -->`."""
    (block,) = re.findall(rf"<!-- program: {re.escape(name)} -->\n```\w+\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    assert len(block.splitlines()) <= MOST_LINES
    return str(block)


def has_rclcpp() -> bool:
    try:
        get_package_prefix("rclcpp_action")
    except (PackageNotFoundError, OSError):  # OSError: ROS 2 from PyPI, without AMENT_PREFIX_PATH
        return False
    return shutil.which("cmake") is not None


@pytest.fixture(scope="module")
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain) as robot:
        yield robot


@pytest.fixture(scope="module")
def in_python(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    file = tmp_path_factory.mktemp("python") / "errand.py"
    file.write_text(program(file.name), encoding="utf-8")
    return [sys.executable, str(file)]


@pytest.fixture(scope="module")
def in_cpp(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("cpp")
    for name in ("errand.cpp", "CMakeLists.txt"):
        (folder / name).write_text(program(name), encoding="utf-8")
    (folder / "package.xml").write_text(
        '<package format="3"><name>errand</name><version>0.0.0</version><description>x</description>'
        '<maintainer email="x@example.org">x</maintainer><license>Apache-2.0</license></package>'
    )
    build = folder / "build"
    for command in (["cmake", "-S", str(folder), "-B", str(build)], ["cmake", "--build", str(build)]):
        subprocess.run(command, check=True, timeout=BUILD_S)
    return [str(build / "errand")]


CPP = pytest.param("in_cpp", marks=pytest.mark.skipif(not has_rclcpp(), reason="rclcpp_action is not installed"))


@pytest.mark.parametrize("language", ["in_python", CPP])
def test_the_program_drives_its_distance_and_reports_a_rejection_and_a_cancel(
    robot: RunningRobot, language: str, request: pytest.FixtureRequest, spawn: Spawn
) -> None:
    argv: list[str] = request.getfixturevalue(language)

    start_m = robot.truth().travel_m
    there = spawn([*argv, "0.4"], robot.env)
    assert robot.exit_code(there) == 0, there.log()
    assert "m left" in there.log()
    assert "at standstill" in there.log()
    assert robot.truth().travel_m - start_m == pytest.approx(0.4, abs=0.01)

    start_m = robot.truth().travel_m
    far = spawn([*argv, "100"], robot.env)
    assert robot.exit_code(far) != 0
    assert "reject" in far.log().lower()
    assert robot.truth().travel_m - start_m < RESTS_M

    canceled = spawn([*argv, "3.0"], robot.env)
    robot.wait_speed(0.2)
    canceled.interrupt()
    assert robot.exit_code(canceled) not in (0, -signal.SIGINT), canceled.log()
    assert robot.moved_since(time.monotonic(), 0.5) < RESTS_M
    assert robot.truth().travel_m - start_m < 2.5
