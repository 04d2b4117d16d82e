"""Writing the PDO layout into a drive by the rules of CiA 301: a PDO is off while it is changed."""

from __future__ import annotations

from dataclasses import replace

from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.pdo import NodeLayout, Pdo
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
        cob_id = cob_ids[index] & layout.profile.pdo.fixed_cob_id_bits | pdo.cob_id
        if cob_ids[index] != cob_id or not (yield from _is_right(node, pdo)):
            yield from _suspend(node, index, cob_ids[index])
            yield from _configure(node, pdo)
            yield from node.overwrite(Write(index, 1, cob_id, 4), f"{cob_ids[index]:08X}h")


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


def _is_right(node: NodeAccess, pdo: Pdo) -> Steps[bool]:
    for write in (Write(pdo.communication, 2, pdo.transmission_type, 1), *_times(pdo)):
        if (yield from node.read_if_present(write.index, write.sub)) != write.value:
            return False
    return (yield from _is_mapped(pdo))


def _configure(node: NodeAccess, pdo: Pdo) -> Steps[None]:
    yield from _map_what_it_takes(node, pdo)
    yield from node.set(Write(pdo.communication, 2, pdo.transmission_type, 1))
    for time in _times(pdo):
        yield from node.set_if_present(time)


def _map_what_it_takes(node: NodeAccess, pdo: Pdo) -> Steps[None]:
    """Without what is optional, where the drive refuses that."""
    try:
        yield from _map(node, pdo)
    except (SdoAborted, BootError) as refused:
        if not pdo.optional:
            raise
        _note_no_torque(node, f"{pdo.name} does not take it ({refused})")
        yield from _map(node, replace(pdo, mapping=pdo.mapping[: -pdo.optional], optional=0))


def _note_no_torque(node: NodeAccess, why: str) -> None:
    node.notes.append(f"torque unknown: {why}; see options.torque of its drive profile, watchdog.stand_proof")


def _map(node: NodeAccess, pdo: Pdo) -> Steps[None]:
    """A mapping that is right stays as it is: some drives have a fixed one."""
    count = yield from _count(pdo)
    if count == len(pdo.mapping) and (yield from _holds(pdo)):
        return
    node.changes.append(f"{pdo.name}: mapped anew, {len(pdo.mapping)} objects")
    if count:
        yield Write(pdo.mapping_object, 0, 0, 1)
    for sub, entry in enumerate(pdo.mapping, start=1):
        yield Write(pdo.mapping_object, sub, entry, 4)
    yield Write(pdo.mapping_object, 0, len(pdo.mapping), 1)
    if not (yield from _is_mapped(pdo)):
        problem = f"{pdo.name} reads back another mapping than was written to {pdo.mapping_object:04X}h"
        raise BootError(node.node_id, problem, "Look up in the manual what this PDO can carry")


def _is_mapped(pdo: Pdo) -> Steps[bool]:
    return (yield from _count(pdo)) == len(pdo.mapping) and (yield from _holds(pdo))


def _count(pdo: Pdo) -> Steps[int]:
    return unsigned((yield Read(pdo.mapping_object)))


def _holds(pdo: Pdo) -> Steps[bool]:
    for sub, entry in enumerate(pdo.mapping, start=1):
        if unsigned((yield Read(pdo.mapping_object, sub))) != entry:
            return False
    return True
