"""The services of CANopen that frames belong to. It imports nothing: the command line has them as an option."""

from __future__ import annotations

from enum import Enum


class Kind(Enum):
    """What service a frame belongs to; the values are those of `canbase bus dump --kind`."""

    __hash__ = object.__hash__

    NMT = "nmt"
    SYNC = "sync"
    EMCY = "emcy"
    TIME = "time"
    PDO = "pdo"
    SDO = "sdo"
    HEARTBEAT = "heartbeat"
    LSS = "lss"
    WATCHDOG = "watchdog"
    """Of canbase: 1FEh, 2FEh and 27Eh."""
    ERROR = "error"
    OTHER = "other"
