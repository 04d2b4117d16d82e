"""The driver's cycle while a whole robot runs: how late it begins.

A robot of real processes stands enabled, all topics alive. Beside it, at the same time and at the same priority: a loop
in C that does nothing but clock_nanosleep.
"""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from canbase_cli.raise_priority import PRIORITY
from figures import Figure, quantile, spread
from support.running_robot import RunningRobot, own_domain, robot_on

SECONDS = 20.0
FILE = "CANBASE_PROBE"
LATENESS_RATIO = 1.2


def measure() -> list[Figure]:
    """Lateness."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="canbase-bench-", dir="/tmp")))
        env = {"PYTHONPATH": str(Path(__file__).parent / "probe"), FILE: str(folder / "late.json")}
        domain = stack.enter_context(own_domain())
        robot = stack.enter_context(robot_on(domain, env=env))
        time.sleep(2.0)
        floor = _floor(folder, robot.robot.rates.control_hz)
        robot.send("driver", signal.SIGUSR1)
        time.sleep(SECONDS)
        ours = _lateness(robot, folder)
        theirs = [float(line) * 1e-9 for line in floor.communicate()[0].split()]
    return [_late(ours, theirs)]


def _late(ours: list[float], theirs: list[float]) -> Figure:
    ratio = quantile(ours, 0.99) / quantile(theirs, 0.99)
    what = f"driver: how late a cycle begins, two axes, 100 Hz, ROS running, {len(ours)} cycles"
    beside = f"clock_nanosleep in C: {spread(theirs)}"
    return Figure(what, spread(ours), beside, ratio, f"p99 ≤ {LATENESS_RATIO} × the C loop", ratio <= LATENESS_RATIO)


def _floor(folder: Path, control_hz: float) -> subprocess.Popen[str]:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise RuntimeError("no C compiler: install gcc")
    program = folder / "cyclic"
    subprocess.run([compiler, "-O2", "-o", str(program), str(Path(__file__).parent / "cyclic.c")], check=True)
    arguments = [str(round(SECONDS * control_hz)), str(round(1e9 / control_hz)), str(PRIORITY["driver"])]
    return subprocess.Popen([str(program), *arguments], stdout=subprocess.PIPE, text=True)


def _lateness(robot: RunningRobot, folder: Path) -> list[float]:
    robot.send("driver", signal.SIGUSR2)
    path = folder / "late.json"
    robot.node.wait_for(path.exists, 5.0, "what the probe has seen")
    values: list[float] = json.loads(path.read_text())
    return values


if __name__ == "__main__":
    for figure in measure():
        print(figure)
