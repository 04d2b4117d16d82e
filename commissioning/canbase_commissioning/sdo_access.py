"""`canbase bus sdo`: the steps of reading or writing one object, and when a write is refused. CiA 301, CiA 402-2."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_commissioning.object_dictionary import Address, encode, statuswords
from canbase_config.drive import Drive
from canbase_config.object_map import (
    AXIS_OFFSET,
    STATUSWORD,
    place,
)
from canbase_config.robot import Robot
from canbase_config.scale_objects import SCALE_OBJECTS
from canbase_driver.boot.steps import Steps
from canbase_driver.boot.vl_settings import FACTOR
from canbase_driver.cia301.sdo_client import WRITE_ONLY, Read, SdoAborted, Write
from canbase_driver.cia402 import decode_statusword
from canbase_driver.drives.foreign_writes import COMMANDED


@dataclass(frozen=True, slots=True)
class Written:
    """A write that the drive took. None: the object cannot be read. `after` may differ: some drives round."""

    before: bytes | None
    after: bytes | None


@dataclass(frozen=True, slots=True)
class Refused:
    """A write that was not sent: `why`."""

    why: str


def read_object(at: Address) -> Steps[bytes]:
    """One object."""
    data: bytes = yield Read(at.index, at.sub)
    return data


def write_object(
    at: Address, text: str, kind: str, status_at: tuple[Address, ...], *, force: bool
) -> Steps[Written | Refused]:
    """Look whether a motor has power, write, read back.

    `kind` as in objects.TYPES; empty: as wide as the object is. Raises ValueError when `text` does not fit it.
    """
    powered = None if force else (yield from _powered(status_at))
    if powered is not None:
        return Refused(f"{powered} reports that a motor has power; a write now may move or stop it")
    before = yield from _read(at)
    if not kind and before is None:
        return Refused("its width is not known, and it cannot be read: give --type")
    data = encode(text, kind or f"u{8 * len(before or b'')}")
    yield Write(at.index, at.sub, data)
    return Written(before, (yield from _read(at)))


def beside_driver(node_id: int, at: Address, robot: Robot | None) -> str:
    """What becomes of a write to `at` of a node while canbase's driver runs on the bus.

    `robot`: None: not known; the generic profile counts.
    """
    drives = [drive for drive in robot.drives if drive.node_id == node_id] if robot else []
    if robot is not None and not drives:
        return f"Node {node_id} is no drive of robot.yaml, and the driver does not notice the write"
    if at.index in COMMANDED:
        return f"The driver sends {at} itself; while the motor has power, the watchdog stops the robot for such a write"
    if _is_compared(at.index, drives):
        return (
            f"After a write to {at} the driver boots node {node_id} anew, as soon as no motor of it has power. It gets "
            "no power where `expects` in robot.yaml has another value; without an entry there the new value counts. "
            "Until then the watchdog may stop the robot, because the write is a sign of another master"
        )
    return (
        f"After a write to {at} the driver boots node {node_id} anew, as soon as no motor of it has power, and "
        "what the boot sets gets its value again. Until then the watchdog may stop the robot, because the write is a "
        "sign of another master"
    )


def _is_compared(index: int, drives: list[Drive]) -> bool:
    """Whether the boot compares this object with `expects` of these drives and never sets it; it sets 604Ch."""
    of_an_axis = SCALE_OBJECTS.keys() - {FACTOR}
    noted = {each.index for drive in drives for each in drive.expects}
    return index in of_an_axis or index - AXIS_OFFSET in of_an_axis or index in noted


def status_places(node_id: int, robot: Robot | None) -> tuple[Address, ...]:
    """Where the statuswords of a node are, by its profile in robot.yaml; elsewhere where CiA 402-2 has them."""
    drives = [drive for drive in robot.drives if drive.node_id == node_id] if robot else []
    if not drives:
        return Address(STATUSWORD), Address(STATUSWORD + AXIS_OFFSET)
    places = (place(drive.kind, STATUSWORD, drive.axis) for drive in drives)
    return tuple(dict.fromkeys(Address(at.index, at.sub) for at in places))


def _powered(status_at: tuple[Address, ...]) -> Steps[Address | None]:
    """The first statusword of a motor with power. A node without statusword is no drive."""
    for at in status_at:
        try:
            data: bytes = yield Read(at.index, at.sub)
        except SdoAborted:
            continue
        states = [decode_statusword(word) for word in statuswords(data)]
        if any(state is None or state.has_torque for state in states):
            return at
    return None


def _read(at: Address) -> Steps[bytes | None]:
    try:
        data: bytes = yield Read(at.index, at.sub)
    except SdoAborted as refused:
        if refused.code != WRITE_ONLY:
            raise
        return None
    return data
