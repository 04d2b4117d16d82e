"""`canbase doctor`: what the boot of the driver would change in a node, found out without writing anything.

The boot's own steps run against the drive, but their writes stay here: what is read back is what would have been
written. So doctor and driver cannot disagree about what is right. CiA 301, CiA 402-2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeVar

from canbase_config.drive import Drive, Identity
from canbase_config.object_map import CONTROLWORD, STATUSWORD, TARGET_VELOCITY, place
from canbase_config.profile_file import guess
from canbase_config.robot import Robot
from canbase_driver.boot.pdo_mapping import configure_pdos
from canbase_driver.boot.scale_check import check_expected
from canbase_driver.boot.sdo_channels import close_sdo_channels
from canbase_driver.boot.sequence import IDENTITY, NUMBERS
from canbase_driver.boot.settings import configure_motion, configure_self_stop, configure_sync, write_all
from canbase_driver.boot.steps import BootError, NodeAccess, Steps, WaitBootUp, unsigned
from canbase_driver.cia301.pdo import node_layout
from canbase_driver.cia301.sdo_client import Read, SdoAborted, SdoError, Write
from canbase_driver.cia402 import DriveState, decode_statusword

T = TypeVar("T")
ERROR_CODE = 0x603F
COMMANDS = (CONTROLWORD, TARGET_VELOCITY)
"""What a driver that drives changes all the time."""


@dataclass(frozen=True, slots=True)
class Part:
    """One part of the configuration. `changes`: what the boot would write, with the old value; `notes`: what lacks."""

    changes: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    problem: str = ""
    """Why the drive cannot be configured like this; empty: it can."""


@dataclass(frozen=True, slots=True)
class Inspection:
    """One node as it is. `self_stop`: what makes it stop by itself once it is configured; empty: nothing."""

    node_id: int
    identity: Identity
    wrong_identity: str
    guessed: str | None
    states: dict[str, DriveState | None]
    """By joint."""
    error_codes: dict[str, int]
    """603Fh by joint, where the drive has it."""
    settings: Part
    pdos: Part
    self_stop_part: Part
    self_stop: str


def inspect(node_id: int, drives: tuple[Drive, ...], robot: Robot) -> Steps[Inspection]:
    """Reads everything that the boot looks at; writes nothing. `drives` are the used axes of the node.

    Ends with SdoTimeout when the node does not answer.
    """
    node = NodeAccess(node_id)
    identity = yield from _identity(node)
    states = {}
    for drive in drives:
        states[drive.joint] = yield from _state(drive)
    codes = yield from _error_codes(node, drives)
    settings = yield from _part(node_id, lambda access: _settings(access, drives, robot))
    pdos = yield from _part(node_id, lambda access: configure_pdos(access, node_layout(node_id, drives, robot)))
    stops: list[str] = []
    self_stop_part = yield from _part(node_id, lambda access: _self_stop(access, drives, robot, stops))
    return Inspection(
        node_id,
        identity,
        _compare(identity, drives),
        guess(identity.vendor_id, identity.product_code),
        states,
        codes,
        settings,
        pdos,
        self_stop_part,
        stops[0] if stops else "",
    )


def dry(steps: Steps[T]) -> Steps[T]:
    """The same steps, of which only the readings go out: writes, NMT commands and pauses stay here."""
    written: dict[tuple[int, int], bytes] = {}
    answer: Any = None
    while True:
        try:
            step = steps.throw(answer) if isinstance(answer, SdoError) else steps.send(answer)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        if isinstance(step, Write):
            written[step.index, step.sub] = step.data
            answer = b""
        elif isinstance(step, Read) and (step.index, step.sub) in written:
            answer = written[step.index, step.sub]
        elif isinstance(step, Read):
            answer = yield from _read(step)
        else:
            answer = True if isinstance(step, WaitBootUp) else None


def _read(step: Read) -> Steps[bytes | SdoAborted]:
    try:
        data: bytes = yield step
    except SdoAborted as refused:
        return refused
    return data


def _part(node_id: int, steps: Any) -> Steps[Part]:
    access = NodeAccess(node_id)
    problem = ""
    try:
        yield from dry(steps(access))
    except BootError as error:
        problem = str(error)
    except SdoAborted as refused:
        problem = str(refused)
    return Part(tuple(access.changes), tuple(dict.fromkeys(access.notes)), problem)


def _settings(access: NodeAccess, drives: tuple[Drive, ...], robot: Robot) -> Steps[None]:
    kind = drives[0].kind
    yield from close_sdo_channels(access, kind)
    yield from write_all(access, kind.writes.before_mapping)
    for drive in drives:
        yield from configure_motion(access, drive, robot)
    yield from configure_sync(access, kind, robot.bus.sync_counter)
    yield from write_all(access, kind.writes.after_mapping)
    for drive in drives:
        yield from check_expected(access, drive)
    moving = [place(kind, index, drive.axis) for index in COMMANDS for drive in drives]
    own = tuple(f"{at.index:04X}h:{at.sub}: " for at in moving)
    access.changes = [change for change in access.changes if not change.startswith(own)]


def _self_stop(access: NodeAccess, drives: tuple[Drive, ...], robot: Robot, found: list[str]) -> Steps[None]:
    found.append((yield from configure_self_stop(access, drives, robot)).text)


def _identity(node: NodeAccess) -> Steps[Identity]:
    found: dict[str, int | None] = {}
    for sub, name in enumerate(NUMBERS, start=1):
        found[name] = yield from node.read_if_present(IDENTITY, sub)
    return Identity.model_validate(found)


def _compare(found: Identity, drives: tuple[Drive, ...]) -> str:
    """What robot.yaml expects otherwise, in a sentence."""
    for drive in drives:
        for name in NUMBERS:
            expected, is_now = getattr(drive.identity, name), getattr(found, name)
            if expected not in (None, is_now):
                shown = "missing" if is_now is None else f"{is_now:X}h"
                return f"{name} is {shown}, robot.yaml expects {expected:X}h"
    return ""


def _state(drive: Drive) -> Steps[DriveState | None]:
    at = place(drive.kind, STATUSWORD, drive.axis)
    return decode_statusword(unsigned((yield Read(at.index, at.sub))) >> at.shift & 0xFFFF)


def _error_codes(node: NodeAccess, drives: tuple[Drive, ...]) -> Steps[dict[str, int]]:
    found = {}
    for drive in drives:
        offset = 0x800 * drive.axis if drive.kind.layout.second_axis == "offset" else 0
        code = yield from node.read_if_present(ERROR_CODE + offset)
        if code is not None:
            found[drive.joint] = code & 0xFFFF
    return found
