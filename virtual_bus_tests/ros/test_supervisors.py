"""Driver and watchdog are killed at once, as by the kernel when memory is short, on drives without a stop of their own.

speed 0.3 ───────╮ SIGKILL of driver and watchdog
      0          ╰── standstill: stop frames of a separate process, whoever started the two
                 │←→│ by the simulator's ground truth
"""

from __future__ import annotations

import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import pytest

from canbase_base.latch_file import create_first
from canbase_base.latch_folder import latch_folder
from canbase_cli.services import SERVICES
from canbase_sim.control import control_path
from canbase_sim.personality import PERSONALITIES
from support.crews import robot_with
from support.ros_harness import Process
from support.running_robot import CANBASE, PATIENT, RESTS_M, RunningRobot, own_domain, robot_on

pytestmark = [pytest.mark.ros, pytest.mark.timeout(150)]

ROOT = Path(__file__).parents[2]
KIND: Final = "tmcm1636"
DRIVES = [drive.model_dump(exclude_none=True) for drive in robot_with(KIND).drives]
SPEED_MPS = 0.3
PARTS = tuple(service for service in SERVICES if service != "sim")
STOP_S = 1.0
"""From the kill to the first quick stop: 0.03 s of a process that waits for it; with systemd a Python has to start."""
LATE_S = 0.5
"""A processor that others use."""


class Started:
    """Processes of a test; ended with it."""

    def __init__(self, robot: RunningRobot) -> None:
        self.robot = robot
        self._processes: list[Process] = []

    def run(self, name: str, *words: str | Path, **environment: str) -> Process:
        log = self.robot.folder / f"{name}.log"
        self._processes.append(Process([str(word) for word in words], log, self.robot.env | environment))
        return self._processes[-1]

    def close(self) -> None:
        for process in self._processes:
            process.close()


def up(started: Started) -> None:
    started.run("up", *CANBASE, "up", "--no-sim", "--config", started.robot.config)


def container(started: Started) -> None:
    """`canbase up` as process 1, whose end ends every other process of the container."""
    start = ("unshare", "--map-root-user", "--fork", "--pid", "--mount-proc", "--kill-child")
    if subprocess.run([*start, "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this computer gives no user a PID namespace")
    started.run("up", *start, *CANBASE, "up", "--no-sim", "--config", started.robot.config)


def launch(started: Started) -> None:
    """As robot.launch.py and ros2 run start the executables; those of the launch file end with the process that did."""
    for name in re.findall(r'_part\(\s*"([a-z_]+)"', (ROOT / "deploy/launch/robot.launch.py").read_text()):
        if name == "sim":
            continue
        executable = started.robot.folder / name
        executable.symlink_to(ROOT / "deploy" / "bin" / "node")
        started.run(name, sys.executable, executable, "--config", started.robot.config, CANBASE_PARENT=str(os.getpid()))


def by_hand(started: Started) -> None:
    for part in PARTS:
        started.run(part, *CANBASE, part, "--config", started.robot.config)


def systemd(started: Started) -> None:
    """ExecStart of each unit, and after its end ExecStopPost, whatever ended it."""
    for part in PARTS:
        process = started.run(part, *unit_command(started.robot, part, "ExecStart"))
        threading.Thread(target=_stop_after, args=(started.robot, part, process), daemon=True).start()


def _stop_after(robot: RunningRobot, part: str, process: Process) -> None:
    while process.exit_code is None:
        time.sleep(0.005)
    if command := unit_command(robot, part, "ExecStopPost"):
        subprocess.run(command, check=False)


def unit_command(robot: RunningRobot, part: str, directive: str) -> list[str]:
    """A command of a unit of deploy/systemd with the paths of this test."""
    text = (ROOT / f"deploy/systemd/canbase-{part}@.service").read_text()
    found = re.search(rf"^{directive}=-?(.*)$", text, re.MULTILINE)
    if found is None:
        return []
    own = {"@PYTHON@": sys.executable, "/etc/canbase/%i.yaml": str(robot.config), "/run/canbase/%i": str(robot.folder)}
    line = re.sub(r"\$[A-Z_]+", "", found[1])
    for name, value in own.items():
        line = line.replace(name, value)
    return shlex.split(line)


SUPERVISORS: Final[dict[str, Callable[[Started], None]]] = {
    "a container": container,
    "ros2 launch": launch,
    "systemd": systemd,
    "by hand": by_hand,
}
"""Whoever can start driver and watchdog, besides `canbase up`: it is killed with them below."""


@pytest.fixture
def robot() -> Iterator[RunningRobot]:
    with own_domain() as domain, robot_on(domain, changes={**PATIENT, "drives": DRIVES}, start=False) as robot:
        yield robot


@pytest.fixture
def started(robot: RunningRobot) -> Iterator[Started]:
    robot.command("serve", "sim", "--config", str(robot.config))
    robot.node.wait_for(control_path(robot.robot).is_socket, 20.0, "the simulator")
    create_first(latch_folder(os.environ | robot.env, Path.home(), robot.robot.name), robot.robot.name)
    started = Started(robot)
    yield started
    started.close()


def test_these_drives_go_on_without_their_masters() -> None:
    assert PERSONALITIES[KIND].alone_s(1.0) == float("inf")


@pytest.mark.parametrize("name", SUPERVISORS)
def test_driver_and_watchdog_killed_at_once_leave_a_robot_that_stops(name: str, started: Started) -> None:
    robot = started.robot
    SUPERVISORS[name](started)
    drive(robot)

    moment_s = kill(robot, "driver", "watchdog")
    robot.wait_standing(timeout_s=5.0)

    stop = robot.standstill_after(moment_s)
    print(f"{name}: standstill after {stop.after_s:.3f} s and {stop.way_m:.3f} m")
    ramp_s = SPEED_MPS / robot.robot.limits.emergency_deceleration_mps2
    assert stop.after_s < STOP_S + ramp_s + LATE_S
    assert robot.moved_since(time.monotonic(), 1.0) < RESTS_M


def test_everything_killed_at_once_leaves_a_robot_that_stops(started: Started) -> None:
    robot = started.robot
    up(started)
    drive(robot)

    moment_s = kill(robot, "up", "driver", "watchdog", "velocity", "action-server")
    robot.wait_standing(timeout_s=5.0)

    assert robot.standstill_after(moment_s).after_s < 1.0


def drive(robot: RunningRobot) -> None:
    robot.make_ready()
    robot.goal(5.0, SPEED_MPS)
    robot.wait_speed(0.28)


NAMES: Final = {"driver": {"driver", "motor_driver"}, "watchdog": {"canbase_watchdog"}}


def kill(robot: RunningRobot, *parts: str) -> float:
    """SIGKILL to all processes of these parts, at once; the moment before (time.monotonic)."""
    pids = [pid for part in parts for pid in pids_of(robot, NAMES.get(part, {part}))]
    assert len(pids) == len(parts)
    moment_s = time.monotonic()
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    return moment_s


def pids_of(robot: RunningRobot, names: set[str]) -> Iterator[int]:
    """Processes whose command line has the folder of this robot, and one of these words."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            words = path.read_text().split("\0")
            of_robot = any(str(robot.folder) in word for word in words)
            if of_robot and words[0] != "unshare" and names & {Path(word).name for word in words}:
                yield int(path.parent.name)
