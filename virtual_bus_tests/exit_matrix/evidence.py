"""Which parts report that they stopped the robot: stop events, the mux, the driver's status, and the logs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final

from canbase.msg import DriverStatus, MuxSource

from exit_matrix.driven_robot import Scene
from exit_matrix.log_evidence import NAMES, Catch, logged

STOPPED: Final = (DriverStatus.STOPPING, DriverStatus.LATCHED)
"""The driver reports a stop on stop_events when it is over, and in its status when it begins."""


class Evidence:
    """What was published and logged since this was made."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._since_s = time.monotonic()
        self._read = {part: len(scene.robot.stack.log(part)) for part in ("sim", *NAMES)}

    def catches(self) -> set[Catch]:
        """All of them."""
        robot = self._scene.robot
        events = {(event.stopped_by, event.cause) for event in robot.stop_events.since(self._since_s)}
        begun = {("motor_driver", s.cause) for s in robot.status.since(self._since_s) if s.state in STOPPED}
        stale = {("motor_driver", "command stale") for s in robot.status.since(self._since_s) if not s.command_fresh}
        silent = {("velocity_mux", f"{name} silent") for name in self._silent_sources()}
        return events | begun | stale | silent | set(logged({part: self._new(part) for part in self._read}))

    def _silent_sources(self) -> Iterator[str]:
        for state in self._scene.mux.since(self._since_s):
            for source in state.sources:
                if state.active == "" and source.standing == MuxSource.SILENT:
                    yield source.name

    def _new(self, part: str) -> str:
        return self._scene.robot.stack.log(part)[self._read[part] :]
