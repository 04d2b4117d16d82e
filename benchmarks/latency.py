"""How long after its publication an order to move is on the bus: from cmd_vel, and from a source of the mux.

Driver, watchdog and simulated drives are real processes. From cmd_vel, this process stands in for the safety filter:
orders and leases. From a source, mux and filter are real as well. The driver sends setpoints once in a cycle, so up to
one period is waiting. The floor, in turn with it: a rclpy node that sends a frame as soon as a message has come.
"""

from __future__ import annotations

import json
import random
import socket
import struct
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

import can
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped

from canbase_config.load import load_robot
from canbase_velocity.lease import lease_datagram
from canbase_velocity.twist import Twist
from figures import MS, Figure, quantile, raise_priority, spread
from support.ros_harness import Process, TestNode, clear_records
from support.running_robot import CANBASE, own_domain, robot_file

ORDERS = 200
SPEED_MPS = 0.05
PERIOD_S = 0.02
QUIET_S = 0.6
"""Zero before each order [s]: the drives have released their wheels at standstill once, and hold them again. An order
within the 30 ms of that release waits for its end (docs/decisions/0041)."""
SOURCE = "cmd_vel_nav"
"""Of the sample's navigation."""
SETPOINT, FLOOR = 0x201, 0x510

FLOOR_CODE = """
import json, os, sys
import can, rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.experimental import EventsExecutor
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(35))
except OSError:
    pass
rclpy.init()
node = rclpy.create_node("floor")
frame = can.Message(arbitration_id=0x510, is_extended_id=False)
with can.Bus(**json.loads(sys.argv[1])) as bus:
    node.create_subscription(TwistStamped, "floor", lambda message: bus.send(frame), 1)
    executor = EventsExecutor()
    executor.add_node(node)
    while True:
        executor.spin_once(timeout_sec=0.1)
"""


class Orders:
    """Orders on one topic; with their leases where this is the topic of the safety filter."""

    def __init__(self, node: TestNode, bus: can.BusABC, topic: str, lease_path: str | None) -> None:
        self._node, self._bus, self._path = node, bus, lease_path
        self._publisher = node.node.create_publisher(TwistStamped, topic, 1)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._sequence = 0
        node.wait_for_subscriber(self._publisher)

    def close(self) -> None:
        """Closes its lease socket."""
        self._socket.close()

    def order(self, speed_mps: float) -> float:
        """One order; when it was published (time.monotonic)."""
        if self._path is not None:
            self._sequence += 1
            twist = Twist(speed_mps, 0.0)
            self._socket.sendto(
                lease_datagram(self._sequence, time.monotonic_ns(), twist, brakes_hard=False), self._path
            )
        message = TwistStamped()
        message.twist.linear.x = speed_mps
        began_s = time.monotonic()
        self._publisher.publish(message)
        return began_s

    def repeat(self, speed_mps: float, done: Callable[[], bool]) -> None:
        """The same order again and again, until `done`; frames that come meanwhile are read and forgotten."""
        while not done():
            self.order(speed_mps)
            end_s = time.monotonic() + PERIOD_S
            while (left_s := end_s - time.monotonic()) > 0.0:
                self._bus.recv(left_s)

    def drain(self) -> None:
        """Forgets what waits."""
        while self._bus.recv(0.0) is not None:
            pass


def measure(orders: int = ORDERS) -> list[Figure]:
    """Both figures; each order takes about 0.7 s."""
    return [
        _figure("driver: cmd_vel published", ("driver",), "cmd_vel", 0.001, orders),
        _figure("mux, filter, driver: a source's message published", ("driver", "velocity"), SOURCE, 0.003, orders),
    ]


def _figure(what: str, parts: Sequence[str], topic: str, margin_s: float, orders: int) -> Figure:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp")))
        env = {"ROS_DOMAIN_ID": str(stack.enter_context(own_domain())), **clear_records(folder, "bench")}
        path = robot_file(folder, {})
        robot = load_robot(path).robot
        bus = stack.enter_context(can.Bus(**robot.bus.arguments()))
        for part in ("sim", "watchdog", *parts):
            process = Process([*CANBASE, "serve", part, "--config", str(path)], folder / f"{part}.log", env)
            stack.callback(process.close)
        floor_process = Process(
            [sys.executable, "-c", FLOOR_CODE, json.dumps(robot.bus.arguments())], folder / "floor.log", env
        )
        stack.callback(floor_process.close)
        node = stack.enter_context(TestNode(domain_id=int(env["ROS_DOMAIN_ID"])))
        status = node.record(DriverStatus, "motor_driver/status")
        floor = node.node.create_publisher(TwistStamped, "floor", 1)
        node.wait_for_subscriber(floor, 20.0)
        lease_path = robot.lease.socket if "velocity" not in parts else None
        orders_of = stack.enter_context(closing(Orders(node, bus, topic, lease_path)))
        node.wait_for(lambda: status.last and status.last.state == DriverStatus.ENABLED, 20.0, "enabled drives")
        raise_priority(30)
        ours, theirs = [], []
        for _ in range(orders):
            ours.append(_setpoint(orders_of, bus))
            theirs.append(_frame(floor, bus))
    limit_s = 1.0 / robot.rates.control_hz + margin_s
    p99 = quantile(ours, 0.99)
    beside = f"a node that sends a frame at once: {spread(theirs)}"
    budget = f"p99 ≤ one period (10 ms) + {MS * margin_s:.0f} ms"
    return Figure(
        f"{what} → setpoint seen on the bus, {orders} orders", spread(ours), beside, p99 / quantile(theirs, 0.99),
        budget, p99 <= limit_s,
    )  # fmt: skip


def _setpoint(source: Orders, bus: can.BusABC) -> float:
    """From standstill, at a moment that has nothing to do with the driver's cycle [s]."""
    quiet_until_s = time.monotonic() + QUIET_S
    source.repeat(0.0, lambda: time.monotonic() >= quiet_until_s)
    time.sleep(random.uniform(0.0, PERIOD_S))
    source.drain()
    began_s = source.order(SPEED_MPS)
    seen_s = _seen(bus, SETPOINT, lambda data: struct.unpack("<Hi", data)[1] != 0)
    return seen_s - began_s


def _frame(publisher: object, bus: can.BusABC) -> float:
    began_s = time.monotonic()
    publisher.publish(TwistStamped())  # type: ignore[attr-defined]
    return _seen(bus, FLOOR, lambda _: True) - began_s


def _seen(bus: can.BusABC, cob_id: int, wanted: Callable[[bytes], bool]) -> float:
    end_s = time.monotonic() + 1.0
    while time.monotonic() < end_s:
        message = bus.recv(0.1)
        if message is not None and message.arbitration_id == cob_id and wanted(bytes(message.data)):
            return time.monotonic()
    raise TimeoutError(f"no frame {cob_id:03X}h within 1 s")


if __name__ == "__main__":
    for figure in measure():
        print(figure)
