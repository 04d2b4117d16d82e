"""What two sets of parameters do not have in common: settings alone, or every object. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.parameter_kinds import why_no_setting
from canbase_commissioning.parameters.saved import DriveIdentity, Parameters
from canbase_commissioning.parameters.value_text import to_text
from canbase_config.eds_file import Eds, EdsObject


@dataclass(frozen=True, slots=True)
class Difference:
    """One object. None: that side does not have it; `why` says what is known about that."""

    at: Address
    name: str
    first: str | None
    second: str | None
    why: str = ""

    def __str__(self) -> str:
        first, second = ("–" if text is None else text for text in (self.first, self.second))
        return f"{self.at} {self.name}: {first} → {second}{f' ({self.why})' if self.why else ''}"


@dataclass(frozen=True, slots=True)
class Comparison:
    """`product`, `firmware`: how the drives themselves differ, in a sentence; empty: they do not, or it is unknown."""

    differences: tuple[Difference, ...]
    compared: int
    """Objects that both sides have."""
    product: str
    firmware: str

    @property
    def alike(self) -> bool:
        """Whether there is nothing to report."""
        return not (self.differences or self.product or self.firmware)


def compare(first: Parameters, second: Parameters, eds: Eds, *, everything: bool = False) -> Comparison:
    """The differences of `second` against `first`, COB-IDs seen from its node id. `eds`: of one of them."""
    if second.node_id is not None and first.node_id is not None:
        first = first.for_node(second.node_id, eds)
    both = first.values.keys() & second.values.keys()
    found = []
    compared = 0
    for at in sorted(first.values.keys() | second.values.keys(), key=lambda each: (each.index, each.sub)):
        entry = eds.objects.get((at.index, at.sub))
        if entry is None or (why_no_setting(entry) and not everything):
            continue
        compared += at in both
        if first.values.get(at) != second.values.get(at):
            found.append(_difference(at, entry, first, second))
    return Comparison(
        tuple(found),
        compared,
        product_differs(first.identity, second.identity),
        firmware_differs(first.identity, second.identity),
    )


def _difference(at: Address, entry: EdsObject, first: Parameters, second: Parameters) -> Difference:
    texts = [_shown(each.values.get(at), entry) for each in (first, second)]
    if texts[0] == texts[1]:
        texts = [None if each is None else each.hex(" ") for each in (first.values.get(at), second.values.get(at))]
    reasons = [each.refused.get(at, "") for each in (first, second) if at not in each.values]
    return Difference(at, entry.name, texts[0], texts[1], next((why for why in reasons if why), ""))


def _shown(data: bytes | None, entry: EdsObject) -> str | None:
    if data is None:
        return None
    text = to_text(data, entry.data_type)
    return f'"{text}"' if entry.data_type == 0x09 else text


def product_differs(first: DriveIdentity, second: DriveIdentity) -> str:
    """Another maker or product (1018h:1, 1018h:2); what one side does not know does not count."""
    pairs = ((first.vendor_id, second.vendor_id), (first.product_code, second.product_code))
    if any(None not in pair and pair[0] != pair[1] for pair in pairs):
        return f"another product: {first} → {second}"
    return ""


def same_product(first: DriveIdentity, second: DriveIdentity) -> bool:
    """Whether both are known to be one product: two values that nobody knows are not."""
    pairs = ((first.vendor_id, second.vendor_id), (first.product_code, second.product_code))
    return all(None not in pair and pair[0] == pair[1] for pair in pairs)


def firmware_differs(first: DriveIdentity, second: DriveIdentity) -> str:
    """Another revision, hardware or software (1018h:3, 1009h, 100Ah); what one side does not know does not count."""
    pairs = (
        ("revision 1018h:3", _hex(first.revision), _hex(second.revision)),
        ("hardware 1009h", first.hardware, second.hardware),
        ("software 100Ah", first.software, second.software),
    )
    return ", ".join(f"{what}: {a} → {b}" for what, a, b in pairs if a and b and a != b)


def _hex(number: int | None) -> str:
    return "" if number is None else f"{number:X}h"
