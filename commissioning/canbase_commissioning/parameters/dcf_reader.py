"""The parameters in a DCF, ours or another program's (CiA 306); of an EDS the defaults."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.dcf_writer import COMMISSIONING, DRIVE, EXACT, REFUSED, key
from canbase_commissioning.parameters.saved import DriveIdentity, Parameters
from canbase_commissioning.parameters.value_text import octets, to_bytes
from canbase_config.eds_file import Eds, EdsError, number, read_eds
from canbase_config.errors import printable

MOST_REASON: Final = 200
"""Characters of a reason that are kept."""


def read_parameters(path: str | Path) -> tuple[Parameters, Eds]:
    """The values of the file, and the file. Raises EdsError, also for a DCF of which a value cannot be understood.

    A file without any ParameterValue is an EDS: its DefaultValues count, for node id 0.
    """
    eds = read_eds(path)
    is_dcf = holds_values(eds)
    node_id = _node_id(eds) if is_dcf else 0
    exact = eds.sections.get(EXACT.lower(), {})
    values = {}
    for (index, sub), entry in eds.objects.items():
        at = Address(index, sub)
        hexadecimal = exact.get(key(at).lower(), "")
        if not hexadecimal and (not entry.text or (is_dcf and not entry.is_set)):
            continue
        data = octets(hexadecimal) if hexadecimal else to_bytes(entry.text, entry.data_type, node_id or 0)
        if data is not None:
            values[at] = data
        elif is_dcf:
            what = f"the value {printable(hexadecimal or entry.text, 40)!r} of {at} does not fit its data type"
            raise EdsError(f"{eds.path}:{entry.line}: {what} {entry.data_type or 0:04X}h")
    kind = "parameters" if is_dcf else "defaults"
    return Parameters(node_id, values, _refused(eds), _identity(eds), f"{kind} in {eds.path.name}"), eds


def holds_values(eds: Eds) -> bool:
    """Whether the file is a DCF with values, and no EDS."""
    return DRIVE.lower() in eds.sections or any(entry.is_set for entry in eds.objects.values())


def _node_id(eds: Eds) -> int | None:
    node_id = number(eds.sections.get(COMMISSIONING.lower(), {}).get("nodeid", ""))
    return node_id if node_id is not None and 1 <= node_id <= 127 else None


def _refused(eds: Eds) -> dict[Address, str]:
    section = eds.sections.get(REFUSED.lower(), {})
    by_key = {key(Address(index, sub)).lower(): Address(index, sub) for index, sub in eds.objects}
    return {by_key[name]: why[:MOST_REASON] for name, why in section.items() if name in by_key}


def _identity(eds: Eds) -> DriveIdentity:
    """From our own section; of another program's DCF from the objects."""
    ours = eds.sections.get(DRIVE.lower())
    if ours is not None:
        numbers = (number(ours.get(name, "")) for name in ("vendorid", "productcode", "revision", "serial"))
        return DriveIdentity.of(numbers, (ours.get(name, "") for name in ("name", "hardware", "software")))
    return DriveIdentity.of((_shown(eds, sub) for sub in range(1, 5)), _texts(eds.objects))


def _shown(eds: Eds, sub: int) -> int | None:
    """1018h; many files have 0 there for "whatever the drive has"."""
    return eds.default(0x1018, sub) or None


def _texts(objects: Mapping[tuple[int, int], object]) -> tuple[str, ...]:
    return tuple(getattr(objects.get((index, 0)), "text", "") for index in (0x1008, 0x1009, 0x100A))
