"""Who answers on the bus, with every answer kept: node ids, two drives with one of them, identities, power. Pure.

On a real cable two drives with one node id that answer at the same moment with the same bits look like one, and with
different bits they destroy each other's frames, up to bus-off. So what such drives answer alike is read first, and the
serial number only of nodes that have shown no second drive: docs/decisions/0099.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from canbase_commissioning.conversation import ConversationError, Exchange, Progress, Talk
from canbase_commissioning.lss.protocol import Identity
from canbase_commissioning.object_dictionary import statuswords
from canbase_config.object_map import AXIS_OFFSET, STATUSWORD
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import MAX_NODE_ID, SDO_TO_CLIENT, SDO_TO_SERVER
from canbase_driver.cia402 import decode_statusword

ATTEMPTS: Final = 3
WAIT_S: Final = 0.25
"""For answers, after the last request [s]; twice as long in the attempts that follow."""
_UPLOAD, _ABORT = 0x40, 0x80
_FRAME_BITS: Final = 135
ALL: Final = tuple(range(1, MAX_NODE_ID + 1))


@dataclass(frozen=True, slots=True)
class Answers:
    """What came from one node id for one object. `values`: each answer's bytes; None: refused, or longer than 4."""

    requests: int
    values: tuple[bytes | None, ...]

    @property
    def is_twice(self) -> bool:
        """More answers than requests: two drives have this node id."""
        return len(self.values) > self.requests


@dataclass(frozen=True, slots=True)
class Census:
    """Node ids that answer SDO. `twins`: where more than one drive does. `identities`: of the others, where known."""

    node_ids: tuple[int, ...]
    twins: frozenset[int] = frozenset()
    identities: dict[int, Identity] = field(default_factory=dict)
    kinds: frozenset[tuple[int, int, int]] = frozenset()
    """Vendor, product code and revision of all of them."""


def take_census(bitrate: int, *, one_drive_each: bool) -> Talk[Census]:
    """All node ids, 1 to 127. `one_drive_each`: LSS has just given each drive a node id of its own.

    Otherwise the serial number is not read where only one node id answers, as it may be that of all drives.
    """
    yield Progress("who answers SDO", 0, 5)
    present = yield from read(ALL, 0x1000, 0, bitrate, attempts=2)
    parts: dict[int, list[int]] = {node_id: [] for node_id in present}
    twins = {node_id for node_id, answers in present.items() if answers.is_twice}
    for sub in range(1, 5):
        yield Progress(f"identity, 1018h:{sub}", sub, 5)
        if sub == 4 and len(present) == 1 and not one_drive_each:
            continue
        asked = [node_id for node_id in present if sub < 4 or node_id not in twins]
        for node_id, answers in (yield from read(asked, 0x1018, sub, bitrate)).items():
            number = _number(answers)
            if answers.is_twice:
                twins.add(node_id)
            if number is not None:
                parts[node_id].append(number)
    identities = {n: Identity(*of) for n, of in parts.items() if len(of) == 4 and n not in twins}
    kinds = {(of[0], of[1], of[2]) for of in parts.values() if len(of) >= 3}
    return Census(tuple(present), frozenset(twins), identities, frozenset(kinds))


def require_no_power(node_ids: Iterable[int], bitrate: int) -> Talk[None]:
    """Raises ConversationError where a motor has power, or a node does not report whether it has: no drive, perhaps."""
    remaining = list(node_ids)
    for at in (STATUSWORD, STATUSWORD + AXIS_OFFSET):
        answered = yield from read(remaining, at, 0, bitrate)
        silent = [node_id for node_id in remaining if node_id not in answered]
        if silent:
            raise ConversationError(
                f"node {', '.join(map(str, silent))} does not answer {at:04X}h: whether it has power is unknown"
            )
        if at == STATUSWORD:
            _require_drives(answered)
        for node_id, answers in answered.items():
            _refuse_power(node_id, answers)


def read(
    node_ids: Iterable[int], index: int, sub: int, bitrate: int, attempts: int = ATTEMPTS
) -> Talk[dict[int, Answers]]:
    """One object of many nodes; the nodes that answered. A node is asked again only while it has not answered."""
    remaining, found = list(node_ids), {}
    stagger_s = max(0.002, 2 * _FRAME_BITS / bitrate)
    for attempt in range(attempts):
        if not remaining:
            break
        requests = tuple(_request(node_id, index, sub) for node_id in remaining)
        wait_s = WAIT_S * (2 if attempt else 1) + 2 * stagger_s
        came: tuple[Frame, ...] = yield Exchange(
            requests, lambda frame: _fits(frame, index, sub), wait_s, None, stagger_s
        )
        for node_id in remaining:
            values = tuple(_value(frame) for frame in came if frame.cob_id == SDO_TO_CLIENT + node_id)
            if values:
                found[node_id] = Answers(attempt + 1, values)
        remaining = [node_id for node_id in remaining if node_id not in found]
    return found


def _require_drives(answered: dict[int, Answers]) -> None:
    others = [node_id for node_id, answers in answered.items() if None in answers.values]
    if others:
        raise ConversationError(
            f"node {', '.join(map(str, others))} refuses 6041h, so it is no CiA 402 drive, or its power is unknown. "
            "Disconnect what is no drive, as each device on the bus gets a new node id"
        )


def _refuse_power(node_id: int, answers: Answers) -> None:
    for value in answers.values:
        states = [] if value is None or len(value) not in (2, 4) else [decode_statusword(w) for w in statuswords(value)]
        for state in states:
            if state is None or state.has_torque:
                name = "an unknown state" if state is None else state.text
                raise ConversationError(f"node {node_id} is in {name}: its motor may have power. Switch it off first")


def _request(node_id: int, index: int, sub: int) -> Frame:
    return Frame(SDO_TO_SERVER + node_id, bytes((_UPLOAD, *index.to_bytes(2, "little"), sub)).ljust(8, b"\0"))


def _fits(frame: Frame, index: int, sub: int) -> bool:
    is_answer = SDO_TO_CLIENT < frame.cob_id <= SDO_TO_CLIENT + MAX_NODE_ID and len(frame.data) == 8
    return is_answer and frame.data[1:4] == bytes((*index.to_bytes(2, "little"), sub))


def _value(frame: Frame) -> bytes | None:
    command = frame.data[0]
    if command == _ABORT or command >> 5 != 2 or not command & 2:
        return None
    return frame.data[4 : 8 - (command >> 2 & 3 if command & 1 else 0)]


def _number(answers: Answers) -> int | None:
    value = answers.values[0]
    return None if value is None else int.from_bytes(value, "little")
