"""What processes take of the computer: processor time and memory, and the bare rclpy node that is the floor of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from support import udp_port
from support.udp_port import free_udp_port

BARE = "bare node"
IO_ALONE = "input and output"
IO_CODE = """
import json, os, sys, threading, time
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(35))
except OSError:
    pass
import rclpy
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.experimental import EventsExecutor
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from canbase_base.frame_socket import open_bus
arguments = json.loads(sys.argv[1])
bus, elsewhere = open_bus(arguments), open_bus(arguments | {"port": int(sys.argv[2])})
rclpy.init()
node = rclpy.create_node("input_and_output")
joints = JointState(name=["left", "right"], position=[0.0, 0.0], velocity=[0.0, 0.0])
messages = (Odometry(), TFMessage(transforms=[TransformStamped()]), joints)
kept = [(node.create_publisher(type(m), type(m).__name__, 10), serialize_message(m)) for m in messages]
due = threading.Semaphore(0)
def publish():
    while due.acquire():
        for publisher, message in kept:
            publisher.publish(message)
def control():
    at, cycles = time.monotonic(), 0
    while True:
        at += 0.01
        while (left := at - time.monotonic()) > 0.0:
            bus.read(left)
        for cob_id in (0x080, 0x201, 0x202):
            elsewhere.write(cob_id, bytes(6), 0.002)
        cycles += 1
        if cycles % 2 == 0:
            due.release()
for each in (publish, control):
    threading.Thread(target=each, daemon=True).start()
executor = EventsExecutor()
executor.add_node(node)
while True:
    executor.spin_once(timeout_sec=1.0)
"""
"""The driver's input and output and nothing else: takes in all frames of the bus, sends three in each cycle (10 ms), on
a bus of its own, and publishes odom, tf and joint_states as they are, 50 times a second."""


def bare_node(stack: ExitStack, domain: str) -> int:
    """Starts one in that ROS domain; its process id. It ends with the stack."""
    return _run(stack, domain, "-m", "support.bare_node")


def io_alone(stack: ExitStack, domain: str, bus: Mapping[str, Any]) -> int:
    """Starts the driver's input and output alone beside a driver on the virtual bus `bus` (arguments of `can.Bus`); its
    process id. It ends with the stack.
    """
    return _run(stack, domain, "-c", IO_CODE, json.dumps(bus), str(free_udp_port()))


def _run(stack: ExitStack, domain: str, *arguments: str) -> int:
    environment = os.environ | {"ROS_DOMAIN_ID": domain, "PYTHONPATH": str(Path(udp_port.__file__).parents[1])}
    child = subprocess.Popen([sys.executable, *arguments], env=environment)
    stack.callback(child.wait)
    stack.callback(child.kill)
    return child.pid


def cpu_s(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def shares(pids: Mapping[str, int], seconds: float, wait: Callable[[float], None]) -> dict[str, float]:
    """The part of one processor that each of them takes during this many seconds, for which `wait` waits."""
    before, began_s = {name: cpu_s(pid) for name, pid in pids.items()}, time.monotonic()
    wait(seconds)
    lasted_s = time.monotonic() - began_s
    return {name: (cpu_s(pid) - before[name]) / lasted_s for name, pid in pids.items()}


def resident_mb(pid: int) -> float:
    """What it has in memory [MB], pages that it shares with others included."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024.0 for line in lines if line.startswith("VmRSS:"))
