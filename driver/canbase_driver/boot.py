"""How one node is made ready, as a sequence of steps to be read from top to bottom. No bus and no time in here.

CiA 301 and CiA 402-2. It ends in NMT pre-operational and without torque: who starts the nodes, and when, is decided
elsewhere. `node_boot.py` runs it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from canbase_config.drive import Drive, Identity
from canbase_config.robot import DRIVER_NODE_ID, WATCHDOG_NODE_ID, Robot
from canbase_driver.boot_pdo import configure_pdos
from canbase_driver.boot_steps import BootError, NodeAccess, Pause, SendNmt, Steps, WaitBootUp, boot_error, unsigned
from canbase_driver.cia301 import NmtCommand
from canbase_driver.cia402 import Command, DriveState, axis_object, decode_statusword
from canbase_driver.pdo import CONTROLWORD, STATUSWORD, TARGET_VELOCITY, VELOCITY_ACTUAL, NodeLayout
from canbase_driver.sdo import Read, SdoError, SdoTimeout, Write
from canbase_driver.units import AxisUnits

DEVICE_TYPE, HEARTBEAT_CONSUMER, HEARTBEAT_PRODUCER, IDENTITY, ERROR_BEHAVIOUR = 0x1000, 0x1016, 0x1017, 0x1018, 0x1029
ABORT_CONNECTION_OPTION, QUICK_STOP_OPTION, FAULT_REACTION_OPTION, MODE = 0x6007, 0x605A, 0x605E, 0x6060
PROFILE_ACCELERATION, PROFILE_DECELERATION, QUICK_STOP_DECELERATION = 0x6083, 0x6084, 0x6085

PROFILE_402 = 0x0192
PROFILE_VELOCITY = 3
ENTER_PRE_OPERATIONAL_ON_LOSS = 0
QUICK_STOP_ON_LOSS = 3
DOWN_THE_QUICK_STOP_RAMP = 2

BOOT_UP_TIMEOUT_S = 5.0
POLL_S = 0.02
STANDING_POLLS = 5
"""A drive that stays in quick stop active stands when it is slow for so many polls on end."""
_CAN_BE_DISABLED = frozenset(
    (DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
)


@dataclass(frozen=True, slots=True)
class BootReport:
    """What was found and done. `notes` tell what the drive lacks, refused or changed without being unfit for it."""

    node_id: int
    identity: Identity
    stops_by_itself: bool
    """Whether the drive quick-stops when the watchdog's heartbeat is lost: 1016h:1 and 6007h are set and confirmed."""
    notes: tuple[str, ...]


def boot(node_id: int, drives: tuple[Drive, ...], robot: Robot) -> Steps[BootReport]:
    """All steps for one node, its used axes being `drives`. Raises ValueError when they are not one or two axes.

    The steps end with the report, or raise BootError when the node cannot be made ready.
    """
    return _explained(_Boot(node_id, drives, robot).run())


def _explained(steps: Steps[BootReport]) -> Steps[BootReport]:
    try:
        return (yield from steps)
    except SdoError as error:
        raise boot_error(error) from error


class _Boot:
    def __init__(self, node_id: int, drives: tuple[Drive, ...], robot: Robot) -> None:
        self._drives = tuple(sorted(drives, key=lambda drive: drive.axis))
        self._layout = NodeLayout(node_id, tuple(drive.axis for drive in self._drives))
        self._robot = robot
        self._node = NodeAccess(node_id)

    def run(self) -> Steps[BootReport]:
        yield from self._wait_for_the_drive()
        identity = yield from self._check_identity()
        yield from self._bring_to_a_stand()
        yield from self._reset_communication()
        for drive in self._drives:
            yield from self._configure_motion(drive)
        stops_by_itself = yield from self._configure_loss_of_heartbeat()
        yield from configure_pdos(self._node, self._layout)
        return BootReport(self._node.node_id, identity, stops_by_itself, tuple(dict.fromkeys(self._node.notes)))

    # -- what is there

    def _wait_for_the_drive(self) -> Steps[None]:
        """For ever. A node in NMT stopped does not answer, so it is sent to pre-operational."""
        while True:
            try:
                device_type = unsigned((yield Read(DEVICE_TYPE)))
                break
            except SdoTimeout:
                yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        if device_type & 0xFFFF != PROFILE_402:
            # Some real drives report another profile or none, so this alone is no reason to refuse.
            self._node.notes.append(f"1000h:0 is {device_type:08X}h, not the profile 402 (0192h) of a motor drive")

    def _check_identity(self) -> Steps[Identity]:
        found: dict[str, int | None] = {}
        for sub, name in enumerate(Identity.model_fields, start=1):
            found[name] = yield from self._node.read_if_present(IDENTITY, sub)
            for drive in self._drives:
                self._compare_identity(sub, name, found[name], getattr(drive.identity, name))
        return Identity(**found)

    def _compare_identity(self, sub: int, name: str, found: int | None, expected: int | None) -> None:
        if expected not in (None, found):
            found_text = "missing" if found is None else f"{found:08X}h"
            problem = f"1018h:{sub} ({name}) is {found_text}, expected {expected:08X}h"
            hint = "Another drive has this node id, or `identity` in robot.yaml is wrong"
            raise BootError(self._node.node_id, problem, hint)

    # -- nothing may move

    def _bring_to_a_stand(self) -> Steps[None]:
        """A drive may still be running from an earlier life of its master."""
        for drive in self._drives:
            if _has_torque((yield from _state(drive))):
                yield _control(drive, Command.QUICK_STOP)
        for drive in self._drives:
            yield from self._wait_for_standstill(drive)
        for drive in self._drives:
            if (yield from _state(drive)) in _CAN_BE_DISABLED:
                yield _control(drive, Command.DISABLE_VOLTAGE)

    def _wait_for_standstill(self, drive: Drive) -> Steps[None]:
        units = AxisUnits(drive, self._robot.base)
        slow = 0
        for _ in range(math.ceil(self._robot.timeouts.standstill_s / POLL_S)):
            if not _has_torque((yield from _state(drive))) or slow == STANDING_POLLS:
                return
            raw = int.from_bytes((yield Read(axis_object(VELOCITY_ACTUAL, drive.axis))), "little", signed=True)
            slow = slow + 1 if abs(units.velocity_mps(raw)) < self._robot.base.standstill_mps else 0
            yield Pause(POLL_S, f"{drive.joint} to stand after a quick stop")
        yield from self._give_up(drive)

    def _give_up(self, drive: Drive) -> Steps[None]:
        """Setpoints of whoever keeps it moving count no more, then the power goes."""
        yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        yield _control(drive, Command.DISABLE_VOLTAGE)
        problem = f"{drive.joint} did not stand {self._robot.timeouts.standstill_s:g} s after a quick stop"
        hint = "Its voltage is now disabled; look for another master, and at 605Ah and 6085h"
        raise BootError(self._node.node_id, problem, hint)

    def _reset_communication(self) -> Steps[None]:
        """Forgets what earlier masters set. Some drives keep a fault for a lost heartbeat until then."""
        for drive in self._drives:
            # With 6007h = 1 a drive takes the reset for the loss of its master, and goes into fault.
            if (yield from self._node.read_if_present(_on_loss(drive).index)) is not None:
                yield from self._node.set_if_present(_on_loss(drive))
        yield SendNmt(NmtCommand.RESET_COMMUNICATION)
        if not (yield WaitBootUp(BOOT_UP_TIMEOUT_S)):
            self._node.notes.append(f"no boot-up message within {BOOT_UP_TIMEOUT_S:g} s of NMT reset communication")
        yield SendNmt(NmtCommand.ENTER_PRE_OPERATIONAL)

    # -- how it moves, and when it stops by itself

    def _configure_motion(self, drive: Drive) -> Steps[None]:
        """A target of an earlier life would move the drive as soon as it is enabled: cleared, after the mode is set."""
        yield from self._node.set(Write(axis_object(MODE, drive.axis), 0, PROFILE_VELOCITY, 1))
        yield from self._node.set(Write(axis_object(TARGET_VELOCITY, drive.axis), 0, 0, 4))
        units = AxisUnits(drive, self._robot.base)
        for index, mps2 in self._ramps_mps2().items():
            ramp = Write(axis_object(index, drive.axis), 0, units.acceleration_raw(mps2), 4)
            yield from self._node.set_if_present(ramp)

    def _ramps_mps2(self) -> dict[int, float]:
        """The driver shapes the speed; the drive's own ramps bound a step, and must never lag behind in a curve."""
        limits, arm_m = self._robot.limits, self._robot.base.track_m / 2
        faster = limits.acceleration_mps2 + limits.angular_acceleration_radps2 * arm_m
        slower = limits.deceleration_mps2 + limits.angular_deceleration_radps2 * arm_m
        hardest = limits.emergency_deceleration_mps2
        return {
            PROFILE_ACCELERATION: max(faster, hardest),
            PROFILE_DECELERATION: max(slower, hardest),
            QUICK_STOP_DECELERATION: hardest,
        }

    def _configure_loss_of_heartbeat(self) -> Steps[bool]:
        """Whether the drive will stop by itself."""
        node, timeout_ms = self._node, round(1000 * self._robot.timeouts.drive_heartbeat_s)
        yield from node.set_if_present(Write(HEARTBEAT_PRODUCER, 0, round(timeout_ms / 3), 2))
        stops = yield from self._watch_heartbeats(timeout_ms)
        yield from node.set_if_present(Write(ERROR_BEHAVIOUR, 1, ENTER_PRE_OPERATIONAL_ON_LOSS, 1))
        for drive in self._drives:
            stops = (yield from node.set_if_present(_on_loss(drive))) and stops
            for index in (QUICK_STOP_OPTION, FAULT_REACTION_OPTION):
                ramp = Write(axis_object(index, drive.axis), 0, DOWN_THE_QUICK_STOP_RAMP, 2)
                yield from node.set_if_present(ramp)
        return stops

    def _watch_heartbeats(self, timeout_ms: int) -> Steps[bool]:
        """With one entry the watchdog is watched, which is silent when the driver is. Whether it is watched.

        No node may be in two entries, so those of an earlier life go first.
        """
        entries = (yield from self._node.read_if_present(HEARTBEAT_CONSUMER)) or 0
        if entries == 0:
            self._node.notes.append("1016h: the drive watches no heartbeat, it will not stop by itself")
            return False
        for sub in range(2, entries + 1):
            if (yield from self._node.read_if_present(HEARTBEAT_CONSUMER, sub)):
                yield from self._node.set_if_present(Write(HEARTBEAT_CONSUMER, sub, 0, 4))
        watchdog, driver = (node_id << 16 | timeout_ms for node_id in (WATCHDOG_NODE_ID, DRIVER_NODE_ID))
        is_watched = yield from self._node.set_if_present(Write(HEARTBEAT_CONSUMER, 1, watchdog, 4))
        if entries > 1:
            yield from self._node.set_if_present(Write(HEARTBEAT_CONSUMER, 2, driver, 4))
        return is_watched


def _state(drive: Drive) -> Steps[DriveState | None]:
    """Two-axis drives are known that give both statuswords in one object, this axis in the lower half."""
    return decode_statusword(unsigned((yield Read(axis_object(STATUSWORD, drive.axis)))) & 0xFFFF)


def _has_torque(state: DriveState | None) -> bool:
    return state is None or state.has_torque


def _on_loss(drive: Drive) -> Write:
    return Write(axis_object(ABORT_CONNECTION_OPTION, drive.axis), 0, QUICK_STOP_ON_LOSS, 2)


def _control(drive: Drive, command: Command) -> Write:
    return Write(axis_object(CONTROLWORD, drive.axis), 0, command.value, 2)
