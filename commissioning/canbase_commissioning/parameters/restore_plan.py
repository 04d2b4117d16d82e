"""Which saved values a drive needs, and in which order they may be written. CiA 301, CiA 402-2. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.comparison import same_product
from canbase_commissioning.parameters.parameter_kinds import is_pdo, why_no_setting
from canbase_commissioning.parameters.saved import Parameters
from canbase_commissioning.parameters.value_text import to_text
from canbase_config.eds_file import Eds

OFF: Final = 1 << 31
"""Bit 31 of the COB-ID of a PDO and of EMCY: not valid (CiA 301)."""
MAKES_SYNC: Final = 1 << 30
"""Bit 30 of 1005h: the drive itself sends SYNC."""
COMMUNICATION: Final = range(0x1000, 0x2000)
SYNC, EMCY, HEARTBEATS = 0x1005, 0x1014, 0x1016


@dataclass(frozen=True, slots=True)
class Change:
    """One value that the drive needs. `before`: the value that it has."""

    at: Address
    name: str
    data: bytes
    before: bytes
    data_type: int | None = None

    def __str__(self) -> str:
        before, after = (to_text(data, self.data_type) for data in (self.before, self.data))
        return f"{self.at} {self.name}: {before} → {after}"


@dataclass(frozen=True, slots=True)
class Order:
    """One write. `change`: the one that it completes; None: a step on the way, whose value is not read back."""

    at: Address
    data: bytes
    change: Change | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """`orders` in their order; `left`: what differs and is not written, and why; `alike`: how many have their value."""

    orders: tuple[Order, ...]
    left: tuple[tuple[Change, str], ...]
    missing: tuple[tuple[Address, str], ...]
    """What the file has and the drive did not give."""
    alike: int

    @property
    def changes(self) -> tuple[Change, ...]:
        """What will have changed."""
        return tuple(order.change for order in self.orders if order.change is not None)

    @property
    def maps_pdos(self) -> bool:
        """Whether PDOs change: drives take that in NMT pre-operational alone."""
        return any(is_pdo(order.at) for order in self.orders)


def why_another_product(saved: Parameters, now: Parameters) -> str:
    """Why the parameters are not for this drive; empty: maker and product (1018h) are the same."""
    if same_product(saved.identity, now.identity):
        return ""
    if None in (saved.identity.vendor_id, saved.identity.product_code):
        return f"{saved.source}: it does not show of which product it is (1018h:1, 1018h:2)"
    return f"the parameters are those of {saved.identity}; the drive is {now.identity}"


def plan(saved: Parameters, now: Parameters, eds: Eds) -> Plan:
    """What a restore writes. `saved` and `now` of the same node id; `eds`: of the file."""
    wanted: list[Change] = []
    left: list[tuple[Change, str]] = []
    missing: list[tuple[Address, str]] = []
    alike = 0
    for at in sorted(saved.values, key=_order):
        entry, data = eds.objects[at.index, at.sub], saved.values[at]
        why, before = why_no_setting(entry), now.values.get(at)
        if why.endswith("by the EDS") or data == before:
            alike += data == before and not why
        elif before is None:
            missing += [] if why else [(at, now.refused.get(at, "the drive was not asked for it"))]
        else:
            change = Change(at, entry.name, data, before, entry.data_type)
            why = why or _why_not(change)
            left.append((change, why)) if why else wanted.append(change)
    orders, unused = _orders(wanted, _settings(saved, eds), _settings(now, eds))
    return Plan(orders, (*left, *unused), tuple(missing), alike)


def _settings(of: Parameters, eds: Eds) -> Mapping[Address, bytes]:
    """Of a PDO also what is not to change is written again, but never what cannot be written."""
    entries = {at: eds.objects.get((at.index, at.sub)) for at in of.values}
    return {at: of.values[at] for at, entry in entries.items() if entry is not None and not why_no_setting(entry)}


def _why_not(change: Change) -> str:
    if change.at.index == SYNC and int.from_bytes(change.data, "little") & MAKES_SYNC:
        return "the drive would send SYNC itself, beside canbase's driver"
    return ""


def _orders(
    wanted: list[Change], saved: Mapping[Address, bytes], now: Mapping[Address, bytes]
) -> tuple[tuple[Order, ...], list[tuple[Change, str]]]:
    """Settings of the drive, then PDOs, each one off meanwhile, then the rest of the communication."""
    orders = [Order(each.at, each.data, each) for each in wanted if each.at.index not in COMMUNICATION]
    pdos = [each for each in wanted if is_pdo(each.at)]
    unused: list[tuple[Change, str]] = []
    for communication in sorted({pdo_of(each.at) for each in pdos}):
        own = [each for each in pdos if pdo_of(each.at) == communication]
        orders += _pdo(communication, own, saved, now, unused)
    rest = [each for each in wanted if each.at.index in COMMUNICATION and not is_pdo(each.at)]
    return (*orders, *_communication_orders(rest)), unused


def pdo_of(at: Address) -> int:
    """1400h… or 1800h… of the PDO that the object belongs to."""
    return at.index - 0x200 if at.index & 0x200 else at.index


def _pdo(
    index: int,
    changes: list[Change],
    saved: Mapping[Address, bytes],
    now: Mapping[Address, bytes],
    unused: list[tuple[Change, str]],
) -> Iterator[Order]:
    """It is off while it is changed, and has no mapping while its entries change (CiA 301, 1400h, 1600h)."""
    cob_id = Address(index, 1)
    mine = {each.at: each for each in changes}
    present = int.from_bytes(now.get(cob_id, b""), "little")
    if cob_id in now and not present & OFF:
        yield Order(cob_id, (present | OFF).to_bytes(4, "little"))
    yield from _mapping(index + 0x200, mine, saved, unused)
    for at, change in mine.items():
        if at.index == index and at != cob_id:
            yield Order(at, change.data, change)
    final = saved.get(cob_id, now.get(cob_id))
    if final is not None:
        yield Order(cob_id, final, mine.get(cob_id))


def _mapping(
    index: int, mine: Mapping[Address, Change], saved: Mapping[Address, bytes], unused: list[tuple[Change, str]]
) -> Iterator[Order]:
    count = Address(index, 0)
    changed = [at for at in mine if at.index == index]
    if not changed:
        return
    number = int.from_bytes(saved.get(count, b""), "little")
    yield Order(count, b"\0")
    for sub in range(1, number + 1):
        at = Address(index, sub)
        if at in saved:
            yield Order(at, saved[at], mine.get(at))
    yield Order(count, bytes((number,)), mine.get(count))
    unused += [(mine[at], f"beyond the {number} mapped objects") for at in changed if at.sub > number]


def _communication_orders(changes: list[Change]) -> Iterator[Order]:
    for each in changes:
        if each.at.index == HEARTBEATS and any(each.before):
            # no node may stand in two entries (CiA 301, 1016h)
            yield Order(each.at, bytes(len(each.data)))
    for each in changes:
        if each.at.index == EMCY and not int.from_bytes(each.before, "little") & OFF:
            yield Order(each.at, (int.from_bytes(each.before, "little") | OFF).to_bytes(4, "little"))
        yield Order(each.at, each.data, each)


def _order(at: Address) -> tuple[int, int]:
    return at.index, at.sub
