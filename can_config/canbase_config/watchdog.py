"""What the watchdog process needs of robot.yaml, as plain values. Standard library only: the watchdog imports it."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class WatchedDrive:
    """One axis on the bus. `mps_per_bit`: rim speed of its wheel, forward positive, for one bit of 60FFh and 606Ch."""

    joint: str
    node_id: int
    axis: int
    side: str
    mps_per_bit: float


@dataclass(frozen=True)
class WatchdogConfig:
    """Everything that the watchdog knows. Times in seconds, speeds in m/s at the rim of the wheel.

    `lease_uid`: the only user whose leases count, None: the watchdog's own. `loop_late_s`: the watchdog trips when its
    own loop stood still for longer while a drive is enabled.
    """

    bus_arguments: dict[str, Any]
    drives: tuple[WatchedDrive, ...]
    track_m: float
    lease_socket: str
    lease_timeout_s: float
    drive_heartbeat_s: float
    feedback_timeout_s: float
    standstill_mps: float
    deceleration_mps2: float
    acceleration_mps2: float
    max_wheel_mps: float
    lease_uid: int | None = None
    loop_late_s: float = 0.1

    def to_json(self) -> str:
        """One line of JSON that `from_json` reads back."""
        return json.dumps(dataclasses.asdict(self))

    @staticmethod
    def from_json(text: str) -> WatchdogConfig:
        """The configuration from `to_json`. Raises TypeError or ValueError when it is not one."""
        values = json.loads(text)
        drives = tuple(WatchedDrive(**drive) for drive in values.pop("drives"))
        return WatchdogConfig(drives=drives, **values)
