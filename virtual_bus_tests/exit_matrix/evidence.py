"""Who says that it stopped the robot: stop events, the mux, the driver's status, and what the processes have logged."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Iterator
from typing import Final

from exit_matrix.scene import Scene

NAMES: Final = {
    "driver": "motor_driver",
    "velocity": "safety_filter",
    "watchdog": "watchdog",
    "action-server": "drive_distance_server",
}
TRIPPED: Final = re.compile(r"tripped: ([a-z ]+?)(?:, node \d+)?:")
BEAT_LOST: Final = re.compile(r"heartbeat of node \d+ lost")
INJECTED: Final = "InjectedError"
SILENT: Final = "silent"

Catch = tuple[str, str]
"""Who, and the cause."""


class Evidence:
    """What has been said since this was made."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._since_s = time.monotonic()
        self._read = {part: len(scene.robot.stack.log(part)) for part in ("sim", *NAMES)}

    def catches(self) -> set[Catch]:
        """All of them."""
        robot = self._scene.robot
        events = {(event.stopped_by, event.cause) for event in robot.stop_events.since(self._since_s)}
        stale = {("motor_driver", "command stale") for s in robot.status.since(self._since_s) if not s.command_fresh}
        silent = {("velocity_mux", f"{name} silent") for name in self._silent_sources()}
        return events | stale | silent | set(self._logged())

    def _silent_sources(self) -> Iterator[str]:
        for state in self._scene.mux.since(self._since_s):
            for source in state.sources:
                if state.active == "" and source.reason.startswith(SILENT):
                    yield source.name

    def _logged(self) -> Iterator[Catch]:
        for cause in TRIPPED.findall(self._new("watchdog")):
            yield "watchdog", cause
        if BEAT_LOST.search(self._new("sim")):
            yield "drives", "heartbeat lost"
        for part, name in NAMES.items():
            if INJECTED in self._new(part):
                yield name, "exception"
        for line in self._new("action-server").splitlines():
            if '"step": "ended"' in line:
                yield "drive_distance_server", json.loads(line[line.index("{") :])["error_code"]

    def _new(self, part: str) -> str:
        return self._scene.robot.stack.log(part)[self._read[part] :]
