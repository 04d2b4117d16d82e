"""The few CAN frames that the watchdog reads and writes, byte by byte. Sources: CiA 301, CiA 402 and docs/bus.md.

Written a second time on purpose, apart from the driver's: a wrong byte order there must not be wrong here too.
"""

from __future__ import annotations

import enum
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.watchdog import WatchedLayout

NMT = 0x000
SYNC = 0x080
STATE = 0x1FE
COUNTERS = 0x2FE
RESET_REQUEST = 0x27E
SDO_ANSWER = 0x580
SDO_REQUEST = 0x600
HEARTBEAT = 0x700
LSS_REQUEST = 0x7E5
"""Sets node ids and bit rates (CiA 305)."""
DRIVER_HEARTBEAT = 0x77F
WATCHDOG_HEARTBEAT = 0x77E

STATUS_TPDO = (0x180, 0x380)
"""6041h u16, 6064h i32 of the node's first and second axis; then 606Ch or 6044h i16 where it has no TPDO of its own."""
VELOCITY_TPDO = (0x280, 0x480)
"""606Ch i32 of the node's first and second axis, and 6077h or 6078h i16 of a drive that reports its torque."""
RATED = 1000.0
"""6077h and 6078h at rated torque."""
SETPOINT_RPDO = (0x200, 0x300)
"""6040h u16, 60FFh i32 of the node's first and second axis, sent by the driver."""
QUICK_STOP_RPDO = 0x500
"""6040h u16 of every used axis, sent by the watchdog: quick stop, or disable voltage."""

PRE_OPERATIONAL_COMMAND, RESET_NODE_COMMAND = 0x80, 0x81
BOOT_UP = b"\x00"
"""What a node sends in place of its heartbeat when it starts."""
OPERATIONAL = 5
TOGGLE = 0x80
"""Bit of an answer to a guard request: it alternates from one answer to the next."""
NMT_COMMANDS = (0x01, 0x02, 0x80, 0x81, 0x82)

CONTROLWORD = 0x6040
STATUSWORD = 0x6041
POSITION = 0x6064
VELOCITY = 0x606C
VL_VELOCITY = 0x6044
"""That of mode 2 (CiA 402-2)."""
AXIS_OFFSET = 0x800
QUICK_STOP_WORD = 0x0002
DISABLE_VOLTAGE_WORD = 0x0000

LEASE_AGE_UNKNOWN = 0xFFFF

CIA_402 = WatchedLayout()
"""Where CiA 402-2 has the objects."""

_STATUS = {False: struct.Struct("<Hi"), True: struct.Struct("<Ii")}
"""By whether the statusword is packed."""
_SETPOINT = {16: struct.Struct("<Hh"), 32: struct.Struct("<Hi")}
_VELOCITY = {16: struct.Struct("<h"), 32: struct.Struct("<i")}
_JOINED = struct.Struct("<Hih")
_TORQUE = struct.Struct("<h")
TORQUE_BYTES = 2
_U16 = struct.Struct("<H")
_SDO_HEAD = struct.Struct("<BHB")
_STATE = struct.Struct("<BBBBHBB")
_COUNTERS = struct.Struct("<HHHBB")


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame with an 11-bit identifier. `remote`: without data, it requests the frame with that identifier."""

    cob_id: int
    data: bytes
    remote: bool = False


class DriveState(enum.Enum):
    """States of CiA 402, object 6041h: (mask, value) of the statusword."""

    NOT_READY_TO_SWITCH_ON = (0x4F, 0x00)
    SWITCH_ON_DISABLED = (0x4F, 0x40)
    READY_TO_SWITCH_ON = (0x6F, 0x21)
    SWITCHED_ON = (0x6F, 0x23)
    OPERATION_ENABLED = (0x6F, 0x27)
    QUICK_STOP_ACTIVE = (0x6F, 0x07)
    FAULT_REACTION_ACTIVE = (0x4F, 0x0F)
    FAULT = (0x4F, 0x08)


BRAKES_HARD, ARMED = 0x40, 0x80
"""Bits of byte 2 of the state frame, above the rung."""


def is_powered(state: DriveState | None) -> bool:
    """It is a state in which the motor has current."""
    stops = state is DriveState.QUICK_STOP_ACTIVE or state is DriveState.FAULT_REACTION_ACTIVE
    return stops or state is DriveState.OPERATION_ENABLED


def decode_state(statusword: int) -> DriveState | None:
    """The state in a statusword 6041h; None: bits that no state has."""
    for mask, value, state in _STATES:
        if statusword & mask == value:
            return state
    return None


_STATES: tuple[tuple[int, int, DriveState], ...] = tuple((*state.value, state) for state in DriveState)


def asks_for_power(controlword: int) -> bool:
    """True for the command "enable operation" (6040h bits 7, 3, 2, 1, 0 = 0 1 1 1 1)."""
    return controlword & 0x8F == 0x0F


def decode_status(data: bytes, layout: WatchedLayout = CIA_402, axis: int = 0) -> tuple[int, int] | None:
    """Statusword 6041h of an axis and position 6064h of a status TPDO, with a velocity behind it or not; None: of
    another length."""
    form = _STATUS[layout.packed_statusword]
    if len(data) != form.size and decode_joined_velocity(data, layout) is None:
        return None
    statusword, counts = form.unpack_from(data)
    return own_statusword(statusword, layout, axis), counts


def decode_joined_velocity(data: bytes, layout: WatchedLayout = CIA_402) -> int | None:
    """Velocity 606Ch or 6044h behind the position of a status TPDO; None: there is none in it. It must have 16 bits."""
    if len(data) != _JOINED.size or layout.packed_statusword or layout.velocity_bits != 16:
        return None
    return int(_JOINED.unpack(data)[2])


def own_statusword(value: int, layout: WatchedLayout, axis: int) -> int:
    """The half of a packed 6041h that is this axis's; any other 6041h as it is."""
    return value >> 16 * axis & 0xFFFF if layout.packed_statusword else value


def decode_velocity(data: bytes, layout: WatchedLayout = CIA_402) -> int | None:
    """Velocity 606Ch of a velocity TPDO in the drive's own unit, with a torque behind it or not; None: of another
    length."""
    form = _VELOCITY[layout.velocity_bits]
    beyond = len(data) - form.size
    return int(form.unpack_from(data)[0]) if beyond == 0 or beyond == TORQUE_BYTES else None


def decode_torque(data: bytes, layout: WatchedLayout = CIA_402) -> float | None:
    """Torque of a velocity TPDO as a share of the rated one; None: there is none in it."""
    form = _VELOCITY[layout.velocity_bits]
    size = form.size
    return _TORQUE.unpack_from(data, size)[0] / RATED if len(data) == size + TORQUE_BYTES else None


def own_velocity(value: int, layout: WatchedLayout = CIA_402) -> int:
    """606Ch or 6044h out of an SDO answer, which may leave its size out: then it has four bytes (CiA 301)."""
    half = 1 << layout.velocity_bits - 1
    return (value + half) % (2 * half) - half


def decode_setpoint(data: bytes, layout: WatchedLayout = CIA_402) -> tuple[int, int] | None:
    """Controlword 6040h and target 60FFh of the driver's RPDO, in the drive's own unit; None: of another length."""
    form = _SETPOINT[layout.target_bits]
    if len(data) != form.size:
        return None
    controlword, target = form.unpack(data)
    return controlword, target


def decode_sdo(data: bytes) -> tuple[tuple[int, int], int] | None:
    """Index and sub-index, signed value of an expedited upload answer (CiA 301: byte 0 = 0100nn1s), else None."""
    if len(data) != 8 or data[0] & 0xF2 != 0x42:
        return None
    _, index, sub_index = _SDO_HEAD.unpack_from(data)
    size = 4 - (data[0] >> 2 & 0x03) if data[0] & 0x01 else 4
    return (index, sub_index), int.from_bytes(data[4 : 4 + size], "little", signed=True)


_OF_MOTION = frozenset(index % AXIS_OFFSET for index in (CONTROLWORD, STATUSWORD, POSITION, VELOCITY, VL_VELOCITY))


def decode_sdo_download(data: bytes) -> int | None:
    """Index that an SDO request begins to write (CiA 301: initiate download, byte 0 = 001xxxxx, or initiate block
    download, 11000xx0), else None."""
    if len(data) != 8 or (data[0] & 0xE0 != 0x20 and data[0] & 0xF9 != 0xC0):
        return None
    return int(_SDO_HEAD.unpack_from(data)[1])


def concerns_motion(data: bytes) -> bool:
    """True for an SDO request as the watchdog sends them: it begins to read or write 6040h, 6041h, 6064h, 606Ch
    or 6044h."""
    return len(data) == 8 and data[0] >> 5 in (1, 2) and _SDO_HEAD.unpack_from(data)[1] % AXIS_OFFSET in _OF_MOTION


def takes_power_away(data: bytes) -> bool:
    """True for an SDO request that writes "disable voltage" or "quick stop" (6040h bits 2, 1 are not both set), with
    the value in this frame (expedited)."""
    size = 4 - (data[0] >> 2 & 3) if data[0] & 0x03 == 0x03 else 4
    return data[0] & 0xE2 == 0x22 and int.from_bytes(data[4 : 4 + min(size, 2)], "little") & 0x06 != 0x06


def decode_nmt(data: bytes) -> tuple[int, int] | None:
    """Command and node (0: all) of an NMT frame; None: CiA 301 knows no such command."""
    if len(data) != 2 or data[0] not in NMT_COMMANDS:
        return None
    return data[0], data[1]


def decode_reset_request(data: bytes) -> int | None:
    """Number (1–255) of a reset request; None: it is none."""
    if len(data) != 4 or data[1:] != b"RST" or data[0] == 0:
        return None
    return data[0]


def heartbeat() -> Frame:
    """The watchdog's own heartbeat: operational."""
    return Frame(WATCHDOG_HEARTBEAT, bytes([OPERATIONAL]))


def guard_request(node_id: int) -> Frame:
    """Node guarding: requests the NMT state of a node (CiA 301, 7.2.8.2.2)."""
    return Frame(HEARTBEAT + node_id, b"", remote=True)


def decode_guard_answer(data: bytes) -> tuple[bytes, int] | None:
    """What a heartbeat would contain, and the toggle bit, of an answer to a guard request or a boot-up; None: neither.

    A boot-up has no toggle bit, and no node in that state answers.
    """
    if len(data) != 1 or data[0] == TOGGLE:
        return None
    return bytes([data[0] & ~TOGGLE]), data[0] & TOGGLE


def state(
    number: int,
    cause: int,
    rung: int,
    node_id: int,
    lease_age_s: float,
    reset: tuple[int, int],
    *,
    armed: bool = False,
    brakes_hard: bool = False,
) -> Frame:
    """The state frame. `lease_age_s` above 65.534 s (infinity too) is sent as unknown; `reset`: number, answer.

    `armed`: the record on disk is LIVE. `brakes_hard`: the driver has to brake with the emergency deceleration.
    """
    age_ms = int(max(lease_age_s, 0.0) * 1000.0) if lease_age_s < 65.535 else LEASE_AGE_UNKNOWN
    bits = (ARMED if armed else 0) | (BRAKES_HARD if brakes_hard else 0)
    return Frame(STATE, _STATE.pack(number, cause, rung | bits, node_id, age_ms, *reset))


def counters(refused: int, dropped: int, bus_errors: int, trips: int, gap_s: float) -> Frame:
    """The frame of counters; each stays at its greatest number when it has come so far. `gap_s`: longest pause."""
    words = (min(number, 0xFFFF) for number in (refused, dropped, bus_errors))
    return Frame(COUNTERS, _COUNTERS.pack(*words, min(trips, 0xFF), min(round(gap_s * 1000.0), 0xFF)))


def quick_stop(node_id: int, axis_count: int, layout: WatchedLayout = CIA_402) -> Frame:
    """Quick stop for every used axis of a node, by the PDO that is the watchdog's own."""
    return _own_pdo(node_id, axis_count, layout, QUICK_STOP_WORD)


def disable_voltage(node_id: int, axis_count: int, layout: WatchedLayout = CIA_402) -> Frame:
    """Power off for every used axis of a node, by the same PDO."""
    return _own_pdo(node_id, axis_count, layout, DISABLE_VOLTAGE_WORD)


def _own_pdo(node_id: int, axis_count: int, layout: WatchedLayout, word: int) -> Frame:
    return Frame(QUICK_STOP_RPDO + node_id, _U16.pack(word) * (1 if layout.shared_controlword else axis_count))


def pre_operational(node_id: int) -> Frame:
    """NMT: the node leaves OPERATIONAL, so that no master's PDO counts there any more."""
    return Frame(NMT, bytes([PRE_OPERATIONAL_COMMAND, node_id]))


def reset_node(node_id: int) -> Frame:
    """NMT: the node restarts, as after power on. It forgets what was not saved, 1016h and its PDOs included."""
    return Frame(NMT, bytes([RESET_NODE_COMMAND, node_id]))


def place_of(index: int, axis: int, layout: WatchedLayout = CIA_402) -> tuple[int, int]:
    """Index and sub-index of 6040h, 6041h, 6064h or 606Ch of an axis; 6044h in place of 606Ch in mode 2."""
    if index == VELOCITY and layout.vl:
        index = VL_VELOCITY
    if not layout.sub_index:
        return index + axis * AXIS_OFFSET, 0
    is_common = (index == CONTROLWORD and layout.shared_controlword) or (
        index == STATUSWORD and layout.packed_statusword
    )
    return index, 0 if is_common else axis + 1


def write_controlword(node_id: int, axis: int, word: int, layout: WatchedLayout = CIA_402) -> Frame:
    """SDO request: expedited download of two bytes to 6040h of an axis."""
    head = _SDO_HEAD.pack(0x2B, *place_of(CONTROLWORD, axis, layout))
    return Frame(SDO_REQUEST + node_id, head + _U16.pack(word) + bytes(2))


def read_feedback(node_id: int, axis: int, layout: WatchedLayout = CIA_402) -> Sequence[Frame]:
    """SDO requests: uploads of statusword 6041h, position 6064h and velocity 606Ch of an axis."""
    heads = (_SDO_HEAD.pack(0x40, *place_of(index, axis, layout)) for index in (STATUSWORD, POSITION, VELOCITY))
    return tuple(Frame(SDO_REQUEST + node_id, head + bytes(4)) for head in heads)
