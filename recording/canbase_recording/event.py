"""What happened in a recording, one sentence each: changes of state, commands, emergencies, what is missing. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum


class EventKind(Enum):
    """What an event is about; the value is for people and for JSON."""

    NMT_COMMAND = "NMT command"
    BOOT_UP = "boot-up"
    NMT_STATE = "NMT state"
    HEARTBEAT_LOST = "heartbeat lost"
    HEARTBEAT_BACK = "heartbeat back"
    SYNC_LOST = "SYNC lost"
    SYNC_BACK = "SYNC back"
    EMERGENCY = "emergency"
    DRIVE_STATE = "drive state"
    CONTROL = "controlword"
    SDO_ABORT = "SDO abort"
    TRIP = "watchdog tripped"
    WATCHDOG = "watchdog"
    ERROR_FRAME = "error frame"
    COMMAND = "cmd_vel"
    FILTER = "safety filter"
    MUX = "velocity mux"
    DRIVER = "motor driver"
    TITLE = "recording"


class Level(IntEnum):
    """How much an event matters."""

    INFO = 0
    WARNING = 1
    ALARM = 2
    """It stops a base that moves, or a drive that has power: a stop begins with the first one."""


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened. `who`: the part or node that it is about, for people; `node_id` 0: no single node."""

    at_s: float
    kind: EventKind
    level: Level
    who: str
    text: str
    node_id: int = 0
