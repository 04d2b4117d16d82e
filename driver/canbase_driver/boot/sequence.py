"""How one node is made ready, as a sequence of steps to be read from top to bottom. No bus and no time in here.

CiA 301 and CiA 402-2. It ends in NMT pre-operational and without torque: when the nodes are started is decided
elsewhere. `node_boot.py` runs it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from canbase_config.drive import Drive, Identity
from canbase_config.object_map import AXIS_OFFSET, CONTROLWORD, PROFILE_402, STATUSWORD, VELOCITY_ACTUAL, place
from canbase_config.robot import Robot
from canbase_config.scale_objects import Expected
from canbase_config.stopping import standstill_s
from canbase_driver.boot.pdo_mapping import configure_pdos
from canbase_driver.boot.scale_check import check_scale
from canbase_driver.boot.sdo_channels import close_sdo_channels
from canbase_driver.boot.settings import (
    SelfStopSet,
    StopsBy,
    configure_motion,
    configure_self_stop,
    configure_sync,
    harmless_on_loss,
    write_all,
    write_at,
)
from canbase_driver.boot.steps import (
    NO_BOOT_TIMES,
    BootError,
    BootTimes,
    NodeAccess,
    Pause,
    Quiet,
    SendNmt,
    Steps,
    WaitBootUp,
    boot_error,
    unsigned,
)
from canbase_driver.cia301.nmt import NmtCommand
from canbase_driver.cia301.pdo import node_layout
from canbase_driver.cia301.sdo_client import DEVICE_STATE, Read, SdoAborted, SdoError, SdoTimeout, Write
from canbase_driver.cia402 import Command, DriveState, decode_statusword
from canbase_driver.drive_units import AxisUnits
from canbase_driver.motion.braking import Braking

DEVICE_TYPE, SOFTWARE, IDENTITY = 0x1000, 0x100A, 0x1018
NUMBERS = ("vendor_id", "product_code", "revision", "serial")
"""1018h:1 to 1018h:4."""

POLL_S = 0.02
CONTROLWORDS = range(CONTROLWORD, CONTROLWORD + 8 * AXIS_OFFSET, AXIS_OFFSET)
"""Of the eight axes that a node may have (CiA 402-2)."""
BUSY_S = 2.0
"""So long are the pauses of one boot together, before writes that the state of the drive forbade (0800 0022h) [s]."""
STANDING_POLLS = 5
"""A drive that stays in quick stop active is at standstill when this many polls in a row find it slow."""
_RESETS = {"communication": NmtCommand.RESET_COMMUNICATION, "node": NmtCommand.RESET_NODE}
_CAN_BE_DISABLED = frozenset(
    (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
)


@dataclass(frozen=True, slots=True)
class BootReport:
    """What was found and done. `notes`: what the drive lacks, refused or changed although it can still be used."""

    node_id: int
    identity: Identity
    self_stop: SelfStopSet
    """What makes the drive stop by itself without commands, set and confirmed."""
    notes: tuple[str, ...]
    changes: tuple[str, ...] = ()
    """Every object that had another value than wanted: the old one and the new one."""
    scale: Mapping[str, tuple[Expected, ...]] = field(default_factory=dict)
    """By joint: what its numbers mean, as far as the drive reports it."""
    unshown_mode: str = ""
    """One of the notes: 6061h does not show the mode that was set."""

    @property
    def stops_by_itself(self) -> bool:
        """Whether something makes it stop by itself."""
        return self.self_stop.by is not StopsBy.NOTHING


def boot(
    node_id: int, drives: tuple[Drive, ...], robot: Robot, learned: BootTimes = NO_BOOT_TIMES, *, identify: bool = True
) -> Steps[BootReport]:
    """All steps for one node, its used axes being `drives`. Raises ValueError when they are not one or two axes.

    `identify`: read all of 1018h, not just what `identity` in robot.yaml expects, and all units.

    The last steps read the units: an answer to a write that was requested twice comes before theirs. The steps end with
    the report, or raise BootError when the node cannot be made ready.
    """
    return _explained(_patient(_Boot(node_id, drives, robot, learned, identify).run()))


def _patient(steps: Steps[BootReport]) -> Steps[BootReport]:
    """A write that the state of the drive forbids is tried again, once at least: some drives are busy after a reset."""
    answer: Any = None
    refusal: SdoError | None = None
    pauses_left = round(BUSY_S / POLL_S)
    while True:
        try:
            step = steps.send(answer) if refusal is None else steps.throw(refusal)
        except StopIteration as end:
            report: BootReport = end.value
            return report
        answer = refusal = None
        try:
            answer = yield step
        except SdoError as error:
            refusal = error
        is_repeated = False
        while _may_be_repeated(step) and _is_of_state(refusal) and (pauses_left > 0 or not is_repeated):
            is_repeated, pauses_left = True, pauses_left - 1
            yield Pause(POLL_S, f"its state to allow {step}")
            try:
                answer, refusal = (yield step), None
            except SdoError as error:
                refusal = error


def _may_be_repeated(step: object) -> bool:
    """A controlword is not: another axis waits for its own."""
    return isinstance(step, Write) and step.index not in CONTROLWORDS


def _is_of_state(refusal: SdoError | None) -> bool:
    return isinstance(refusal, SdoAborted) and refusal.code == DEVICE_STATE


def _explained(steps: Steps[BootReport]) -> Steps[BootReport]:
    try:
        return (yield from steps)
    except SdoError as error:
        raise boot_error(error) from error


class _Boot:
    def __init__(
        self, node_id: int, drives: tuple[Drive, ...], robot: Robot, learned: BootTimes, identify: bool
    ) -> None:
        self._learned, self._identify = learned, identify
        self._drives = tuple(sorted(drives, key=lambda drive: drive.axis))
        self._layout = node_layout(node_id, self._drives, robot)
        self._kind = drives[0].kind
        self._robot = robot
        self._node = NodeAccess(node_id)

    def run(self) -> Steps[BootReport]:
        yield from self._wait_for_the_drive()
        identity = yield from self._check_identity()
        yield from self._bring_to_a_stand()
        yield from self._forget_earlier_masters()
        yield from close_sdo_channels(self._node, self._kind)
        yield from write_all(self._node, self._kind.writes.before_mapping)
        for drive in self._drives:
            yield from configure_motion(self._node, drive, self._robot)
        self_stop = yield from configure_self_stop(self._node, self._drives, self._robot)
        yield from configure_sync(self._node, self._kind, self._robot.bus.sync_counter)
        yield from configure_pdos(self._node, self._layout)
        yield from write_all(self._node, self._kind.writes.after_mapping)
        scale = {}
        for drive in self._drives:
            scale[drive.joint] = yield from check_scale(self._node, drive, identify=self._identify)
        notes = tuple(dict.fromkeys(self._node.notes))
        changes, unshown_mode = tuple(self._node.changes), self._node.unshown_mode
        return BootReport(self._node.node_id, identity, self_stop, notes, changes, scale, unshown_mode)

    # -- what is there

    def _wait_for_the_drive(self) -> Steps[None]:
        """For ever. A node in NMT stopped does not answer, so it is sent to pre-operational. A refusal is an answer."""
        device_type: int | None = None
        known = len(self._node.notes)
        while True:
            try:
                device_type = yield from self._node.read_if_present(DEVICE_TYPE)
                break
            except SdoTimeout:
                yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        if device_type is None and len(self._node.notes) == known:
            self._node.notes.append("it has no 1000h, which CiA 301 requires of every device")
        elif device_type is not None and device_type & 0xFFFF != PROFILE_402:
            # Some real drives report another profile or none, so this alone is no reason to refuse.
            self._node.notes.append(f"1000h:0 is {device_type:08X}h, not the profile 402 (0192h) of a motor drive")

    def _check_identity(self) -> Steps[Identity]:
        identity: dict[str, int | None] = {}
        for sub, name in enumerate(NUMBERS, start=1):
            if not self._identify and all(getattr(drive.identity, name) is None for drive in self._drives):
                continue
            identity[name] = yield from self._node.read_if_present(IDENTITY, sub)
            for drive in self._drives:
                text = "missing" if identity[name] is None else f"{identity[name]:08X}h"
                expected = getattr(drive.identity, name)
                self._compare(f"1018h:{sub} ({name})", identity[name], text, expected, f"{expected or 0:08X}h")
        return Identity(**identity, software=(yield from self._check_software()))

    def _check_software(self) -> Steps[str | None]:
        """Only where robot.yaml has an expected one: it takes a segmented transfer, and not every drive has it."""
        expected = [drive.identity.software for drive in self._drives if drive.identity.software is not None]
        if not expected:
            return None
        try:
            data: bytes = yield Read(SOFTWARE)
        except SdoAborted:
            data = b""
        software = data.decode("ascii", "replace").strip(" \0")
        for text in expected:
            self._compare("100Ah:0 (software)", software, f'"{software}"', text, f'"{text}"')
        return software or None

    def _compare(self, what: str, actual: object, text: str, expected: object, wanted: str) -> None:
        if expected not in (None, actual):
            hint = "Another drive or firmware has this node id, or `identity` in robot.yaml is wrong"
            raise BootError(self._node.node_id, f"{what} is {text}, expected {wanted}", hint)

    # -- nothing may move

    def _bring_to_a_stand(self) -> Steps[None]:
        """A drive may still be running from an earlier life of its master. Each axis gets its quick stop, whatever
        another one answers."""
        states: dict[str, DriveState | None] = {}
        refused: SdoError | None = None
        for drive in self._drives:
            try:
                states[drive.joint] = yield from _state(drive)
                if _has_torque(states[drive.joint]):
                    yield _control(drive, Command.QUICK_STOP)
            except SdoError as error:
                refused = refused or error
        if refused is not None:
            raise refused
        for drive in self._drives:
            if _has_torque(states[drive.joint]):
                yield from self._wait_for_standstill(drive)
                states[drive.joint] = yield from _state(drive)
            if states[drive.joint] in _CAN_BE_DISABLED:
                yield _control(drive, Command.DISABLE_VOLTAGE)

    def _wait_for_standstill(self, drive: Drive) -> Steps[None]:
        """Polls take longer than they count here: it has at least the time that it needs."""
        units, braking = AxisUnits(drive, self._robot.base), Braking(self._robot)
        slow = 0
        for poll in range(math.ceil(standstill_s(self._robot) / POLL_S)):
            if not _has_torque((yield from _state(drive))) or slow == STANDING_POLLS:
                return
            raw = int.from_bytes((yield _read(drive, VELOCITY_ACTUAL)), "little", signed=True)
            speed_mps, elapsed_s = abs(units.velocity_mps(raw)), poll * POLL_S
            if poll == 0:
                braking.begin(speed_mps, 0.0, elapsed_s, quick=True)
            slow = slow + 1 if speed_mps < self._robot.base.standstill_mps else 0
            if braking.fails(speed_mps, elapsed_s) and not slow:
                yield from self._give_up(drive, f"turns at {speed_mps:.3f} m/s {elapsed_s:.1f} s after a quick stop")
            yield Pause(POLL_S, f"{drive.joint} to stop after a quick stop")
        yield from self._give_up(drive, f"was not at standstill {standstill_s(self._robot):.1f} s after a quick stop")

    def _give_up(self, drive: Drive, what: str) -> Steps[None]:
        """First the setpoints of any other master are shut out, then the power goes."""
        yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        yield _control(drive, Command.DISABLE_VOLTAGE)
        hint = "Its voltage is now disabled; check for another master, and check its encoder, 605Ah and 6085h"
        raise BootError(self._node.node_id, f"{drive.joint} {what}", hint)

    def _forget_earlier_masters(self) -> Steps[None]:
        """What they set goes with an NMT reset. Some drives keep a fault for a lost heartbeat until then."""
        command = _RESETS.get(self._kind.start.reset)
        if command is not None:
            yield from self._make_reset_harmless()
            yield SendNmt(command)
            yield from self._wait_for_boot_up(command)
        yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)

    def _wait_for_boot_up(self, command: NmtCommand) -> Steps[None]:
        start, learned, notes = self._kind.start, self._learned, self._node.notes
        boot_up_s, settle_s = max(start.boot_up_s, learned.boot_up_s), max(start.settle_s, learned.settle_s)
        self._node.was_reset = yield WaitBootUp(boot_up_s)
        if not self._node.was_reset:
            name = command.name.lower().replace("_", " ")
            notes.append(f"no boot-up message within {boot_up_s:g} s of NMT {name}")
        if boot_up_s > start.boot_up_s:
            notes.append(f"it needs long for an NMT reset: set `start.boot_up_s: {boot_up_s:.1f}` in its drive profile")
        if settle_s > start.settle_s:
            notes.append(f"it sends two boot-up messages: set `start.settle_s: {settle_s:.1f}` in its drive profile")
        if settle_s:
            yield Quiet(settle_s)

    def _make_reset_harmless(self) -> Steps[None]:
        for drive in self._drives:
            write = harmless_on_loss(drive)
            if self._kind.self_stop.abort_connection == "no":
                continue
            value = yield from self._node.read_if_present(write.index, write.sub)
            if value is not None:
                yield from self._node.try_to_write(write, known=value)


def _state(drive: Drive) -> Steps[DriveState | None]:
    at = place(drive.kind, STATUSWORD, drive.axis)
    return decode_statusword(unsigned((yield _read(drive, STATUSWORD))) >> at.shift & 0xFFFF)


def _has_torque(state: DriveState | None) -> bool:
    return state is None or state.has_torque


def _read(drive: Drive, index: int) -> Read:
    at = place(drive.kind, index, drive.axis)
    return Read(at.index, at.sub)


def _control(drive: Drive, command: Command) -> Write:
    return write_at(drive, CONTROLWORD, command.value)
