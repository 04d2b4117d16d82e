"""From the start of the driver to drives in Operation Enabled: two drives, and eight.

Drives and watchdog are up. Measured separately: the program start, until the driver's first frame (Python, ROS), and
the boot of the drives from there on. The floor of the first part: a process that makes an empty rclpy node.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import can

from canbase_config.load import load_robot
from figures import Figure, quantile
from support.ros_harness import Process, clear_records
from support.running_robot import CANBASE, own_domain, robot_file

RUNS = 5
FEW, MANY = 2, 8
BUDGET_S, BUDGET_RATIO = 1.0, 1.5
ENABLED_MASK, ENABLED = 0x6F, 0x27
BARE_NODE = "import rclpy; rclpy.init(); rclpy.create_node('bare')"


def drives(count: int) -> list[dict[str, Any]]:
    """This many wheels, left and right in turn, on nodes of their own."""
    shared = {"gear_ratio": 20.0, "counts_per_motor_rev": 4096, "velocity_unit": "0.1rpm"}
    places = [("left", 1) if i % 2 == 0 else ("right", -1) for i in range(count)]
    return [
        {"joint": f"wheel_{i + 1}", "node_id": i + 1, "side": side, "direction": direction} | shared
        for i, (side, direction) in enumerate(places)
    ]


def measure() -> list[Figure]:
    """Program start and boot."""
    few, many = [_start(FEW) for _ in range(RUNS)], [_start(MANY) for _ in range(RUNS)]
    bare_s = quantile([_bare() for _ in range(RUNS)], 0.5)
    program_s = quantile([program for program, _ in few + many], 0.5)
    few_s, many_s = quantile([boot for _, boot in few], 0.5), quantile([boot for _, boot in many], 0.5)
    whole_s = max(program + boot for program, boot in few)
    return [
        Figure(
            f"driver: first frame → {FEW} drives enabled, median of {RUNS}",
            f"{few_s:.3f} s (slowest whole start, with Python and ROS: {whole_s:.2f} s)",
            "–",
            None,
            "≤ 1 s",
            few_s <= BUDGET_S,
        ),
        Figure(
            f"driver: first frame → {MANY} drives enabled",
            f"{many_s:.3f} s",
            f"{FEW} drives: {few_s:.3f} s",
            many_s / few_s,
            "≤ 1.5 × two drives",
            many_s <= BUDGET_RATIO * few_s,
        ),
        Figure(
            "driver: start of the process → first frame",
            f"{program_s:.2f} s",
            f"python, import rclpy, an empty node: {bare_s:.2f} s",
            program_s / bare_s,
            "≤ 1.5 × the empty node",
            program_s <= BUDGET_RATIO * bare_s,
        ),
    ]


def _start(count: int) -> tuple[float, float]:
    """Until the driver's first frame, and from there until all drives are enabled [s]."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp")))
        env = {"ROS_DOMAIN_ID": str(stack.enter_context(own_domain())), **clear_records(folder, "bench")}
        path = robot_file(folder, {"drives": drives(count)})
        bus = stack.enter_context(can.Bus(**load_robot(path).robot.bus.arguments()))
        for part in ("sim", "watchdog"):
            stack.callback(Process([*CANBASE, "serve", part, "--config", str(path)], folder / f"{part}.log", env).close)
        time.sleep(2.5)
        while bus.recv(0.0) is not None:
            pass
        began_s = time.monotonic()
        stack.callback(Process([*CANBASE, "serve", "driver", "--config", str(path)], folder / "driver.log", env).close)
        first_s, enabled_s = _listen(bus, count)
    return first_s - began_s, enabled_s - first_s


def _listen(bus: can.BusABC, count: int) -> tuple[float, float]:
    """When the driver's first frame came, and when the last drive was enabled (time.monotonic)."""
    enabled: set[int] = set()
    first_s, end_s = 0.0, time.monotonic() + 20.0
    while len(enabled) < count:
        message = bus.recv(0.1)
        now_s = time.monotonic()
        if now_s > end_s:
            raise TimeoutError(f"only {sorted(enabled)} of {count} drives are enabled after 20 s")
        if message is None:
            continue
        cob_id = message.arbitration_id
        if not first_s and (cob_id == 0x77F or cob_id == 0x000 or 0x600 < cob_id < 0x680):
            first_s = now_s
        if 0x180 < cob_id <= 0x180 + count and message.data[0] & ENABLED_MASK == ENABLED:
            enabled.add(cob_id)
    return first_s, now_s


def _bare() -> float:
    began_s = time.monotonic()
    subprocess.run([sys.executable, "-c", BARE_NODE], check=True)
    return time.monotonic() - began_s


if __name__ == "__main__":
    for figure in measure():
        print(figure)
