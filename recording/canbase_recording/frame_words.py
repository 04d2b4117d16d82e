"""One frame of a CANopen bus in words: CiA 301, CiA 305 (LSS), CiA 402, and the frames of canbase (docs/bus.md). Pure.

Any bytes are taken: what has no meaning is named so, and nothing is raised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address, Known, known_object
from canbase_config.eds_file import Eds
from canbase_config.object_map import CONTROLWORD, MODE, MODE_DISPLAY, STATUSWORD
from canbase_config.profile import Profile
from canbase_config.robot import DRIVER_NODE_ID, LSS_REQUEST, WATCHDOG_NODE_ID, Robot
from canbase_driver.cia301.emcy import emcy_text
from canbase_driver.cia301.frame import MAX_COB_ID, Frame
from canbase_driver.cia301.nmt import EMCY, HEARTBEAT, NMT, RPDO, SDO_TO_CLIENT, SDO_TO_SERVER, TPDO, NmtState
from canbase_driver.cia402 import Command, decode_statusword
from canbase_driver.supervision.watchdog_link import (
    ANSWERS,
    COUNTERS_COB_ID,
    LEASE_AGE_UNKNOWN,
    RESET_COB_ID,
    RESET_KEY,
    RUNGS,
    STATE_COB_ID,
    TRIPPED,
    WATCHING,
    parse_counters,
    parse_state,
)
from canbase_recording.entry import FrameKind, RecordedFrame
from canbase_recording.kind import Kind
from canbase_recording.pdo_layouts import Mapped, PdoLayout, PdoLayouts, Source
from canbase_recording.sdo_words import sdo_address, sdo_words

SYNC: Final = 0x080
QUICK_STOP_COB_ID: Final = 0x500
"""And a node id: RPDO4, which beside canbase's watchdog is its own (docs/bus.md)."""
TIME: Final = 0x100
LSS_ANSWER: Final = 0x7E4
NMT_COMMANDS: Final = {
    0x01: "start", 0x02: "stop", 0x80: "enter pre-operational", 0x81: "reset node", 0x82: "reset communication",
}  # fmt: skip
CONTROLWORDS: Final = {
    Command.DISABLE_VOLTAGE: "disable voltage",
    Command.QUICK_STOP: "quick stop",
    Command.SHUTDOWN: "shutdown",
    Command.SWITCH_ON: "switch on",
    Command.ENABLE_OPERATION: "enable operation",
    Command.FAULT_RESET: "fault reset",
}
_COMMAND_BITS: Final = (
    (0x80, 0x80, Command.FAULT_RESET), (0x82, 0x00, Command.DISABLE_VOLTAGE), (0x86, 0x02, Command.QUICK_STOP),
    (0x87, 0x06, Command.SHUTDOWN), (0x8F, 0x07, Command.SWITCH_ON), (0x8F, 0x0F, Command.ENABLE_OPERATION),
)  # fmt: skip
"""(mask, value, command) of CiA 402-2, controlword 6040h."""
HALT: Final = 1 << 8
_LSS: Final = {
    0x04: "switch state global", 0x11: "configure node id", 0x13: "configure bit timing", 0x15: "activate bit timing",
    0x17: "store configuration", 0x40: "select vendor id", 0x41: "select product code", 0x42: "select revision",
    0x43: "select serial number", 0x44: "selected", 0x46: "identify vendor id", 0x47: "identify product code",
    0x48: "identify lowest revision", 0x49: "identify highest revision", 0x4A: "identify lowest serial number",
    0x4B: "identify highest serial number", 0x4C: "identify non-configured", 0x4F: "identified",
    0x50: "non-configured node identified", 0x51: "fastscan", 0x5A: "inquire vendor id", 0x5B: "inquire product code",
    0x5C: "inquire revision", 0x5D: "inquire serial number", 0x5E: "inquire node id",
}  # fmt: skip
"""Command specifiers of CiA 305."""
_SHORT: Final = {
    CONTROLWORD: "controlword", STATUSWORD: "statusword", MODE: "mode", MODE_DISPLAY: "mode", 0x6064: "position",
    0x606C: "velocity", 0x60FF: "target velocity", 0x607A: "target position", 0x6077: "torque", 0x6078: "current",
}  # fmt: skip
"""Objects that PDOs have often, in a word."""


@dataclass(frozen=True, slots=True)
class FrameWords:
    """A frame in words. `node_id` 0: it is for all, or of none."""

    kind: Kind
    node_id: int
    text: str


class Decoder:
    """Knows the robot and the EDS files where they are given, and learns PDO mappings through `layouts`."""

    def __init__(self, layouts: PdoLayouts, robot: Robot | None = None, eds_files: Sequence[Eds] = ()) -> None:
        """`eds_files`: those of manufacturers first, then canbase's own."""
        self._layouts = layouts
        self._eds_files = tuple(eds_files)
        drives = robot.drives if robot else ()
        self._joints = {(drive.node_id, drive.axis): drive.joint for drive in drives}
        self._profiles: dict[int, Profile] = {drive.node_id: drive.kind for drive in drives}
        self._names: dict[tuple[int, Address], Known] = {}
        self._who: dict[tuple[int, int | None], str] = {}

    def words(self, frame: RecordedFrame) -> FrameWords:
        """Never raises, whatever the frame is."""
        cob_id, data = frame.cob_id, frame.data
        if frame.kind is FrameKind.ERROR:
            return FrameWords(Kind.ERROR, 0, f"error frame of the CAN controller: {data.hex(' ').upper() or 'no data'}")
        if frame.kind is FrameKind.EXTENDED or not 0 <= cob_id <= MAX_COB_ID:
            return FrameWords(Kind.OTHER, 0, "29-bit identifier: not CANopen's predefined connection set")
        if len(data) > 8:
            return FrameWords(Kind.OTHER, 0, f"{len(data)} bytes: CAN FD, not CANopen")
        if frame.kind is FrameKind.REMOTE:
            return _remote(cob_id)
        return self._data(cob_id, data)

    def known(self, node_id: int, at: Address) -> Known:
        """Name and type of an object of a node."""
        key = (node_id, at)
        if key not in self._names:
            if len(self._names) > MOST_NAMES:
                self._names.clear()
            self._names[key] = known_object(at, self._eds_files, self._profiles.get(node_id))
        return self._names[key]

    def who(self, node_id: int, axis: int | None = None) -> str:
        """A node for people: its joints where robot.yaml has them."""
        key = (node_id, axis)
        if key not in self._who:
            self._who[key] = self._who_is(node_id, axis)
        return self._who[key]

    def _who_is(self, node_id: int, axis: int | None) -> str:
        if node_id in _OURS:
            return _OURS[node_id]
        joints = [joint for (node, of), joint in self._joints.items() if node == node_id and axis in (None, of)]
        extra = f" axis {axis}" if axis and not joints else ""
        return f"node {node_id}{extra}" + (f" ({', '.join(joints)})" if joints else "")

    def emergency(self, node_id: int, code: int) -> str:
        """An EMCY code with its meaning, in the manufacturer's words where the profile has them."""
        profile = self._profiles.get(node_id)
        text = emcy_text(code, profile.emcy) if profile else emcy_text(code)
        return f"{code:04X}h {text}"

    def _data(self, cob_id: int, data: bytes) -> FrameWords:
        node_id, function = cob_id & 0x7F, cob_id & 0x780
        if cob_id in _BROADCAST:
            return _BROADCAST[cob_id](data)
        if cob_id in (STATE_COB_ID, COUNTERS_COB_ID, RESET_COB_ID) and (found := _watchdog(cob_id, data)):
            return found
        if not node_id:
            return FrameWords(Kind.OTHER, 0, f"no service of CiA 301 has {cob_id:03X}h")
        if function == EMCY:
            return FrameWords(Kind.EMCY, node_id, self._emcy(node_id, data))
        if function == HEARTBEAT:
            return FrameWords(Kind.HEARTBEAT, node_id, _heartbeat(data))
        if function in (SDO_TO_CLIENT, SDO_TO_SERVER):
            return FrameWords(Kind.SDO, node_id, self._sdo(node_id, data, by_client=function == SDO_TO_SERVER))
        if is_pdo(cob_id):
            return self._pdo(cob_id, data)
        return FrameWords(Kind.OTHER, node_id, f"no service of CiA 301 has {cob_id:03X}h")

    def _sdo(self, node_id: int, data: bytes, *, by_client: bool) -> str:
        at = sdo_address(data, by_client=by_client)
        known = self.known(node_id, at) if at is not None else Known()
        return sdo_words(data, known, by_client=by_client)

    def _emcy(self, node_id: int, data: bytes) -> str:
        if len(data) < 2:
            return f"EMCY of {len(data)} bytes: too short for a code"
        code = int.from_bytes(data[:2], "little")
        register = f", register {data[2]:02X}h" if len(data) > 2 else ""
        more = f", bytes {data[3:].hex(' ').upper()}" if any(data[3:]) else ""
        return f"EMCY {self.emergency(node_id, code)}{register}{more}"

    def _pdo(self, cob_id: int, data: bytes) -> FrameWords:
        layout = self._layouts.of(cob_id, len(data))
        if layout is None:
            return FrameWords(
                Kind.PDO, cob_id & 0x7F, f"{_pdo_name(cob_id)}, {len(data)} bytes: its mapping is not known"
            )
        values = ", ".join(self._mapped(layout, each, data) for each in layout.mapped)
        assumed = "" if not layout.source.is_assumed else " (assumed mapping)"
        return FrameWords(Kind.PDO, layout.node_id, f"{layout.name} {values}{assumed}")

    def _mapped(self, layout: PdoLayout, mapped: Mapped, data: bytes) -> str:
        value = mapped.value(data)
        if mapped.named is not None:
            unit = f" {mapped.named.unit}" if mapped.named.unit else ""
            return f"{mapped.named.name} {value * mapped.named.scale:g}{unit}"
        axis = f" axis {mapped.axis}" if mapped.axis else ""
        if mapped.base == STATUSWORD:
            state = decode_statusword(value)
            return f"statusword{axis} {value:04X}h {state.text if state else 'unknown state'}"
        if mapped.base == CONTROLWORD:
            return f"controlword{axis} {value:04X}h {controlword_text(value)}"
        name = _SHORT.get(mapped.base)
        if name is None:
            at = Address(mapped.index, mapped.sub)
            name = self.known(layout.node_id, at).name or str(at)
        return f"{name}{axis} {value}"


MOST_NAMES: Final = 10_000
_OURS: Final = {DRIVER_NODE_ID: "canbase's driver (node 127)", WATCHDOG_NODE_ID: "canbase's watchdog (node 126)"}


def controlword_command(word: int) -> Command | None:
    """The command in a controlword 6040h (CiA 402-2); None: its bits are none."""
    return next((command for mask, value, command in _COMMAND_BITS if word & mask == value), None)


def controlword_text(word: int) -> str:
    """A controlword for people."""
    command = controlword_command(word)
    return (CONTROLWORDS[command] if command else "no command") + (", halt" if word & HALT else "")


def nmt_text(data: bytes) -> str:
    """An NMT command for people."""
    if len(data) != 2:
        return f"NMT command of {len(data)} bytes, expected 2"
    whom = f"node {data[1]}" if data[1] else "all nodes"
    return f"NMT {NMT_COMMANDS.get(data[0], f'command {data[0]} that CiA 301 does not have')}, {whom}"


def _nmt(data: bytes) -> FrameWords:
    return FrameWords(Kind.NMT, data[1] if len(data) == 2 else 0, nmt_text(data))


def _sync(data: bytes) -> FrameWords:
    counter = f" {data[0]}" if len(data) == 1 else f" of {len(data)} bytes, expected 0 or 1" if data else ""
    return FrameWords(Kind.SYNC, 0, f"SYNC{counter}")


def _time(data: bytes) -> FrameWords:
    if len(data) != 6:
        return FrameWords(Kind.TIME, 0, f"TIME of {len(data)} bytes, expected 6")
    ms, days = int.from_bytes(data[:4], "little") & 0x0FFF_FFFF, int.from_bytes(data[4:], "little")
    return FrameWords(Kind.TIME, 0, f"TIME: day {days} since 1984-01-01, {ms / 1000.0:.3f} s after midnight")


def _lss(data: bytes) -> FrameWords:
    name = _LSS.get(data[0], f"command {data[0]:02X}h") if data else "without a command"
    value = int.from_bytes(data[1:5], "little") if len(data) >= 5 else 0
    return FrameWords(Kind.LSS, 0, f"LSS {name}{f', {value:08X}h' if value else ''}")


_BROADCAST: Final = {NMT: _nmt, SYNC: _sync, TIME: _time, LSS_ANSWER: _lss, LSS_REQUEST: _lss}


def _remote(cob_id: int) -> FrameWords:
    node_id = cob_id & 0x7F
    if cob_id & 0x780 == HEARTBEAT and node_id:
        return FrameWords(Kind.HEARTBEAT, node_id, "node guarding request")
    return FrameWords(Kind.OTHER, node_id, f"remote request of {cob_id:03X}h")


def _heartbeat(data: bytes) -> str:
    if len(data) != 1:
        return f"heartbeat of {len(data)} bytes, expected 1"
    state = nmt_state(data[0])
    if data[0] == NmtState.INITIALISING:
        return "boot-up"
    guarding = " (node guarding)" if data[0] & 0x80 else ""
    return f"heartbeat {state.text if state else f'of an unknown state {data[0]:02X}h'}{guarding}"


def nmt_state(byte: int) -> NmtState | None:
    """The NMT state in a heartbeat, or in an answer to node guarding, whose bit 7 toggles; None: no state."""
    return _STATES.get(byte & 0x7F)


_STATES: Final = {state.value: state for state in NmtState}


def _watchdog(cob_id: int, data: bytes) -> FrameWords | None:
    """None: it does not have the form of canbase's frame."""
    if cob_id == RESET_COB_ID and len(data) == 4 and data[1:] == RESET_KEY:
        return FrameWords(Kind.WATCHDOG, WATCHDOG_NODE_ID, f"reset request {data[0]}")
    if cob_id == COUNTERS_COB_ID and (counters := parse_counters(Frame(cob_id, data))):
        said = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counters.events.items())
        return FrameWords(Kind.WATCHDOG, WATCHDOG_NODE_ID, f"{said}, longest pause {counters.pause_max_ms} ms")
    state = parse_state(Frame(cob_id, data)) if cob_id == STATE_COB_ID else None
    if state is None:
        return None
    lease = "no lease" if state.lease_age_ms == LEASE_AGE_UNKNOWN else f"last lease {state.lease_age_ms} ms ago"
    about = f", node {state.node_id}" if state.node_id else ""
    said = {TRIPPED: f"tripped: {state.cause_text}{about}", WATCHING: "watching"}.get(state.state, "starting")
    rung = f", {RUNGS[state.rung]}" if 0 < state.rung < len(RUNGS) else ""
    answer = f", reset {state.answered}: {ANSWERS.get(state.answer, 'no answer')}" if state.answered else ""
    return FrameWords(Kind.WATCHDOG, WATCHDOG_NODE_ID, f"{said}{rung}, {lease}{answer}")


def is_pdo(cob_id: int) -> bool:
    """Of a PDO in the predefined connection set. CiA 301 lets no PDO have 101h to 180h and 780h to 7FFh."""
    return cob_id & 0x780 in (*TPDO, *RPDO)


def _pdo_name(cob_id: int) -> str:
    function = cob_id & 0x780
    return f"TPDO{TPDO.index(function) + 1}" if function in TPDO else f"RPDO{RPDO.index(function) + 1}"


def pdo_sources(layouts: PdoLayouts) -> dict[Source, list[int]]:
    """For people: by which knowledge which COB-IDs were decoded."""
    found: dict[Source, list[int]] = {}
    for cob_id, source in sorted(layouts.sources.items()):
        found.setdefault(source, []).append(cob_id)
    return found
