"""Which part stopped the robot, from the logs of its processes. Pure: text in, catches out."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Final

NAMES: Final = {
    "driver": "motor_driver",
    "velocity": "safety_filter",
    "watchdog": "watchdog",
    "action-server": "drive_distance_server",
}
TRIPPED: Final = re.compile(r"tripped: ([a-z ]+?)(?:, node \d+)?:")
BEAT_LOST: Final = re.compile(r"(?:heartbeat of node \d+|life guarding) lost")
INJECTED: Final = "InjectedError"

Catch = tuple[str, str]
"""The part, and the cause."""


def logged(said: Mapping[str, str]) -> Iterator[Catch]:
    """`said`: the log of each part, of the simulated drives as `sim`."""
    for cause in TRIPPED.findall(said["watchdog"]):
        yield "watchdog", cause
    if BEAT_LOST.search(said["sim"]):
        yield "drives", "heartbeat lost"
    for part, name in NAMES.items():
        if INJECTED in said[part]:
            yield name, "exception"
    for line in said["action-server"].splitlines():
        if '"step": "ended"' in line:
            yield "drive_distance_server", json.loads(line[line.index("{") :])["error_code"]
