"""The process of `canbase serve metrics`: topics in, pages out, from its start to its end."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from canbase_base.sd_notify import Service
from canbase_config.robot import Robot
from canbase_fleet.exposition import Exposition
from canbase_fleet.http_server import Page, PageServer
from canbase_fleet.robot_topics import POLL_S, RobotTopics, end_signals, utc_now
from canbase_fleet.vda5050 import V2, V3, line, state
from canbase_runtime.private_process import guard_keys
from canbase_runtime.version import installed_version
from canbase_runtime.web_names import authority

NICENESS: Final = 10
"""Everything of the robot runs before this process."""
NODE: Final = "canbase_metrics"


def run(
    robot: Robot,
    address: tuple[str, int],
    ros_args: Sequence[str],
    when_ready: Callable[[str], None],
    more_names: Sequence[str] = (),
) -> str:
    """Serves until SIGINT or SIGTERM. Why it failed; empty: it did not. `when_ready`: gets the address of the pages.
    `more_names`: host names under which they may be opened, beside the address.

    Raises OSError where the address cannot be had, before ROS starts. Call from the main thread (signals).
    """
    guard_keys(os.environ)
    os.nice(NICENESS)
    topics: list[RobotTopics] = []
    server = PageServer(address, _pages(robot, topics), more_names)
    with end_signals() as ended:
        topics.append(RobotTopics(NODE, ros_args))
        serving = threading.Thread(target=server.serve_forever, name="http", daemon=True)
        serving.start()
        when_ready(f"http://{authority(address[0], server.server_port)}/metrics")
        service = Service()
        try:
            while not ended.wait(POLL_S):
                topics[0].poll(time.monotonic())
                if server.failure or not serving.is_alive():
                    return server.failure or "the thread of the HTTP server has ended"
                service.alive("serving", time.monotonic())
            service.stopping()
        finally:
            server.shutdown()
            server.server_close()
            topics[0].close()
    return ""


def _pages(robot: Robot, topics: Sequence[RobotTopics]) -> Mapping[str, Page]:
    version = installed_version()

    def vda5050(protocol: str) -> Page:
        def page(_plain: bool) -> tuple[bytes, str]:
            return f"{line(state(topics[0].view(), robot, utc_now(), protocol))}\n".encode(), "application/json"

        return page

    return {
        "/metrics": lambda plain: Exposition(topics[0].view(), robot, version).text(plain),
        "/vda5050/state": vda5050(V2),
        "/vda5050/v3/state": vda5050(V3),
    }
