"""What processes take of the computer: processor time and memory, and the bare rclpy node that is the floor of it."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

BARE = "bare node"
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
"""One timer and one publisher at 100 Hz, with the priority of a node of the chain."""


def bare_node(stack: ExitStack, domain: str) -> int:
    """Starts one in that ROS domain; its process id. It ends with the stack."""
    child = subprocess.Popen([sys.executable, "-c", BARE_NODE], env=os.environ | {"ROS_DOMAIN_ID": domain})
    stack.callback(child.wait)
    stack.callback(child.kill)
    return child.pid


def cpu_s(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def shares(pids: Mapping[str, int], seconds: float, wait: Callable[[float], None]) -> dict[str, float]:
    """The part of one processor that each of them takes during so many seconds, for which `wait` waits."""
    before, began_s = {name: cpu_s(pid) for name, pid in pids.items()}, time.monotonic()
    wait(seconds)
    lasted_s = time.monotonic() - began_s
    return {name: (cpu_s(pid) - before[name]) / lasted_s for name, pid in pids.items()}


def resident_mb(pid: int) -> float:
    """What it has in memory [MB], pages that it shares with others included."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmRSS:"))
