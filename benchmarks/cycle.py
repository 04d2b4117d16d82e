"""The driver's cycle while a whole robot runs: how late it begins, and what the driver costs.

A robot of real processes stands enabled, all topics alive. Beside it, at the same time and at the same priority: a loop
in C that does nothing but clock_nanosleep (lateness), and a rclpy node with one timer and one publisher (processor).
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from canbase_cli.raise_priority import PRIORITY
from figures import Figure, quantile, spread
from support.running_robot import RunningRobot, own_domain, robot_on

SECONDS = 20.0
FILE = "CANBASE_PROBE"
LATENESS_RATIO, CPU_RATIO = 1.5, 2.0

BARE_NODE = """
import os, rclpy
from geometry_msgs.msg import TwistStamped
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(35))
except OSError:
    pass
rclpy.init()
node = rclpy.create_node("bare")
publisher = node.create_publisher(TwistStamped, "bare", 10)
def tick():
    message = TwistStamped()
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
node.create_timer(0.01, tick)
rclpy.spin(node)
"""


def measure() -> list[Figure]:
    """Lateness and processor."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="canbase-bench-", dir="/tmp")))
        env = {"PYTHONPATH": str(Path(__file__).parent / "probe"), FILE: str(folder / "late.json")}
        domain = stack.enter_context(own_domain())
        robot = stack.enter_context(robot_on(domain, env=env))
        bare = _bare_node(stack, robot.env)
        time.sleep(2.0)
        floor = _floor(folder, robot.robot.rates.control_hz)
        robot.send("driver", signal.SIGUSR1)
        before = _cpu_s(robot.stack.pids["driver"]), _cpu_s(bare), time.monotonic()
        time.sleep(SECONDS)
        after = _cpu_s(robot.stack.pids["driver"]), _cpu_s(bare), time.monotonic()
        ours = _lateness(robot, folder)
        theirs = [float(line) * 1e-9 for line in floor.communicate()[0].split()]
    elapsed_s = after[2] - before[2]
    return [_late(ours, theirs), _cpu((after[0] - before[0]) / elapsed_s, (after[1] - before[1]) / elapsed_s)]


def _late(ours: list[float], theirs: list[float]) -> Figure:
    ratio = quantile(ours, 0.99) / quantile(theirs, 0.99)
    what = f"driver: how late a cycle begins, two axes, 100 Hz, ROS running, {len(ours)} cycles"
    beside = f"clock_nanosleep in C: {spread(theirs)}"
    return Figure(what, spread(ours), beside, ratio, "p99 ≤ 1.5 × the C loop", ratio <= LATENESS_RATIO)


def _cpu(ours: float, theirs: float) -> Figure:
    what = "driver: processor at 100 Hz, two axes, odometry at 50 Hz"
    beside = f"rclpy node, one 100 Hz timer and publisher: {theirs:.1%}"
    ratio = ours / theirs
    return Figure(what, f"{ours:.1%} of a processor", beside, ratio, "≤ 2 × the bare node", ratio <= CPU_RATIO)


def _floor(folder: Path, control_hz: float) -> subprocess.Popen[str]:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise RuntimeError("no C compiler: install gcc")
    program = folder / "cyclic"
    subprocess.run([compiler, "-O2", "-o", str(program), str(Path(__file__).parent / "cyclic.c")], check=True)
    arguments = [str(round(SECONDS * control_hz)), str(round(1e9 / control_hz)), str(PRIORITY["driver"])]
    return subprocess.Popen([str(program), *arguments], stdout=subprocess.PIPE, text=True)


def _bare_node(stack: ExitStack, env: dict[str, str]) -> int:
    child = subprocess.Popen(
        [sys.executable, "-c", BARE_NODE], env=os.environ | {"ROS_DOMAIN_ID": env["ROS_DOMAIN_ID"]}
    )
    stack.callback(child.wait)
    stack.callback(child.kill)
    return child.pid


def _lateness(robot: RunningRobot, folder: Path) -> list[float]:
    robot.send("driver", signal.SIGUSR2)
    path = folder / "late.json"
    robot.node.wait_for(path.exists, 5.0, "what the probe has seen")
    values: list[float] = json.loads(path.read_text())
    return values


def _cpu_s(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    for figure in measure():
        print(figure)
