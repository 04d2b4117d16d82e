"""Writing the PDO layout into a drive by the rules of CiA 301: a PDO is off while it is changed."""

from __future__ import annotations

from dataclasses import replace

from canbase_config.drive_values import FIRST_SPARE_TPDO
from canbase_config.object_map import AXIS_OFFSET as SECOND_AXIS
from canbase_config.object_map import VELOCITY_ACTUAL, place
from canbase_driver.boot.advice import ELSE_UNUSABLE
from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.pdo import AT_ONCE, AT_ONCE_TOO, EVERY_SYNC, NodeLayout, Pdo
from canbase_driver.cia301.sdo_client import DEVICE_STATE, NO_OBJECT, NO_SUB_INDEX, Read, SdoAborted, Write

PDO_OFF = 1 << 31
"""Bit 31 of 1400h:1 and 1800h:1: the PDO is not valid."""
FIRST_RPDO, FIRST_TPDO = 0x1400, 0x1800
PREDEFINED = 4
"""RPDO1…4 and TPDO1…4 may have gaps; further ones are looked for until one is missing."""
MAX_PDO_NUMBER = 64
EVENT_TYPES = (AT_ONCE, AT_ONCE_TOO)
TYPE = 2
"""Sub-index of 1400h and 1800h: the transmission type."""
WIDTH_KEYS = {
    0x60FF: "set `layout.target_bits: {}` in its drive profile",
    0x606C: "set `layout.velocity_bits: {}` in its drive profile",
    0x6041: "a drive that has one motor behind it cannot be used; one with two: `layout.statusword` of its profile",
}
"""First-axis index → what to do about an object that goes into a PDO in another width than its profile has."""
NARROW_BYTES = 2
"""Length of a 606Ch with 16 bits, as an SDO answer has it."""
_WITHOUT_TORQUE = "without torque the power goes off for a moment at each standstill (watchdog.stand_proof)"


def configure_pdos(node: NodeAccess, layout: NodeLayout) -> Steps[None]:
    """Make the PDOs of the layout the only ones that are valid. What is right already is left alone.

    A drive that has no torque, or maps none, does without. Raises BootError when it has not these PDOs, or does not
    keep what is written to them.
    """
    cob_ids = yield from _cob_ids(node)
    layout = yield from _with_tpdos_it_has(node, layout, cob_ids)
    layout = yield from _with_torque_it_has(node, layout)
    wanted = {pdo.communication: pdo for pdo in (yield from _in_what_it_has(node, layout, cob_ids))}
    spare = {pdo.communication: pdo for pdo in layout.value_pdos() if pdo.communication not in wanted}
    for index, cob_id in cob_ids.items():
        if index not in wanted and index not in spare:
            yield from _switch_off(node, index, cob_id)
    for index, pdo in wanted.items():
        old = cob_ids[index]
        yield from _make_right(node, layout, pdo, old, old & layout.profile.pdo.fixed_cob_id_bits | pdo.cob_id)

    for index, pdo in spare.items():
        yield from _publish_what_it_maps(node, layout, pdo, cob_ids.get(index))


def _publish_what_it_maps(node: NodeAccess, layout: NodeLayout, pdo: Pdo, old: int | None) -> Steps[None]:
    """A spare TPDO with named values; `old`: its present COB-ID, None: it has none. Nothing that stops the robot
    depends on it: a refusal is a note, and the PDO is off."""
    why = "the drive has no such PDO"
    if old is not None:
        try:
            yield from _make_right(node, layout, pdo, old, old & layout.profile.pdo.fixed_cob_id_bits | pdo.cob_id)
        except BootError as refused:
            why = refused.problem
        except SdoAborted as refused:
            why = str(refused)
        else:
            return
        yield from node.set_if_present(Write(pdo.communication, 1, old | PDO_OFF, 4))
    names = ", ".join(value.name for value in layout.values[pdo.number - FIRST_SPARE_TPDO].values)
    node.notes.append(f"{names}: not published, {pdo.name}: {why}; see `values` of its drive in robot.yaml")


def _with_tpdos_it_has(node: NodeAccess, layout: NodeLayout, cob_ids: dict[int, int]) -> Steps[NodeLayout]:
    """One TPDO for each motor, where it has no more, and the velocity has room in it."""
    missing = [pdo for pdo in layout.pdos() if pdo.is_received and pdo.communication not in cob_ids]
    if layout.profile.layout.fits_one_tpdo and missing and not layout.joins_velocity:
        for pdo in missing:
            if not (yield from _lacks(pdo)):
                return layout
        layout = replace(layout, joins_velocity=True)
        carry = "TPDO1 carries" if len(layout.axes) == 1 else "TPDO1 and TPDO2 carry"
        node.notes.append(f"the drive has no {missing[0].name}: {carry} the velocity behind the position")
    if layout.joins_velocity and layout.profile.options.torque != "none":
        node.notes.append(f"torque unknown: one TPDO for each motor has no room for it; {_WITHOUT_TORQUE}")
    return layout


def _lacks(pdo: Pdo) -> Steps[bool]:
    """The drive says that it does not exist. Another refusal may be one of this moment: then it would stay on."""
    try:
        yield Read(pdo.communication, 1)
    except SdoAborted as refused:
        return refused.code in (NO_OBJECT, NO_SUB_INDEX)
    return False


def _with_torque_it_has(node: NodeAccess, layout: NodeLayout) -> Steps[NodeLayout]:
    for index, sub in layout.torque_places():
        if (yield from node.read_if_present(index, sub)) is None:
            _note_no_torque(node, f"the drive has no {index:04X}h:{sub}")
            return replace(layout, with_torque=False)
    return layout


def _in_what_it_has(node: NodeAccess, layout: NodeLayout, cob_ids: dict[int, int]) -> Steps[list[Pdo]]:
    """The watchdog's quick stop takes the last RPDO of a drive that has fewer than its profile: its COB-ID counts, and
    not its number."""
    pdos = [pdo for pdo in layout.pdos() if pdo.communication in cob_ids]
    for pdo in layout.pdos():
        if pdo.communication in cob_ids:
            continue
        used = [each.communication for each in pdos]
        free = [index for index in cob_ids if index < FIRST_TPDO and index not in used]
        if pdo.is_received or pdo.number <= len(layout.axes) or not free:
            rpdos = sum(index < FIRST_TPDO for index in cob_ids)
            problem = (
                f"it has no {pdo.name} ({pdo.communication:04X}h), but {rpdos} RPDOs, {len(cob_ids) - rpdos} TPDOs"
            )
            raise BootError(node.node_id, problem, (yield from _about_pdos(node, layout, pdo)))
        pdos.append(replace(pdo, number=max(free) - FIRST_RPDO + 1))
    return pdos


def _about_pdos(node: NodeAccess, layout: NodeLayout, missing: Pdo) -> Steps[str]:
    """What cures it: its velocity may be narrower than its profile says, and have room in its only TPDO."""
    if missing.is_received and layout.profile.layout.fits_one_tpdo and not layout.joins_velocity:
        return (
            f"It does not say that {missing.communication:04X}h does not exist: reset it. If it has one TPDO for each "
            f"motor by its manual, set `pdo.tpdos: {len(layout.axes)}` in its drive profile"
        )
    if missing.is_received and layout.profile.layout.statusword == "own" and not layout.joins_velocity:
        at = place(layout.profile, VELOCITY_ACTUAL, layout.axes[0])
        if (yield from _size(Read(at.index, at.sub))) == NARROW_BYTES:
            return (
                f"{at.index:04X}h has 16 bits, and one TPDO is enough for such a drive: set `layout.velocity_bits: 16` "
                "in its drive profile"
            )
    return (
        "canbase needs one RPDO and two TPDOs for each motor (one, where its velocity has 16 bits: "
        "`layout.velocity_bits`), and one more RPDO for the watchdog (docs/drives.md): without them the drive cannot "
        "be used"
    )


def _size(read: Read) -> Steps[int]:
    """Bytes of an object; 0: the drive refuses to read it."""
    try:
        return len((yield read))
    except SdoAborted:
        return 0


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
    """What a TPDO keeps is not read back: it would be a note alone, and one that stays on shows by its frames."""
    off = Write(index, 1, cob_id | PDO_OFF, 4)
    if cob_id & PDO_OFF:
        return
    if index < FIRST_TPDO:
        yield from node.set_if_present(off, known=cob_id)
    else:
        yield from node.try_to_write(off, known=cob_id)


def _suspend(node: NodeAccess, index: int, cob_id: int) -> Steps[SdoAborted | None]:
    """Off while it is changed. Not read back: a drive that left it on refuses the mapping. Its refusal, or None."""
    if not cob_id & PDO_OFF:
        off = Write(index, 1, cob_id | PDO_OFF, 4)
        try:
            yield off
        except SdoAborted as refused:
            node.notes.append(f"{off}: {refused.text}")
            return refused
    return None


def _times(pdo: Pdo) -> list[Write]:
    values = ((3, pdo.inhibit_100us), (5, pdo.event_timer_ms))
    return [Write(pdo.communication, sub, value, 2) for sub, value in values if value is not None]


def _make_right(node: NodeAccess, layout: NodeLayout, pdo: Pdo, old: int, cob_id: int) -> Steps[None]:
    """`old`: its present COB-ID. The mapping is looked at first: a drive out of its box has another one."""
    mapped = yield from _other_mapping(pdo)
    if mapped is None and old == cob_id and (yield from _is_timed(node, pdo)):
        return
    stays_on = yield from _suspend(node, pdo.communication, old)
    try:
        if mapped is not None:
            yield from _map_what_it_takes(node, pdo, mapped)
    except (SdoAborted, BootError) as refused:
        if stays_on is None:
            raise
        why = refused.text if isinstance(refused, SdoAborted) else refused.problem
        off = f"{pdo.communication:04X}h:1: {stays_on.text}"
        problem = f"{pdo.name} cannot be switched off ({off}), nor mapped while it is on ({why})"
        carries = f"Let {pdo.name} carry {_needed(pdo)} with COB-ID {pdo.cob_id:03X}h"
        tool = f"{carries}, by the manufacturer's tool; {ELSE_UNUSABLE}"
        raise BootError.refused(node.node_id, problem, stays_on.code, tool) from refused
    try:
        yield from _set_type(node, pdo, unread=mapped is not None and pdo.transmission_type != AT_ONCE)
    except BootError as refused:
        yield from _set_by_event(node, layout, pdo, refused)
    else:
        for time in _times(pdo):
            yield from node.set_if_present(time)
    # that a TPDO is on shows by itself: a node without every one of its layout does not become ready
    on = Write(pdo.communication, 1, cob_id, 4)
    yield from node.overwrite(on, f"{old:08X}h", read_back=not pdo.is_received)


def _is_timed(node: NodeAccess, pdo: Pdo) -> Steps[bool]:
    if (yield from node.read_if_present(pdo.communication, TYPE)) not in _types(pdo):
        return False
    for write in _times(pdo):
        if (yield from node.read_if_present(write.index, write.sub)) != write.value:
            return False
    return True


def _set_type(node: NodeAccess, pdo: Pdo, *, unread: bool) -> Steps[None]:
    """Where a drive refuses one of the two event-driven types, it may take the other one."""
    why = ""
    for value in _types(pdo):
        try:
            yield from node.set(Write(pdo.communication, TYPE, value, 1), unread=unread)
        except SdoAborted as refused:
            if refused.code == DEVICE_STATE:
                raise
            why = why or f"{pdo.communication:04X}h:{TYPE}: {refused.text}"
        except BootError as other:
            why = why or other.problem
        else:
            return
    type_now = yield from node.read_if_present(pdo.communication, TYPE)
    problem = f"{why}, {pdo.name} does not take type {_types(pdo)[0]}"
    raise BootError(node.node_id, problem, (yield from _about_type(node, pdo, type_now)))


def _set_by_event(node: NodeAccess, layout: NodeLayout, pdo: Pdo, refused: BootError) -> Steps[None]:
    """Without SYNC, where the drive takes no synchronous type.

    A TPDO must then keep the pace of the SYNCs by its own times: it proves life as often, and the watchdog counts more
    than one in a cycle as those of a second drive. Raises `refused` where the drive takes no event-driven type either.
    """
    if pdo.transmission_type == AT_ONCE:
        raise refused
    own = layout.by_event(pdo)
    try:
        yield from _set_type(node, own, unread=True)
    except BootError:
        raise refused from None
    for time in _times(own):
        if not (yield from node.set_if_present(time)) and pdo.is_received:
            raise BootError(
                node.node_id,
                f"{refused.problem}, nor {time}",
                f"Without SYNC it must come every {own.event_timer_ms} ms: set this with the manufacturer's tool; "
                f"{ELSE_UNUSABLE}",
            )
    how = f"it is sent every {own.event_timer_ms} ms by its timer" if pdo.is_received else "it acts when it arrives"
    node.notes.append(f"{refused.problem}: {how} (type 255 or 254)")


def _types(pdo: Pdo) -> tuple[int, ...]:
    return EVENT_TYPES if pdo.transmission_type == AT_ONCE else (pdo.transmission_type,)


def _about_type(node: NodeAccess, pdo: Pdo, type_now: int | None) -> Steps[str]:
    """What cures it. The key of the profile, only where the drive takes the type that this key leads to."""
    tool = f"Set {pdo.communication:04X}h:{TYPE} to {pdo.transmission_type} with the manufacturer's tool"
    if pdo.transmission_type == AT_ONCE and pdo.event_timer_ms is None:
        return f"{tool}: the watchdog's quick stop cannot wait for a SYNC; {ELSE_UNUSABLE}"
    if pdo.transmission_type == AT_ONCE and (
        type_now == EVERY_SYNC or (yield from node.tries(Write(pdo.communication, TYPE, EVERY_SYNC, 1)))
    ):
        return "The drive takes no event-driven PDO: set `pdo.synchronous: true` in its drive profile"
    return f"It takes no other type either. {tool}; {ELSE_UNUSABLE}"


def _map_what_it_takes(node: NodeAccess, pdo: Pdo, mapped: int) -> Steps[None]:
    """Without what is optional, where the drive refuses that. A mapping that is right then stays as it is: some drives
    have a fixed one."""
    try:
        yield from _map(node, pdo, mapped)
    except (SdoAborted, BootError) as refused:
        if not pdo.optional:
            raise
        _note_no_torque(node, refused.problem if isinstance(refused, BootError) else str(refused))
        less = replace(pdo, mapping=pdo.mapping[: -pdo.optional], optional=0)
        left = yield from _other_mapping(less)
        if left is not None:
            yield from _map(node, less, left)


def _note_no_torque(node: NodeAccess, why: str) -> None:
    node.notes.append(
        f"torque unknown: {why}. Where it can map the other one of 6077h and 6078h, name that in `options.torque` of "
        f"its drive profile; {_WITHOUT_TORQUE}"
    )


def _map(node: NodeAccess, pdo: Pdo, mapped: int) -> Steps[None]:
    """In place of the `mapped` objects that it carries now. The number in a PDO that is heard shows in its length."""
    node.changes.append(f"{pdo.name}: mapped anew, {len(pdo.mapping)} objects")
    if mapped:
        yield from _write_count(node, pdo, 0)
    for sub, entry in enumerate(pdo.mapping, start=1):
        try:
            yield Write(pdo.mapping_object, sub, entry, 4)
        except SdoAborted as refused:
            yield from _look_for_width(node, pdo, sub, refused)
            raise (yield from _unmapped(node, pdo, sub, _named(entry), refused)) from refused
    yield from _write_count(node, pdo, len(pdo.mapping))
    if not (yield from (_holds(pdo) if pdo.is_received else _is_mapped(pdo))):
        problem = f"{pdo.name} reads back another mapping than was written to {pdo.mapping_object:04X}h"
        tool = f"Let {pdo.name} carry {_needed(pdo)} with the manufacturer's tool; {ELSE_UNUSABLE}"
        raise BootError(node.node_id, problem, tool)


def _write_count(node: NodeAccess, pdo: Pdo, count: int) -> Steps[None]:
    """How many objects are mapped; 0 before they are changed."""
    try:
        yield Write(pdo.mapping_object, 0, count, 1)
    except SdoAborted as refused:
        raise (yield from _unmapped(node, pdo, 0, "another mapping", refused)) from refused


def _unmapped(node: NodeAccess, pdo: Pdo, sub: int, what: str, refused: SdoAborted) -> Steps[BootError]:
    """The drive does not take `what` into this PDO. It may carry what is needed already, and something more."""
    problem = f"{pdo.name} does not take {what} ({pdo.mapping_object:04X}h:{sub}: {refused.text})"
    carried = []
    for n in range(1, ((yield from node.read_if_present(pdo.mapping_object)) or 0) + 1):
        carried.append(_named((yield from node.read_if_present(pdo.mapping_object, n)) or 0))
    now = f"; it carries {', '.join(carried)}" if carried else ""
    tool = (
        f"Let {pdo.name} carry {_needed(pdo)} in this order and nothing else, with the manufacturer's tool{now}; "
        f"{ELSE_UNUSABLE}"
    )
    return BootError.refused(node.node_id, problem, refused.code, tool)


def _needed(pdo: Pdo) -> str:
    return ", ".join(_named(entry) for entry in pdo.mapping[: len(pdo.mapping) - pdo.optional])


def _named(entry: int) -> str:
    return f"{entry >> 16:04X}h:{entry >> 8 & 0xFF}"


def _look_for_width(node: NodeAccess, pdo: Pdo, sub: int, refused: SdoAborted) -> Steps[None]:
    """Raises BootError when the drive maps the object in another width: 16 bits for 32, or 32 for 16."""
    entry = pdo.mapping[sub - 1]
    index, bits = entry >> 16, entry & 0xFF
    other = 48 - bits
    cure = WIDTH_KEYS.get(index - SECOND_AXIS * (index >= 0x6000 + SECOND_AXIS))
    if cure is None or not (yield from node.tries(Write(pdo.mapping_object, sub, entry ^ bits ^ other, 4))):
        return
    problem = (
        f"{pdo.name} takes {index:04X}h:{entry >> 8 & 0xFF} with {other} bits, and not with {bits} ({refused.text})"
    )
    raise BootError(node.node_id, problem, f"The drive has another width than its profile: {cure.format(other)}")


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
