"""What does `canbase serve metrics` cost: alone, scraped once a second, and in a storm? And what does the driver
notice?

    ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST python benchmarks/metrics.py [--seconds 10] [--rounds 3]

The bench robot runs in processes of its own and drives in a circle. In turn, in the same run: no scrape, one a second,
as many as one client can send. Beside them runs a bare rclpy node with one timer and one publisher at 100 Hz, the
floor. The driver's cycle is compared between the kinds of rounds.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
import time
import urllib.request
from collections import defaultdict
from contextlib import ExitStack, suppress
from statistics import median

from shares import BARE, bare_node, shares
from support.browser import free_tcp_port
from support.running_robot import PATIENT, RunningRobot, own_domain, robot_on

QUIET, USUAL, STORM = "no scrape", "one a second", "a storm"
PAUSE_S = {USUAL: 1.0, STORM: 0.0}
BUDGET_OF_A_BARE_NODE = 1.0
"""One scrape a second costs less than a bare node."""
SECOND_S = 1.1
"""`cycle_lateness_max_s` looks back for a second."""
Found = dict[str, dict[str, list[float]]]


class Client:
    """Scrapes in a thread of its own while it is entered; the time of each scrape is in `took_s`."""

    def __init__(self, url: str, pause_s: float | None) -> None:
        self.took_s: list[float] = []
        self._url, self._pause_s, self._ended = url, pause_s, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Client:
        if self._pause_s is not None:
            self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._ended.wait(self._pause_s or 0.0):
            began_s = time.monotonic()
            with urllib.request.urlopen(self._url, timeout=30.0) as answer:
                answer.read()
            self.took_s.append(time.monotonic() - began_s)


def measure(robot: RunningRobot, url: str, pids: dict[str, int], seconds: float, rounds: int) -> Found:
    """Rounds of each kind in turn."""
    found: Found = {kind: defaultdict(list) for kind in (QUIET, USUAL, STORM)}
    for kind in [*found] * rounds:
        with Client(url, PAUSE_S.get(kind)) as client:
            robot.node.spin_for(SECOND_S)
            began_s = time.monotonic()
            for name, share in shares(pids, seconds, robot.node.spin_for).items():
                found[kind][name].append(share)
        reports = robot.status.since(began_s)
        found[kind]["lateness"] += [each.cycle_lateness_max_s for each in reports]
        found[kind]["scrape"] += client.took_s
        found[kind]["scrapes"].append(len(client.took_s) / (seconds + SECOND_S))
    return found


def table(found: Found) -> str:
    """As Markdown."""
    rows = {
        "canbase metrics, of one processor": ("canbase metrics", 100.0, " %"),
        "bare rclpy node, of one processor": (BARE, 100.0, " %"),
        "driver, of one processor": ("driver", 100.0, " %"),
        "scrapes in a second": ("scrapes", 1.0, ""),
        "time of a scrape": ("scrape", 1e3, " ms"),
        "greatest lateness of a cycle in a second": ("lateness", 1e3, " ms"),
    }
    lines = [f"| median (least to most) | {' | '.join(found)} |", f"|---|{'---|' * len(found)}"]
    for text, (name, scale, unit) in rows.items():
        cells = []
        for kind in found:
            values = [scale * value for value in found[kind][name]] or [0.0]
            cells.append(f"{median(values):.2f}{unit} ({min(values):.2f} to {max(values):.2f})")
        lines.append(f"| {text} | {' | '.join(cells)} |")
    return "\n".join(lines)


def wait_for(url: str, robot: RunningRobot) -> None:
    """Until the first scrape is answered."""

    def answers() -> bool:
        with suppress(OSError), urllib.request.urlopen(url, timeout=5.0) as answer:
            return bool(answer.status == 200)
        return False

    robot.node.wait_for(answers, 40.0, url)


def main() -> int:
    """Exit code 0: the budget is kept."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of a round")
    parser.add_argument("--rounds", type=int, default=3, help="of each kind")
    arguments = parser.parse_args()
    with ExitStack() as held:
        domain = held.enter_context(own_domain())
        robot = held.enter_context(robot_on(domain, changes=PATIENT))
        port = str(free_tcp_port())
        process = robot.command("serve", "metrics", "--config", str(robot.config), "--port", port)
        wait_for(url := f"http://127.0.0.1:{port}/metrics", robot)
        pids = {
            "canbase metrics": process.pid,
            "driver": robot.stack.pids["driver"],
            BARE: bare_node(held, str(domain)),
        }
        joystick = robot.node.source("cmd_vel_joy")
        joystick.message = joystick.kind()
        robot.node.spin_for(1.0)
        joystick.message.twist.linear.x, joystick.message.twist.angular.z = 0.1, 0.3
        robot.wait_speed(0.09)
        load = os.getloadavg()[0]
        found = measure(robot, url, pids, arguments.seconds, arguments.rounds)
    print(f"{arguments.rounds} rounds of {arguments.seconds:g} s of each kind; load before it {load:.1f}\n")
    print(table(found))
    ratio = median(found[USUAL]["canbase metrics"]) / median(found[USUAL][BARE])
    print(f"\none scrape a second: {ratio:.2f} of a bare node")
    return 0 if ratio <= BUDGET_OF_A_BARE_NODE else 1


if __name__ == "__main__":
    sys.exit(main())
