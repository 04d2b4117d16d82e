"""The robot of the guest as scenarios see it: ROS, and the ground truth of the simulated drives."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from functools import cached_property
from typing import TypeVar

from canbase_cli.middleware import prefer_udp
from canbase_sim.control import SimControl
from canbase_sim.world.bench import Truth

prefer_udp(os.environ)

import rclpy  # noqa: E402 - reads the environment
from canbase.msg import DriverStatus, MuxSource, MuxState  # noqa: E402
from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.signals import SignalHandlerOptions  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from canbase_action_server.client import Drive, DriveClient, RejectedError  # noqa: E402
from canbase_config.load import load_robot  # noqa: E402
from vm.guest.evidence import Evidence  # noqa: E402
from vm.guest.standstill import Standstill, standstill  # noqa: E402
from vm.guest.stick import TOPIC, Stick  # noqa: E402
from vm.guest.system import ROBOT_YAML, BrokenPromiseError, show, unit  # noqa: E402

SPEED_MPS = 0.3
RESTS_M = 0.0005
WAIT_S = 30.0
TOO_FAR_M = 1000.0

T = TypeVar("T")


class Robot:
    """One connection to everything, for all scenarios of a boot: a new ROS node costs all others much time."""

    def __init__(self, namespace: str = "", beside: Robot | None = None, control: str = "/run/sim.sock") -> None:
        """`beside`: another robot, whose ROS node this one uses too; this one has a namespace, such as `robot2/`.
        `control`: the socket of its simulated drives."""
        self.node: Node
        self.executor: SingleThreadedExecutor
        self.node, self.executor = _node() if beside is None else (beside.node, beside.executor)
        self.status: DriverStatus | None = None
        self.status_at = -math.inf
        self.node.create_subscription(DriverStatus, f"{namespace}motor_driver/status", self._on_status, 10)
        self._followed_at = -math.inf
        self.node.create_subscription(MuxState, f"{namespace}velocity_mux/state", self._on_mux, 10)
        self._stick = Stick(f"{namespace}{TOPIC}")
        self._reset = self.node.create_client(Trigger, f"{namespace}motor_driver/reset")
        self._filter_reset = self.node.create_client(Trigger, f"{namespace}safety_filter/reset")
        self.config = load_robot(ROBOT_YAML).robot
        self.evidence: Evidence = Evidence(self.node) if beside is None else beside.evidence
        self.client: DriveClient = DriveClient(self.node, self.executor) if beside is None else beside.client
        self._control = control

    def _on_status(self, message: DriverStatus) -> None:
        self.status, self.status_at = message, time.monotonic()

    def _on_mux(self, message: MuxState) -> None:
        if any(source.name == message.active and source.standing == MuxSource.FOLLOWED for source in message.sources):
            self._followed_at = time.monotonic()

    @cached_property
    def sim(self) -> SimControl:
        """Its simulated drives, connected at the first use: drives of another author have no control socket."""
        return SimControl(self._control, timeout_s=20.0)

    def order(self, speed_mps: float | None) -> None:
        """By joystick, again and again; None: let go of it."""
        self._stick.order(speed_mps)

    def spin(self, for_s: float) -> None:
        """Let time pass."""
        until_s = time.monotonic() + for_s
        while (left_s := until_s - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=min(left_s, 0.1))

    def wait(self, what: str, found: Callable[[], T], timeout_s: float = WAIT_S) -> T:
        """Until `found()` is true."""
        until_s = time.monotonic() + timeout_s
        while not (value := found()):
            if time.monotonic() > until_s:
                raise BrokenPromiseError(f"waited {timeout_s:.0f} s in vain for {what}; driver: {self.told()}")
            self.spin(0.05)
        return value

    def told(self) -> str:
        """The driver's state as last heard."""
        s = self.status
        if s is None:
            return "not heard"
        fresh = "fresh" if s.command_fresh else "stale"
        return f"state {s.state} {s.cause} ({s.detail}), ends on {s.clears_on}; its command is {fresh}"

    @property
    def state(self) -> int | None:
        """The driver's state, None when it is silent."""
        fresh = self.status is not None and time.monotonic() - self.status_at < 0.5
        return int(self.status.state) if fresh and self.status is not None else None

    def truth(self) -> Truth:
        """What the robot really does."""
        return self.sim.truth()

    def drive(self) -> None:
        """Ordered by joystick, until it goes at full speed."""
        self.order(SPEED_MPS)
        self.wait("speed", lambda: self.truth().linear_mps >= 0.97 * SPEED_MPS, 10.0)

    def goal(self, distance_m: float) -> Drive:
        """A goal of the action server, accepted.

        First one that it refuses: Fast DDS holds a server up to 0.1 s with the first answer to a client that it has
        just met, which on this slow processor is enough to make its odometry old.
        """
        until_s = time.monotonic() + WAIT_S
        self._is_refused(TOO_FAR_M)
        self.spin(0.5)
        while (goal := self._sent(distance_m)) is None:
            if time.monotonic() > until_s:
                raise BrokenPromiseError(f"a goal of {distance_m} m is refused; driver: {self.told()}")
            self.spin(0.3)
        return goal

    def _is_refused(self, distance_m: float) -> None:
        if self._sent(distance_m) is not None:
            raise BrokenPromiseError(f"a goal of {distance_m} m is not refused")

    def _sent(self, distance_m: float) -> Drive | None:
        """None: rejected."""
        try:
            return self.client.send(distance_m, SPEED_MPS, discovery_timeout_s=WAIT_S)
        except RejectedError:
            return None

    def drive_by_goal(self) -> Drive:
        """On the way at full speed by the action server."""
        goal = self.goal(4.0)

        def fast() -> bool:
            if goal.result is not None:
                raise BrokenPromiseError(f"the goal ended on the way to full speed: {goal.result}")
            return self.truth().linear_mps >= 0.97 * SPEED_MPS

        self.wait("speed", fast, 10.0)
        return goal

    def stands(self, moment_s: float, timeout_s: float = 10.0) -> Standstill:
        """Wait until the wheels have stood for 0.3 s; how they came to stand since `moment_s`."""
        self.wait("standstill", lambda: self.truth().standing_s >= 0.3, timeout_s)
        return standstill(self.sim.trace(moment_s), moment_s)

    def stays(self, since_s: float) -> None:
        """Raises BrokenPromiseError when the base has moved since then."""
        rows = self.sim.trace(since_s)
        moved_m = max(math.dist(rows[0][1:3], row[1:3]) for row in rows)
        if moved_m > RESTS_M:
            raise BrokenPromiseError(f"moved {moved_m * 1000:.1f} mm after it had come to stand; driver: {self.told()}")

    def stays_disarmed(self, for_s: float = 1.0) -> None:
        """The driver is heard, and gives no power, for that long, whatever is ordered."""
        self.wait("the driver", lambda: self.state is not None)
        until_s = time.monotonic() + for_s
        while time.monotonic() < until_s:
            self.spin(0.1)
            if self.state in (DriverStatus.ENABLED, DriverStatus.ENABLING):
                raise BrokenPromiseError(f"enabled without a reset; {self.told()}")

    def make_ready(self) -> float:
        """Drives have power, the driver hears zeros; then nothing is ordered. Seconds that a reset took, 0 without."""
        self.order(0.0)
        done_s = 0.0
        until_s = time.monotonic() + WAIT_S
        self.wait("the driver", lambda: self.state is not None)
        while self.state != DriverStatus.ENABLED or self.status is None or not self.status.command_fresh:
            if time.monotonic() > until_s:
                raise BrokenPromiseError(f"not ready: {self.told()}")
            if self.state == DriverStatus.LATCHED:
                asked_s = time.monotonic()
                if self.reset():
                    done_s = time.monotonic() - asked_s
            self.spin(0.2)
        enabled_s = time.monotonic()
        self.wait("the mux to follow the joystick", lambda: self._followed_at > enabled_s)
        self.order(None)
        self.spin(0.5)  # until the mux has seen that the joystick is silent
        return done_s

    def reset(self) -> bool:
        """Ask once, the safety filter too, as `canbase reset` does; whether the driver's was done."""
        self.wait("safety_filter/reset", self._filter_reset.service_is_ready)
        free = self._filter_reset.call_async(Trigger.Request())
        self.wait("the answer to a reset", free.done)
        self.wait("motor_driver/reset", self._reset.service_is_ready)
        answer = self._reset.call_async(Trigger.Request())
        self.wait("the answer to a reset", answer.done)
        return bool(answer.result().success)

    def restarted(self, part: str, before: str) -> float:
        """Until the unit runs with another process than `before`; when [s, monotonic]."""
        until_s = time.monotonic() + WAIT_S
        while True:
            state, pid = show(unit(part), "ActiveState", "MainPID")
            now_s = time.monotonic()
            if state == "active" and pid not in (before, "0"):
                return now_s
            if now_s > until_s:
                raise BrokenPromiseError(f"{part} was not started again in {WAIT_S:.0f} s: {state}")
            self.spin(0.4)


def _node() -> tuple[Node, SingleThreadedExecutor]:
    """The one ROS node of the scenarios."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # a reboot ends this process at once
    node, executor = rclpy.create_node("scenarios", enable_rosout=False), SingleThreadedExecutor()
    executor.add_node(node)
    return node, executor
