"""What does `canbase web` cost while a browser shows the page Now, and what does the driver notice of it?

    ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST python benchmarks/web.py [--axes 8] [--seconds 15] [--rounds 4]

The bench robot with so many drives runs in processes of its own, drives in a circle, and has a scanner. In turn, in the
same run: nobody looks; a headless chromium shows the page. Beside them runs a bare rclpy node with one timer and one
publisher at 100 Hz, the floor. A browser on the robot's own computer takes processor time of its own: the driver's
cycle is measured with it here, and is better off with a browser elsewhere.
"""

from __future__ import annotations

import argparse
import math
import os
import random
import sys
import time
from collections import defaultdict
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from ruamel.yaml import YAML
from sensor_msgs.msg import LaserScan

from canbase_config.load import sample
from shares import BARE, bare_node, shares
from support.browser import TOKEN, browser, free_tcp_port
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on

SERVER_BUDGET = 0.08
FIRST_PLOT_BUDGET_S = 2.0
LOOKS, ALONE = "a browser shows the page", "nobody looks"
SECOND_S = 1.1
"""`cycle_lateness_max_s` looks back for a second: the first values of a round are of the one before."""
OPENINGS = 5


def drives(axes: int) -> list[dict[str, Any]]:
    """The sample's drives, so many of them, half on each side."""
    left, right = YAML(typ="safe").load(sample("bench"))["drives"]
    return [
        dict(like, joint=f"{like['joint']}_{i}", node_id=2 * i + offset)
        for i in range(axes // 2)
        for offset, like in ((1, left), (2, right))
    ]


def changes(axes: int) -> dict[str, Any]:
    """Of the sample robot.yaml."""
    return {**PATIENT, "drives": drives(axes)}


class Site:
    """The robot's page, and a browser."""

    def __init__(self, robot: RunningRobot, launched: Any, folder: Path) -> None:
        self.robot, self._browser = robot, launched
        (folder / "token").write_text(TOKEN, encoding="utf-8")
        (folder / "token").chmod(0o600)
        self._url = f"http://127.0.0.1:{free_tcp_port()}"
        port = self._url.rpartition(":")[2]
        words = ("web", "--config", str(robot.config), "--port", port, "--token-file", str(folder / "token"))
        self.process = robot.command(*words)
        robot.node.wait_for(lambda: "open http" in self.process.log(), 40.0, "the page")

    def open(self) -> tuple[Any, float]:
        """A page of a new browser session, and the time from the request to the first point of a plot [s]."""
        page = self._browser.new_context().new_page()
        began_s = time.monotonic()
        page.goto(f"{self._url}/?token={TOKEN}")
        page.wait_for_selector("[data-points]")
        return page, time.monotonic() - began_s


def scanner(robot: RunningRobot) -> None:
    """Walls 4 m away, at 10 Hz, with the noise without which a scanner counts as stuck."""
    node = robot.node.node
    step = 2.0 * math.pi / 360
    scan = LaserScan(angle_min=-math.pi, angle_max=math.pi, angle_increment=step, range_min=0.1, range_max=12.0)
    scan.header.frame_id = "laser"
    publisher = node.create_publisher(LaserScan, "scan", 5)

    def send() -> None:
        scan.ranges = [random.gauss(4.0, 0.01) for _ in range(360)]
        scan.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(scan)

    node.create_timer(0.1, send)


Found = dict[str, dict[str, list[float]]]
"""By kind of round and quantity: shares of a processor and late cycles of each round, lateness of each second."""


def measure(robot: RunningRobot, site: Site, bare: int, seconds: float, rounds: int) -> Found:
    """Rounds of both kinds in turn."""
    found: Found = {kind: defaultdict(list) for kind in (ALONE, LOOKS)}
    pids = {"canbase web": site.process.pid, "driver": robot.stack.pids["driver"], BARE: bare}
    for turn in range(2 * rounds):
        kind = LOOKS if turn % 2 else ALONE
        page = site.open()[0] if kind is LOOKS else None
        robot.node.spin_for(SECOND_S)
        began_s = time.monotonic()
        for name, share in shares(pids, seconds, robot.node.spin_for).items():
            found[kind][name].append(share)
        reports = robot.status.since(began_s)
        found[kind]["overruns"].append((reports[-1].overruns - reports[0].overruns) / seconds)
        found[kind]["lateness"] += [
            each.cycle_lateness_max_s for each in reports[:: max(1, int(len(reports) / seconds))]
        ]
        if page is not None:
            page.context.close()
    return found


def table(found: Found, first_s: list[float]) -> str:
    """As Markdown."""
    rows = {
        "canbase web, of one processor": ("canbase web", 100.0, "%"),
        "driver, of one processor": ("driver", 100.0, "%"),
        "bare rclpy node, of one processor": (BARE, 100.0, "%"),
        "cycles more than half a period late, in a second": ("overruns", 1.0, ""),
        "greatest lateness of a cycle in a second": ("lateness", 1e3, " ms"),
    }
    lines = [f"| median (least to most) | {ALONE} | {LOOKS} |", "|---|---|---|"]
    for text, (name, scale, unit) in rows.items():
        cells = []
        for kind in (ALONE, LOOKS):
            values = [scale * value for value in found[kind][name]]
            cells.append(f"{median(values):.1f}{unit} ({min(values):.1f} to {max(values):.1f})")
        lines.append(f"| {text} | {cells[0]} | {cells[1]} |")
    times = f"{median(first_s):.2f} s ({min(first_s):.2f} to {max(first_s):.2f})"
    return "\n".join([*lines, f"| from the request to the first point of a plot | | {times} |"])


def main() -> int:
    """Exit code 0: the budgets are kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--axes", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=15.0, help="of a round")
    parser.add_argument("--rounds", type=int, default=4, help="of each kind")
    arguments = parser.parse_args()
    with ExitStack() as held:
        domain = held.enter_context(own_domain())
        robot = held.enter_context(robot_on(domain, changes=changes(arguments.axes)))
        scanner(robot)
        folder = Path(held.enter_context(TemporaryDirectory()))
        site = Site(robot, held.enter_context(browser()), folder)
        bare = bare_node(held, str(domain))
        joystick = robot.node.source("cmd_vel_joy")
        joystick.message = joystick.kind()
        joystick.message.twist.linear.x, joystick.message.twist.angular.z = 0.1, 0.3
        robot.wait_speed(0.09)
        load = os.getloadavg()[0]
        found = measure(robot, site, bare, arguments.seconds, arguments.rounds)
        joystick.message = None
        first_s = []
        for _ in range(OPENINGS):
            page, took_s = site.open()
            first_s.append(took_s)
            page.context.close()
    print(
        f"{arguments.axes} axes, {arguments.rounds} rounds of {arguments.seconds:g} s each; load before it {load:.1f}\n"
    )
    print(table(found, first_s))
    kept = median(found[LOOKS]["canbase web"]) <= SERVER_BUDGET and median(first_s) <= FIRST_PLOT_BUDGET_S
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
