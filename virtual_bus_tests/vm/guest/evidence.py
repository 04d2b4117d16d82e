"""Who says that it stopped the robot: stop events, the mux, the driver's status, and the journal of the units."""

from __future__ import annotations

import json
import time
from collections import deque
from typing import Any, Final

from canbase.msg import DriverStatus, MuxSource, MuxState, StopEvent
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from exit_matrix.log_evidence import NAMES, Catch, logged
from vm.guest.system import run, unit

UNITS: Final = {"canbase-sim.service": "sim", **{unit(part): part for part in NAMES}}
KEPT: Final = 2000
"""Messages."""


class Evidence:
    """What was heard on topics lately, and what the units have logged."""

    def __init__(self, node: Node) -> None:
        self._heard: deque[tuple[float, Catch]] = deque(maxlen=KEPT)
        events = QoSProfile(depth=20, durability=DurabilityPolicy.VOLATILE)
        node.create_subscription(StopEvent, "stop_events", self._on_stop, events)
        node.create_subscription(MuxState, "velocity_mux/state", self._on_mux, 10)
        node.create_subscription(DriverStatus, "motor_driver/status", self._on_status, 10)

    def since(self, moment_s: float) -> set[Catch]:
        """All who say that they have acted since then (monotonic)."""
        wall_s = time.time() - (time.monotonic() - moment_s)
        heard = {catch for at_s, catch in self._heard if at_s >= moment_s}
        return heard | set(logged(_journal(wall_s)))

    def _on_stop(self, event: StopEvent) -> None:
        self._note(event.stopped_by, event.cause)

    def _on_mux(self, state: MuxState) -> None:
        for source in state.sources:
            if state.active == "" and source.standing == MuxSource.SILENT:
                self._note("velocity_mux", f"{source.name} silent")

    def _on_status(self, status: DriverStatus) -> None:
        if not status.command_fresh:
            self._note("motor_driver", "command stale")

    def _note(self, who: str, cause: str) -> None:
        self._heard.append((time.monotonic(), (who, cause)))


def _journal(since_s: float) -> dict[str, str]:
    """What each part has logged since then (Unix time), the simulated drives as `sim`."""
    words = [word for name in UNITS for word in ("-u", name)]
    fields = "--output-fields=_SYSTEMD_UNIT,MESSAGE"
    text = run("journalctl", "-b", "-q", "-o", "json", fields, f"--since=@{since_s:.3f}", *words)
    said: dict[str, list[str]] = {part: [] for part in UNITS.values()}
    for line in text.splitlines():
        entry: dict[str, Any] = json.loads(line)
        part = UNITS.get(entry.get("_SYSTEMD_UNIT", ""))
        if part and isinstance(entry.get("MESSAGE"), str):
            said[part].append(entry["MESSAGE"])
    return {part: "\n".join(lines) for part, lines in said.items()}
