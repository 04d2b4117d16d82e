"""How soon is a cancel accepted while a goal runs, odometry comes at 50 Hz and scans at 20 Hz?

    ROS_DOMAIN_ID=77 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST python benchmarks/cancel.py [--cancels 200]

The whole bench robot runs in processes of its own, as `canbase up` starts it; a scanner is added here. Its action
server is measured, and in the same run, in turn, the floor: a bare rclpy action server in a process of its own, whose
goal only waits to be canceled. Measured from the request to the response, by the client.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from action_msgs.srv import CancelGoal
from canbase.action import DriveDistance
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan

from accuracy import quantile
from canbase_cli.stack import Stack
from canbase_config.load import sample

BUDGET_S = 0.050
READY_S = 40.0
FLOOR = """
import rclpy
from canbase.action import DriveDistance
from rclpy.action import ActionServer, CancelResponse
from rclpy.task import Future

rclpy.init()
node = rclpy.create_node("floor")

async def execute(handle):
    while not handle.is_cancel_requested:
        over = Future()
        timer = node.create_timer(0.02, lambda: over.done() or over.set_result(None))
        await over
        node.destroy_timer(timer)
    handle.canceled()
    return DriveDistance.Result()

server = ActionServer(node, DriveDistance, "floor", execute, cancel_callback=lambda handle: CancelResponse.ACCEPT)
rclpy.spin(node)
"""


class Bench:
    """Clients of both servers, and the scanner."""

    def __init__(self) -> None:
        self.node = Node("cancel_benchmark", enable_rosout=False)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.clients = {name: ActionClient(self.node, DriveDistance, name) for name in ("drive_distance", "floor")}
        scans = self.node.create_publisher(LaserScan, "scan", qos_profile_sensor_data)
        scan = LaserScan(
            angle_max=179 * 0.0349, angle_increment=0.0349, range_min=0.05, range_max=10.0, ranges=[float("inf")] * 180
        )

        def send() -> None:
            scan.header.stamp = self.node.get_clock().now().to_msg()
            scans.publish(scan)

        self.node.create_timer(0.05, send)
        self._way_m = 1.0

    def until(self, done: Callable[[], Any], timeout_s: float = READY_S) -> None:
        """Spins until `done()`; RuntimeError when it does not come."""
        deadline = time.monotonic() + timeout_s
        while not done():
            if time.monotonic() > deadline:
                raise RuntimeError("no answer in time: is the robot ready? Another one in this ROS_DOMAIN_ID?")
            self.executor.spin_once(timeout_sec=0.05)

    def accepted(self, name: str) -> Any:
        """The handle of a goal that runs; forward and backward in turn."""
        client, deadline = self.clients[name], time.monotonic() + READY_S
        self._way_m = -self._way_m
        while time.monotonic() < deadline:
            answer = client.send_goal_async(DriveDistance.Goal(distance_m=self._way_m, max_speed_mps=0.2))
            self.until(answer.done)
            if answer.result().accepted:
                return answer.result()
            until = time.monotonic() + 0.2
            self.until(lambda until=until: time.monotonic() > until)  # type: ignore[misc]
        raise RuntimeError(f"{name} accepts no goal")

    def cancel(self, name: str) -> float:
        """From the request to the response, with the goal running [s]; its end is waited for."""
        handle = self.accepted(name)
        result = handle.get_result_async()
        runs_until = time.monotonic() + 0.15
        self.until(lambda: time.monotonic() > runs_until)
        asked = time.perf_counter()
        response = handle.cancel_goal_async()
        while not response.done():
            self.executor.spin_once(timeout_sec=1.0)
        took_s = time.perf_counter() - asked
        if response.result().return_code != CancelGoal.Response.ERROR_NONE:
            raise RuntimeError(f"{name} did not accept a cancel")
        self.until(result.done)
        return took_s


def main() -> int:
    """Exit code 0: accepted within 50 ms at p99."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cancels", type=int, default=200)
    arguments = parser.parse_args()
    floor = subprocess.Popen([sys.executable, "-c", FLOOR])
    rclpy.init()
    try:
        logs = Path("/tmp/canbase-cancel-benchmark")
        logs.mkdir(exist_ok=True)
        with Stack(sample("bench"), sim=True, logs=logs):
            bench = Bench()
            bench.until(lambda: all(client.server_is_ready() for client in bench.clients.values()))
            times: dict[str, list[float]] = {name: [] for name in bench.clients}
            for _ in range(arguments.cancels):
                for name, taken in times.items():
                    taken.append(bench.cancel(name))
    finally:
        floor.terminate()
        floor.kill()
        floor.wait()
        rclpy.try_shutdown()
    print(table(times))
    return 0 if quantile(times["drive_distance"], 0.99) <= BUDGET_S else 1


def table(times: dict[str, list[float]]) -> str:
    """As Markdown, in ms, and the ratio to the floor."""
    shares = (0.5, 0.99, 1.0)
    ours, floor = ([quantile(times[name], share) for share in shares] for name in ("drive_distance", "floor"))
    rows = {
        "drive_distance": [f"{1e3 * value:.1f}" for value in ours],
        "bare rclpy action server": [f"{1e3 * value:.1f}" for value in floor],
        "ratio": [f"{a / b:.1f}" for a, b in zip(ours, floor, strict=True)],
    }
    head = f"| {len(times['floor'])} cancels | p50 [ms] | p99 [ms] | max [ms] |\n|---|---|---|---|"
    return "\n".join([head, *(f"| {name} | {' | '.join(cells)} |" for name, cells in rows.items())])


if __name__ == "__main__":
    sys.exit(main())
