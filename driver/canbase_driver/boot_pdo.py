"""Writing the PDO layout into a drive by the rules of CiA 301: everything off first, then one PDO after the other."""

from __future__ import annotations

from canbase_driver.boot_steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.pdo import NodeLayout, Pdo
from canbase_driver.sdo import Read, Write

PDO_OFF = 1 << 31
"""Bit 31 of 1400h:1 and 1800h:1: the PDO is not valid."""
PDO_NO_RTR = 1 << 30
"""Bit 30 of the same; some drives refuse a COB-ID that comes back without it."""
PREDEFINED = 4
"""RPDO1…4 and TPDO1…4 may have gaps; further ones are looked for until one is missing."""
MAX_PDO_NUMBER = 64


def configure_pdos(node: NodeAccess, layout: NodeLayout) -> Steps[None]:
    """Switch off every PDO of the drive, then map those of the layout and switch them on. Raises BootError."""
    cob_ids = yield from _switch_all_off(node)
    for pdo in layout.pdos():
        if pdo.communication not in cob_ids:
            problem = f"it has no {pdo.name} ({pdo.communication:04X}h)"
            raise BootError(node.node_id, problem, "canbase cannot do without, see docs/bus.md")
        yield from _map(node, pdo)
        yield from node.set(Write(pdo.communication, 2, pdo.transmission_type, 1))
        kept = cob_ids[pdo.communication] & PDO_NO_RTR
        yield from node.set(Write(pdo.communication, 1, kept | pdo.cob_id, 4))


def _switch_all_off(node: NodeAccess) -> Steps[dict[int, int]]:
    """1400h:1 and 1800h:1 of every PDO that the drive has, as they were, by index."""
    cob_ids: dict[int, int] = {}
    for kind in ("RPDO", "TPDO"):
        for number in range(1, MAX_PDO_NUMBER + 1):
            index = Pdo(kind, number).communication
            cob_id = yield from node.read_if_present(index, 1)
            if cob_id is None and number > PREDEFINED:
                break
            if cob_id is not None:
                cob_ids[index] = cob_id
                yield from _switch_off(node, index, cob_id)
    return cob_ids


def _switch_off(node: NodeAccess, index: int, cob_id: int) -> Steps[None]:
    if not cob_id & PDO_OFF:
        yield from node.set_if_present(Write(index, 1, cob_id | PDO_OFF, 4))


def _map(node: NodeAccess, pdo: Pdo) -> Steps[None]:
    """A mapping that is right stays as it is: some drives have a fixed one."""
    if (yield from _is_mapped(pdo)):
        return
    yield Write(pdo.mapping_object, 0, 0, 1)
    for sub, entry in enumerate(pdo.mapping, start=1):
        yield Write(pdo.mapping_object, sub, entry, 4)
    yield Write(pdo.mapping_object, 0, len(pdo.mapping), 1)
    if not (yield from _is_mapped(pdo)):
        problem = f"{pdo.name} reads back another mapping than was written to {pdo.mapping_object:04X}h"
        raise BootError(node.node_id, problem, "Look up in the manual what this PDO can carry")


def _is_mapped(pdo: Pdo) -> Steps[bool]:
    if unsigned((yield Read(pdo.mapping_object))) != len(pdo.mapping):
        return False
    for sub, entry in enumerate(pdo.mapping, start=1):
        if unsigned((yield Read(pdo.mapping_object, sub))) != entry:
            return False
    return True
