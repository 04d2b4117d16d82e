"""A base for tests of the action server: obeys cmd_vel_action with a ramp, publishes odom and the states of all nodes.

Everything that can go wrong is a field. It has a node and a thread: a test whose clients have much to do, or that waits
for a process, holds no message of the base up. Change what `_step` changes as well (x_m, yaw_rad) with `lock` held.
"""

from __future__ import annotations

import math
import threading
import time
from pathlib import Path

from builtin_interfaces.msg import Time
from canbase.msg import DriverStatus, MuxState, SafetyState
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from support.ros_harness import TestNode

PERIOD_S = 0.02
LONGEST_STEP_S = 2 * PERIOD_S
"""A base that the computer holds up stands meanwhile: nobody could have stopped it."""
RAMP_MPS2 = 1.0
COMMAND_TIMEOUT_S = 0.3


class FakeBase:
    """The rest of the robot, healthy unless a field changes it."""

    def __init__(self, test_node: TestNode) -> None:
        self.x_m = self.y_m = 0.0
        self.yaw_rad = 0.0
        self.speed_mps = 0.0
        self.heal()
        self.orders: list[tuple[float, float]] = []
        """Receive time and linear velocity of every order."""
        self._turn_radps = 0.0
        self._wanted = TwistStamped()
        self._last = time.monotonic()
        self.lock = threading.Lock()
        self._node = node = Node("fake_base", context=test_node.context, enable_rosout=False)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._odom = node.create_publisher(Odometry, "odom", 10)
        self._driver = node.create_publisher(DriverStatus, "motor_driver/status", 1)
        self._safety = node.create_publisher(SafetyState, "safety_filter/state", latched)
        self._mux = node.create_publisher(MuxState, "velocity_mux/state", latched)
        node.create_subscription(TwistStamped, "cmd_vel_action", self._on_order, 10)
        node.create_timer(PERIOD_S, self._step)
        self._executor = SingleThreadedExecutor(context=test_node.context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()
        test_node.ends.callback(self._end)

    def _end(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()

    def heal(self) -> None:
        """Nothing is wrong from now on."""
        self.stuck = False
        self.ramp_mps2 = RAMP_MPS2
        self.clock_off_s = 0.0
        """So much later than this computer's clock is the one that stamps odometry."""
        self.silent: set[str] = set()
        """Of: odom, driver, safety, mux."""
        self.safety = SafetyState(cause=SafetyState.CAUSE_NONE)
        self.driver = DriverStatus(state=DriverStatus.ENABLED, watchdog=DriverStatus.WATCHDOG_OK, cause="none")
        self.driver.command_fresh = True
        self.mux = MuxState()

    @property
    def heard(self) -> bool:
        """Somebody listens to each of its topics."""
        return all(each.get_subscription_count() > 0 for each in (self._odom, self._driver, self._safety, self._mux))

    @property
    def fresh(self) -> bool:
        """It obeys its last order still."""
        return bool(self.orders) and time.monotonic() - self.orders[-1][0] < COMMAND_TIMEOUT_S

    def orders_since(self, start_s: float) -> list[float]:
        """Linear velocities ordered after start_s (time.monotonic)."""
        return [mps for at_s, mps in self.orders if at_s >= start_s]

    def _on_order(self, message: TwistStamped) -> None:
        self._wanted = message
        self.orders.append((time.monotonic(), message.twist.linear.x))

    def _step(self) -> None:
        with self.lock:
            self._move()
            self._publish()

    def _move(self) -> None:
        now_s = time.monotonic()
        elapsed_s, self._last = min(now_s - self._last, LONGEST_STEP_S), now_s
        held = self.safety.action == SafetyState.STOP or self.driver.state != DriverStatus.ENABLED or not self.fresh
        wanted_mps = 0.0 if held else self._wanted.twist.linear.x
        self._turn_radps = 0.0 if held else self._wanted.twist.angular.z
        most = self.ramp_mps2 * elapsed_s
        self.speed_mps += max(-most, min(most, wanted_mps - self.speed_mps))
        if self.stuck:
            self.speed_mps = 0.0
        self.yaw_rad += self._turn_radps * elapsed_s
        self.x_m += self.speed_mps * elapsed_s * math.cos(self.yaw_rad)
        self.y_m += self.speed_mps * elapsed_s * math.sin(self.yaw_rad)

    def _publish(self) -> None:
        odometry = Odometry(child_frame_id="base_link")
        odometry.header.frame_id = "odom"
        stamp_s = time.time() + self.clock_off_s
        odometry.header.stamp = Time(sec=int(stamp_s), nanosec=int(stamp_s % 1.0 * 1e9))
        odometry.pose.pose.position.x, odometry.pose.pose.position.y = self.x_m, self.y_m
        odometry.pose.pose.orientation.z = math.sin(self.yaw_rad / 2)
        odometry.pose.pose.orientation.w = math.cos(self.yaw_rad / 2)
        odometry.twist.twist.linear.x = self.speed_mps
        odometry.twist.twist.angular.z = self._turn_radps
        self.driver.standstill = abs(self.speed_mps) < 0.005
        for name, publisher, message in (
            ("odom", self._odom, odometry),
            ("driver", self._driver, self.driver),
            ("safety", self._safety, self.safety),
            ("mux", self._mux, self.mux),
        ):
            if name not in self.silent:
                publisher.publish(message)


def server_code(robot_yaml: Path) -> str:
    """Python code of the action server's process."""
    return (
        "import sys\nfrom canbase_action_server.main import run\nfrom canbase_config.load import load_robot\n"
        f"sys.exit(run(load_robot({str(robot_yaml)!r}).robot, sys.argv[1:]))\n"
    )
