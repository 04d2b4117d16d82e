"""Writing the PDO layout into a drive by the rules of CiA 301: a PDO is off while it is changed."""

from __future__ import annotations

from dataclasses import replace

from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.pdo import AT_ONCE, NodeLayout, Pdo
from canbase_driver.cia301.sdo_client import Read, SdoAborted, Write

PDO_OFF = 1 << 31
"""Bit 31 of 1400h:1 and 1800h:1: the PDO is not valid."""
PREDEFINED = 4
"""RPDO1…4 and TPDO1…4 may have gaps; further ones are looked for until one is missing."""
MAX_PDO_NUMBER = 64


def configure_pdos(node: NodeAccess, layout: NodeLayout) -> Steps[None]:
    """Make the PDOs of the layout the only ones that are valid. What is right already is left alone.

    A drive that has no torque, or maps none, does without. Raises BootError when it has not these PDOs, or does not
    keep what is written to them.
    """
    layout = yield from _with_what_it_has(node, layout)
    wanted = {pdo.communication: pdo for pdo in layout.pdos()}
    cob_ids = yield from _cob_ids(node)
    for pdo in wanted.values():
        if pdo.communication not in cob_ids:
            problem = f"it has no {pdo.name} ({pdo.communication:04X}h)"
            raise BootError(node.node_id, problem, "canbase cannot do without, see docs/bus.md")
    for index, cob_id in cob_ids.items():
        if index not in wanted:
            yield from _switch_off(node, index, cob_id)
    for index, pdo in wanted.items():
        found = cob_ids[index]
        yield from _make_right(node, pdo, found, found & layout.profile.pdo.fixed_cob_id_bits | pdo.cob_id)


def _with_what_it_has(node: NodeAccess, layout: NodeLayout) -> Steps[NodeLayout]:
    for index, sub in layout.torque_places():
        if (yield from node.read_if_present(index, sub)) is None:
            _note_no_torque(node, f"the drive has no {index:04X}h:{sub}")
            return replace(layout, with_torque=False)
    return layout


def _cob_ids(node: NodeAccess) -> Steps[dict[int, int]]:
    """1400h:1 and 1800h:1 of every PDO that the drive has, by index."""
    cob_ids: dict[int, int] = {}
    for kind in ("RPDO", "TPDO"):
        for number in range(1, MAX_PDO_NUMBER + 1):
            index = Pdo(kind, number).communication
            cob_id = yield from node.read_if_present(index, 1)
            if cob_id is None and number > PREDEFINED:
                break
            if cob_id is not None:
                cob_ids[index] = cob_id
    return cob_ids


def _switch_off(node: NodeAccess, index: int, cob_id: int) -> Steps[None]:
    if not cob_id & PDO_OFF:
        yield from node.set_if_present(Write(index, 1, cob_id | PDO_OFF, 4), known=cob_id)


def _suspend(node: NodeAccess, index: int, cob_id: int) -> Steps[None]:
    """Off while it is changed. Not read back: a drive that left it on refuses the mapping."""
    if not cob_id & PDO_OFF:
        off = Write(index, 1, cob_id | PDO_OFF, 4)
        try:
            yield off
        except SdoAborted as refused:
            node.notes.append(f"{off}: {refused.text}")


def _times(pdo: Pdo) -> list[Write]:
    values = ((3, pdo.inhibit_100us), (5, pdo.event_timer_ms))
    return [Write(pdo.communication, sub, value, 2) for sub, value in values if value is not None]


def _make_right(node: NodeAccess, pdo: Pdo, found: int, cob_id: int) -> Steps[None]:
    """`found`: its present COB-ID. The mapping is looked at first: a drive out of its box has another one."""
    mapped = yield from _other_mapping(pdo)
    if mapped is None and found == cob_id and (yield from _is_timed(node, pdo)):
        return
    yield from _suspend(node, pdo.communication, found)
    if mapped is not None:
        yield from _map_what_it_takes(node, pdo, mapped)
    unread = mapped is not None and pdo.transmission_type != AT_ONCE
    yield from node.set(_type(pdo), unread=unread)
    for time in _times(pdo):
        yield from node.set_if_present(time)
    # that a TPDO is on shows by itself: a node without every one of its layout does not become ready
    on = Write(pdo.communication, 1, cob_id, 4)
    yield from node.overwrite(on, f"{found:08X}h", read_back=not pdo.is_heard)


def _is_timed(node: NodeAccess, pdo: Pdo) -> Steps[bool]:
    for write in (_type(pdo), *_times(pdo)):
        if (yield from node.read_if_present(write.index, write.sub)) != write.value:
            return False
    return True


def _type(pdo: Pdo) -> Write:
    return Write(pdo.communication, 2, pdo.transmission_type, 1)


def _map_what_it_takes(node: NodeAccess, pdo: Pdo, mapped: int) -> Steps[None]:
    """Without what is optional, where the drive refuses that. A mapping that is right then stays as it is: some drives
    have a fixed one."""
    try:
        yield from _map(node, pdo, mapped)
    except (SdoAborted, BootError) as refused:
        if not pdo.optional:
            raise
        _note_no_torque(node, f"{pdo.name} does not take it ({refused})")
        less = replace(pdo, mapping=pdo.mapping[: -pdo.optional], optional=0)
        left = yield from _other_mapping(less)
        if left is not None:
            yield from _map(node, less, left)


def _note_no_torque(node: NodeAccess, why: str) -> None:
    node.notes.append(f"torque unknown: {why}; see options.torque of its drive profile, watchdog.stand_proof")


def _map(node: NodeAccess, pdo: Pdo, mapped: int) -> Steps[None]:
    """In place of the `mapped` objects that it carries now. The number in a PDO that is heard shows in its length."""
    node.changes.append(f"{pdo.name}: mapped anew, {len(pdo.mapping)} objects")
    if mapped:
        yield Write(pdo.mapping_object, 0, 0, 1)
    for sub, entry in enumerate(pdo.mapping, start=1):
        yield Write(pdo.mapping_object, sub, entry, 4)
    yield Write(pdo.mapping_object, 0, len(pdo.mapping), 1)
    if not (yield from (_holds(pdo) if pdo.is_heard else _is_mapped(pdo))):
        problem = f"{pdo.name} reads back another mapping than was written to {pdo.mapping_object:04X}h"
        raise BootError(node.node_id, problem, "Look up in the manual what this PDO can carry")


def _other_mapping(pdo: Pdo) -> Steps[int | None]:
    """How many objects are mapped; None: the right ones."""
    count = yield from _count(pdo)
    return None if count == len(pdo.mapping) and (yield from _holds(pdo)) else count


def _is_mapped(pdo: Pdo) -> Steps[bool]:
    return (yield from _other_mapping(pdo)) is None


def _count(pdo: Pdo) -> Steps[int]:
    return unsigned((yield Read(pdo.mapping_object)))


def _holds(pdo: Pdo) -> Steps[bool]:
    for sub, entry in enumerate(pdo.mapping, start=1):
        if unsigned((yield Read(pdo.mapping_object, sub))) != entry:
            return False
    return True
