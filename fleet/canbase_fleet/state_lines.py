"""The process of `canbase serve vda5050`: the state as JSON, a line when it changes and at least every PERIOD_S."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Final

from canbase_config.robot import Robot
from canbase_fleet.robot_topics import POLL_S, RobotTopics, end_signals, utc_now
from canbase_fleet.robot_view import RobotView
from canbase_fleet.vda5050 import V2, essence, line, state

NODE: Final = "canbase_vda5050"
PERIOD_S: Final = 1.0
PATIENCE_S: Final = 5.0
"""Of --once: the nodes find each other within that, on a busy computer too."""


def run(robot: Robot, ros_args: Sequence[str], once: bool, write: Callable[[str], None], version: str = V2) -> None:
    """Writes lines until SIGINT or SIGTERM. `once`: one, when every topic has come, or PATIENCE_S have passed.

    Call from the main thread (signals).
    """
    with end_signals() as ended:
        topics = RobotTopics(NODE, ros_args)
        try:
            began_s, last_s, before = time.monotonic(), -math.inf, None
            while not ended.wait(POLL_S):
                now_s = time.monotonic()
                topics.poll(now_s)
                view = topics.view()
                if once and not _is_whole(view) and now_s - began_s < PATIENCE_S:
                    continue
                if (new := essence(view, robot)) != before or now_s - last_s >= PERIOD_S:
                    before, last_s = new, now_s
                    write(line(state(view, robot, utc_now(), version)))
                if once:
                    return
        finally:
            topics.close()


def _is_whole(view: RobotView) -> bool:
    return all(last.fresh for last in view.topics.values())
