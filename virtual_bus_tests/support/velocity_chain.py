"""velocity_mux and safety_filter as a real process, all that it publishes, and the sources around it."""

from __future__ import annotations

import math
import socket
import struct
import tempfile
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from ruamel.yaml import YAML
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from support.ros_harness import Process, Recorder, TestNode, clear_records, merged, python_argv, robot_values
from support.running_robot import own_domain
from support.scanner import BEAMS, all_around, scanner

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LEASE = struct.Struct("<4sQQddII")
START_S = 15.0
SILENT_S = 0.4
"""After it no source of the sample robot is fresh without a message."""
CAUSE_S = 10.0
"""For a cause to be shown: some follow from the ROS graph, which DDS updates late."""
RUN = """
import sys
from canbase_config.load import load_robot
from canbase_velocity.main import run
sys.exit(run(load_robot({path!r}).robot, {ros_args!r}))
"""


def drive(linear_mps: float, angular_radps: float = 0.0) -> TwistStamped:
    message = TwistStamped()
    message.twist.linear.x, message.twist.angular.z = linear_mps, angular_radps
    return message


def scan(ahead_m: float = math.inf, behind_m: float = math.inf) -> LaserScan:
    """Beams all around, all free but for one ahead and one behind, from base_link."""
    ranges = [math.inf] * BEAMS
    ranges[0], ranges[BEAMS // 2] = ahead_m, behind_m
    return all_around(ranges)


class Chain:
    """The process, everything that it publishes, and the sources that a test can move."""

    def __init__(self, node: TestNode, process: Process, watchdog: socket.socket, released: bool = True) -> None:
        """`released`: joystick and action have commanded zero, and publish nothing now."""
        self.node, self.process, self.watchdog = node, process, watchdog
        self.leases: list[tuple[Any, ...]] = []
        node.node.create_timer(0.02, self.drain)
        self.orders: Recorder[TwistStamped] = node.record(TwistStamped, "cmd_vel")
        self.mux: Recorder[MuxState] = node.record(MuxState, "velocity_mux/state", LATCHED)
        self.state: Recorder[SafetyState] = node.record(SafetyState, "safety_filter/state", LATCHED)
        self.joystick = node.repeat(TwistStamped, "cmd_vel_joy", 50.0)
        self.action = node.repeat(TwistStamped, "cmd_vel_action", 50.0)
        self.scan = scanner(node)
        self.estop = node.repeat(Bool, "estop_state", 20.0)
        self.driver = node.repeat(DriverStatus, "motor_driver/status", 20.0, owner="motor_driver")
        for repeater in (self.joystick, self.action, self.scan, self.estop, self.driver):
            node.wait_for_subscriber(repeater.publisher, START_S)
        node.wait_for(lambda: self.mux.last is not None and self.state.last is not None, START_S, "the first states")
        self.scan.message, self._fresh_scan = scan(), self.scan.prepare
        self.driver.message = DriverStatus(state=DriverStatus.ENABLED)
        self.wait_for_cause(SafetyState.CAUSE_NONE)
        if released:
            node.release(self.joystick, self.action)
            node.spin_for(SILENT_S)

    def rest(self) -> None:
        """For the next test: nothing stops the base, every source is released and silent, zero is commanded."""
        self.scan.message, self.scan.prepare = scan(), self._fresh_scan
        self.driver.message = DriverStatus(state=DriverStatus.ENABLED)
        self.joystick.message = self.action.message = drive(0.0)

        def is_free() -> bool:
            last = self.state.last
            assert last is not None
            if last.cause == SafetyState.CAUSE_ESTOP:
                self.estop.message = Bool(data=False)
                self.node.spin_for(0.1)
                self.reset()
            return bool(last.cause == SafetyState.CAUSE_NONE)

        self.node.wait_for(is_free, CAUSE_S, "a base that nothing stops")
        self.estop.message = None
        self.node.wait_for(lambda: self.mux.messages[-1].ready, CAUSE_S, "a base that is ready")
        self.node.release(self.joystick, self.action)
        self.node.spin_for(SILENT_S)
        self.node.wait_for(lambda: self.mux.messages[-1].active == "", CAUSE_S, "sources that publish nothing")
        self.wait_for_cause(SafetyState.CAUSE_NONE)
        assert self.ordered == (0.0, 0.0)
        self.orders.clear()
        self.leases.clear()
        self.node.wait_for(lambda: self.orders.last, 1.0, "orders")

    def reset(self) -> tuple[bool, str]:
        """The answer of safety_filter/reset."""
        client = self.node.node.create_client(Trigger, "safety_filter/reset")
        self.node.wait_for(client.service_is_ready, START_S, "safety_filter/reset")
        future = client.call_async(Trigger.Request())
        self.node.wait_for(future.done, 3.0, "an answer of safety_filter/reset")
        self.node.node.destroy_client(client)
        answer = future.result()
        assert answer is not None
        return answer.success, answer.message

    def another(self, name: str, namespace: str = "") -> TestNode:
        """A node of somebody else."""
        return TestNode(name, namespace, self.node.context.get_domain_id())

    @property
    def ordered(self) -> tuple[float, float]:
        """The newest order on cmd_vel [m/s, rad/s]."""
        last = self.orders.last
        assert last is not None
        return last.twist.linear.x, last.twist.angular.z

    def wait_for_order(self, linear_mps: float, timeout_s: float = 3.0) -> float:
        """Until that is ordered; returns how long it took [s]."""
        started_s = time.monotonic()
        what = f"{linear_mps} m/s on cmd_vel"
        self.node.wait_for(lambda: self.ordered[0] == pytest.approx(linear_mps), timeout_s, what)
        return time.monotonic() - started_s

    def ordered_for(self, duration_s: float) -> set[float]:
        """Every speed [m/s] that is ordered from now on."""
        self.orders.clear()
        self.node.spin_for(duration_s)
        assert len(self.orders.messages) >= 20 * duration_s  # never silent
        return {message.twist.linear.x for message in self.orders.messages}

    def wait_for_cause(self, cause: str, detail: str = "") -> SafetyState:
        """Until the state has that cause, and `detail` in its detail: DDS finds a node before its name.

        An order that was sent after it has arrived then as well: DDS keeps no order between two topics.
        """

        def state() -> SafetyState | None:
            last = self.state.last
            return last if last is not None and last.cause == cause and detail in last.detail else None

        try:
            found = self.node.wait_for(state, CAUSE_S, f"cause {cause} {detail}")
        except AssertionError as error:
            raise AssertionError(f"{error}; {self.newest}") from None
        assert found is not None
        sent_s = self.state.times_s[-1]
        self.node.wait_for(lambda: self.orders.times_s[-1:] >= [sent_s], CAUSE_S, f"an order after the cause {cause}")
        return found

    @property
    def newest(self) -> str:
        """The newest state, and how old it and the newest lease are: a lease does not pass through DDS."""
        now_s = time.monotonic()
        ages_s = [now_s - at_s for at_s in (*self.state.times_s[-1:], *(1e-9 * lease[2] for lease in self.leases[-1:]))]
        return f"ages of state and lease: {', '.join(f'{age_s:.2f} s' for age_s in ages_s)}; {self.state.last}"

    def drain(self) -> None:
        """Takes all leases that wait at the socket: its queue is short, and a full one refuses the newest."""
        while True:
            try:
                data = self.watchdog.recv(100)
            except BlockingIOError:
                return
            lease = LEASE.unpack(data)
            assert zlib.crc32(data[:40]) == lease[-1]
            self.leases.append(lease)


@contextmanager
def chain_with(changes: Mapping[str, Any]) -> Iterator[Chain]:
    """A chain with these changes of robot.yaml, for several tests: each begins with `rest`."""
    with (
        own_domain() as domain,
        tempfile.TemporaryDirectory(prefix="canbase-", dir="/tmp") as name,
        socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as watchdog,
        TestNode(domain_id=domain) as node,
    ):
        folder = Path(name)
        YAML(typ="safe").dump(merged(robot_values(folder), changes), path := folder / "robot.yaml")
        watchdog.bind(str(folder / "lease"))
        watchdog.setblocking(False)
        argv = python_argv(RUN.format(path=str(path), ros_args=[]))
        env = {"ROS_DOMAIN_ID": str(domain), **clear_records(folder, "robot")}
        process = Process(argv, folder / "velocity.log", env)
        try:
            yield Chain(node, process, watchdog)
        finally:
            process.close()
            print(process.log())
