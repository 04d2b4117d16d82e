"""How long a command takes through mux and safety filter, and what they cost, beside a bare relay in the same run.

    python benchmarks/velocity_latency.py          # about 40 s; prints a table

Five sources at 50 Hz and a scan of 720 points at 20 Hz come from one process; `canbase serve velocity` runs as it
does on a
robot. The relay is a node in a process of its own with one subscription and one publisher, which receives the same
commands. All three run with the real-time priority of `canbase serve velocity`. A command carries its number in its
angular velocity, so each answer is matched to its question.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rclpy
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from ruamel.yaml import YAML
from sensor_msgs.msg import LaserScan

from canbase_cli.middleware import prefer_udp
from canbase_cli.raise_priority import raise_priority
from canbase_config.load import sample

SOURCES = 5
SOURCE_HZ = 50.0
SCAN_HZ = 20.0
POINTS = 720
WARM_UP_S = 5.0
FIRST_ZEROS = 200
"""Commands of zero before the first that moves: the mux has started by then."""
MEASURED_S = float(os.environ.get("MEASURED_S", "30"))
STEP_RADPS = 1e-6
"""The number of a command, counted in these, stands in its angular velocity."""
RELAY = """
import rclpy
from canbase.msg import DriverStatus
from geometry_msgs.msg import TwistStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
rclpy.init()
node = Node("relay")
publisher = node.create_publisher(TwistStamped, "relayed", 1)
node.create_subscription(TwistStamped, "cmd_vel_0", publisher.publish, 1)
executor = EventsExecutor()
executor.add_node(node)
while True:
    executor.spin_once(timeout_sec=0.1)
"""


class Course(Node):
    """Sends the commands, and notes when each came back by which way."""

    def __init__(self) -> None:
        super().__init__("course")
        self.sent_s: dict[int, float] = {}
        self.took_s: dict[str, dict[int, float]] = {"cmd_vel": {}, "relayed": {}}
        self._number = 0
        self._sources = [self.create_publisher(TwistStamped, f"cmd_vel_{i}", 1) for i in range(SOURCES)]
        self._driver = self.create_publisher(DriverStatus, "motor_driver/status", 1)
        self._scans = self.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        step_rad = math.tau / POINTS
        self._scan = LaserScan(
            angle_max=step_rad * (POINTS - 1), angle_increment=step_rad, range_max=10.0, ranges=[5.0] * POINTS
        )
        for topic in self.took_s:
            self.create_subscription(TwistStamped, topic, self._taker(topic), QoSProfile(depth=50))
        self.create_timer(1.0 / SOURCE_HZ, self._command)
        self.create_timer(0.1, lambda: self._driver.publish(DriverStatus(state=DriverStatus.ENABLED)))
        self.create_timer(1.0 / SCAN_HZ, self._send_scan)

    def _send_scan(self) -> None:
        """A scan of its own stamp, and with one reading that is never the same: a scanner is noisy."""
        self._scan.header.stamp = self.get_clock().now().to_msg()
        self._scan.ranges[0] = 5.0 + 0.001 * (self._number % 10)
        self._scans.publish(self._scan)

    def _command(self) -> None:
        """The highest source last: the others' messages are there before it, as they are on a busy robot."""
        for publisher in self._sources[:0:-1]:
            publisher.publish(TwistStamped())
        self._number += 1
        message = TwistStamped()
        if self._number > FIRST_ZEROS:  # the mux follows a source that has commanded zero
            message.twist.linear.x = 0.1
            message.twist.angular.z = self._number * STEP_RADPS
        self.sent_s[self._number] = time.monotonic()
        self._sources[0].publish(message)

    def _taker(self, topic: str) -> object:
        took_s = self.took_s[topic]

        def take(message: TwistStamped) -> None:
            number = round(message.twist.angular.z / STEP_RADPS)
            if number in self.sent_s:
                took_s.setdefault(number, time.monotonic() - self.sent_s[number])

        return take


def main() -> None:
    """Measures once and prints a table in Markdown."""
    prefer_udp(os.environ)
    raise_priority("velocity")  # this process and the relay as `canbase serve velocity` itself
    with tempfile.TemporaryDirectory() as folder:
        config = robot_file(Path(folder))
        velocity = subprocess.Popen([sys.executable, "-m", "canbase_cli", "serve", "velocity", "--config", str(config)])
        relay = subprocess.Popen([sys.executable, "-c", RELAY])
        try:
            report(*measure(velocity.pid, relay.pid))
        finally:
            relay.kill()
            velocity.terminate()
            relay.wait(10.0)
            velocity.wait(10.0)


def robot_file(folder: Path) -> Path:
    """The bench robot with five sources and a scanner, both of which must publish."""
    yaml = YAML(typ="safe")
    values = yaml.load(sample("bench"))
    values["mux"] = {
        "sources": {
            f"source{i}": {"topic": f"cmd_vel_{i}", "priority": 100 - i, "timeout_s": 0.5} for i in range(SOURCES)
        }
    }
    values["safety"]["scan"]["required"] = True
    values["lease"]["socket"] = str(folder / "lease.sock")
    path = folder / "robot.yaml"
    yaml.dump(values, path)
    return path


def measure(velocity: int, relay: int) -> tuple[Course, float, float]:
    """The course after its run, and the share of one core that each process took."""
    rclpy.init()
    course, executor = Course(), EventsExecutor()
    executor.add_node(course)
    spin(executor, WARM_UP_S)
    course.sent_s.clear()
    for took_s in course.took_s.values():
        took_s.clear()
    before = cpu_s(velocity), cpu_s(relay)
    started_s = time.monotonic()
    spin(executor, MEASURED_S)
    went_s = time.monotonic() - started_s
    shares = [(cpu_s(pid) - start) / went_s for pid, start in zip((velocity, relay), before, strict=True)]
    executor.shutdown()
    rclpy.shutdown()
    return course, shares[0], shares[1]


def spin(executor: EventsExecutor, duration_s: float) -> None:
    """Lets the course run."""
    until_s = time.monotonic() + duration_s
    while time.monotonic() < until_s:
        executor.spin_once(timeout_sec=0.05)


def cpu_s(pid: int) -> float:
    """What a process has computed so far, in user and in kernel mode [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def report(course: Course, velocity_share: float, relay_share: float) -> None:
    """The table. A command without an answer counts as lost."""
    rows = {}
    for name, topic, share in (("mux and filter", "cmd_vel", velocity_share), ("relay", "relayed", relay_share)):
        took_ms = sorted(1e3 * value for value in course.took_s[topic].values())
        cuts = statistics.quantiles(took_ms, n=1000)
        lost = len(course.sent_s) - len(took_ms)
        rows[name] = {"p50": cuts[499], "p99": cuts[989], "max": took_ms[-1], "lost": lost, "cpu": share}
    print("| | p50 [ms] | p99 [ms] | max [ms] | unanswered | of one core |\n|---|---|---|---|---|---|")
    for name, row in rows.items():
        print(f"| {name} | {row['p50']:.2f} | {row['p99']:.2f} | {row['max']:.2f} | {row['lost']} | {row['cpu']:.1%} |")
    ours, bare = rows["mux and filter"], rows["relay"]
    ratios = {key: f"{ours[key] / bare[key]:.1f}" for key in ("p50", "p99", "cpu")}
    print(f"| ratio | {ratios['p50']} | {ratios['p99']} | | | {ratios['cpu']} |")
    print(
        json.dumps({"commands": len(course.sent_s), "cpus": os.cpu_count(), "load": os.getloadavg()}), file=sys.stderr
    )


if __name__ == "__main__":
    main()
