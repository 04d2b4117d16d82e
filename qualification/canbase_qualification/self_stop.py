"""Which drives stop by themselves when driver and watchdog end, as their profiles state it. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Final

from canbase_config.drive import Drive
from canbase_config.profile import SelfStop
from canbase_config.robot import Robot
from canbase_config.stop_checks import DISABLE_VOLTAGE

MASTERS_DIE: Final = (
    "all processes: are killed", "cable: cut both ways", "cable: nothing reaches the drives",
    "cable: of one drive is cut", "all_processes_restart", "cable_cut", "cable_cut_to_drives", "cable_cut_one_drive",
)  # fmt: skip
"""Failures in which a drive receives neither driver nor watchdog."""


class StopsItself(Enum):
    """What the profile of a drive lets expect."""

    YES = "yes"
    UNPROVEN = "not proven"
    NO = "no"


@dataclass(frozen=True, slots=True)
class OwnStop:
    """One drive."""

    joint: str
    node_id: int
    title: str
    stops: StopsItself
    why: str


def own_stops(robot: Robot) -> tuple[OwnStop, ...]:
    """Every drive of the robot, in the order of robot.yaml."""
    return tuple(_own_stop(drive) for drive in robot.drives)


def _own_stop(drive: Drive) -> OwnStop:
    stops, why = _by_guarding(drive) if drive.kind.self_stop.node_guarding else _by_heartbeat(drive)
    if stops is not StopsItself.YES:
        stops, why = _by_vendor(drive, stops, why)
    return OwnStop(drive.joint, drive.node_id, drive.kind.title, stops, why)


def _by_guarding(drive: Drive) -> tuple[StopsItself, str]:
    if drive.kind.self_stop.abort_connection == "no":
        return (
            StopsItself.NO,
            "it monitors node guarding (100Ch) and has no 6007h: what its motor does then is not known",
        )
    keys = ("node_guarding", "abort_connection", "abort_connection_code")
    return _with_6007h(drive, "the watchdog guards it (100Ch, 100Dh)", keys)


def _by_heartbeat(drive: Drive) -> tuple[StopsItself, str]:
    own = drive.kind.self_stop
    if own.heartbeat_entries == 0:
        return StopsItself.NO, "it monitors no heartbeat (no 1016h)"
    if own.abort_connection == "no":
        return StopsItself.NO, "it monitors heartbeats (1016h) and has no 6007h: what its motor does then is not known"
    keys = ("heartbeat_entries", "abort_connection", "abort_connection_code")
    return _with_6007h(drive, "it monitors heartbeats (1016h)", keys)


def _with_6007h(drive: Drive, monitors: str, keys: tuple[str, ...]) -> tuple[StopsItself, str]:
    """What it does when it misses a master; `keys`: of self_stop, that this depends on."""
    open_keys = [key for key in keys if _open(drive, key)]
    if open_keys:
        missing = f"its profile does not know {', '.join(open_keys)}, or has no source for it"
        return StopsItself.UNPROVEN, f"{monitors}, with 6007h; {missing}"
    coasts = ", and coasts (6007h = 2)" if drive.kind.self_stop.abort_connection_code == DISABLE_VOLTAGE else ""
    return StopsItself.YES, f"{monitors} and stops by 6007h{coasts}"


def _open(drive: Drive, key: str) -> bool:
    """The profile does not know it, or has no source for it."""
    value = getattr(drive.kind.self_stop, key)
    return value is None or value == "probe" or drive.kind.is_unproven(f"self_stop.{key}")


def _by_vendor(drive: Drive, stops: StopsItself, why: str) -> tuple[StopsItself, str]:
    """The manufacturer's own time limit, if there is one that the boot sets."""
    own: SelfStop = drive.kind.self_stop
    if own.vendor_watchdog is None:
        return stops, why
    if own.vendor_watchdog.index is None:
        return stops, f"{why}; {own.vendor_watchdog.text} (only the manufacturer's tool sets it)"
    proven = not drive.kind.is_unproven("self_stop.vendor_watchdog")
    return (StopsItself.YES if proven else StopsItself.UNPROVEN), f"{own.vendor_watchdog.text}, set by the boot"
