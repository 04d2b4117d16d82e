"""Writes a DCF (CiA 306): the manufacturer's EDS as it is, and in it the values of one drive.

Line by line, so that nothing is lost of what the manufacturer wrote, odd as it may be; why: docs/decisions/0101.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.saved import Parameters
from canbase_commissioning.parameters.value_text import to_bytes, to_text
from canbase_config.eds_file import Eds

DRIVE, REFUSED, EXACT = "CanbaseDrive", "CanbaseRefused", "CanbaseBytes"
"""Sections of ours, which other readers pass over: who the drive is, what it refused, and values that no text holds."""
COMMISSIONING: Final = "DeviceComissioning"
"""With one m, as CiA 306 has it."""
_SECTION: Final = re.compile(r"\s*\[([^\]]*)\]?")
_OBJECT: Final = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?", re.IGNORECASE)
_FILE_KEYS: Final = ("filename", "lasteds", "modificationtime", "modificationdate", "modifiedby")
_VALUE: Final = re.compile(r"\s*parametervalue\s*=", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Heading:
    """What the file says about itself. `date`: MM-DD-YYYY, `time`: hh:mmAM (CiA 306); `bitrate` in bit/s."""

    file_name: str
    date: str
    time: str
    bitrate: int | None


def dcf_text(eds_text: str, eds: Eds, saved: Parameters, heading: Heading) -> str:
    """The content of the DCF. `eds_text`: the content of `eds`."""
    end = "\r\n" if "\r\n" in eds_text else "\n"
    texts = {at: to_text(data, _type(eds, at)) for at, data in saved.values.items()}
    lines: list[str] = []
    sections = list(_sections(eds_text))
    names = {name.lower() for name, _ in sections}
    seen: set[str] = set()
    for name, body in sections:
        if name.lower() in seen or (_OBJECT.fullmatch(name) and f"{name.lower()}sub0" in names):
            lines += body
        else:
            lines += _section(name, body, eds, texts, heading)
        seen.add(name.lower())
    while lines and not lines[-1].strip():
        lines.pop()
    lines += [*_commissioning(saved, heading), *_arrays(eds, texts), *_ours(eds, saved, texts)]
    return end.join(lines) + end


def _type(eds: Eds, at: Address) -> int | None:
    found = eds.objects.get((at.index, at.sub))
    return found.data_type if found else None


def _sections(text: str) -> Iterator[tuple[str, list[str]]]:
    """Name, and lines with the one that names it; what stands before the first one has the name ""."""
    name, body = "", list[str]()
    for line in text.splitlines():
        match = _SECTION.match(line)
        if match is not None:
            yield name, body
            name, body = match[1].strip(), []
        body.append(line)
    yield name, body


def _section(name: str, body: list[str], eds: Eds, texts: Mapping[Address, str], heading: Heading) -> list[str]:
    """A section that counts, with the values of its object."""
    lower = name.lower()
    if lower in (COMMISSIONING.lower(), DRIVE.lower(), REFUSED.lower(), EXACT.lower()):
        return []
    if lower == "fileinfo":
        return _file_info(body, eds, heading)
    match = _OBJECT.fullmatch(name)
    if match is None:
        return [] if re.fullmatch("[0-9a-f]{4}value", lower) and int(lower[:4], 16) in eds.compact else body
    at = Address(int(match[1], 16), int(match[2] or "0", 16))
    if at.index in eds.compact:
        return body
    body = [line for line in body if not _VALUE.match(line)]
    return _with(body, [f"ParameterValue={texts[at]}"]) if at in texts else body


def _with(body: list[str], added: list[str]) -> list[str]:
    """Behind the last line that says something."""
    end = len(body)
    while end > 1 and (not body[end - 1].strip() or body[end - 1].lstrip()[0] in ";#"):
        end -= 1
    return [*body[:end], *added, *body[end:]]


def _file_info(body: list[str], eds: Eds, heading: Heading) -> list[str]:
    kept = [line for line in body if line.partition("=")[0].strip().lower() not in _FILE_KEYS]
    return _with(
        kept,
        [
            f"FileName={heading.file_name}",
            f"LastEDS={eds.path.name}",
            f"ModificationTime={heading.time}",
            f"ModificationDate={heading.date}",
            "ModifiedBy=canbase",
        ],
    )


def _commissioning(saved: Parameters, heading: Heading) -> list[str]:
    lines = ["", f"[{COMMISSIONING}]", f"NodeID={saved.node_id}", f"NodeName={saved.identity.name}"]
    rate = [f"Baudrate={heading.bitrate // 1000}"] if heading.bitrate else []
    serial = [] if saved.identity.serial is None else [f"LSS_SerialNumber={saved.identity.serial}"]
    return [*lines, *rate, "NetNumber=0", "NetworkName=", "CANopenManager=0", *serial]


def _arrays(eds: Eds, texts: Mapping[Address, str]) -> Iterator[str]:
    for index in eds.compact:
        values = {at.sub: text for at, text in texts.items() if at.index == index and at.sub}
        yield from ("", f"[{index:04X}Value]", f"NrOfEntries={len(values)}")
        yield from (f"{sub}={text}" for sub, text in sorted(values.items()))


def _ours(eds: Eds, saved: Parameters, texts: Mapping[Address, str]) -> Iterator[str]:
    identity = saved.identity
    ids = (identity.vendor_id, identity.product_code, identity.revision, identity.serial)
    numbers = zip(("VendorId", "ProductCode", "Revision", "Serial"), ids, strict=True)
    yield from ("", f"[{DRIVE}]")
    yield from (f"{name}=0x{value:08X}" for name, value in numbers if value is not None)
    named = (("Name", identity.name), ("Hardware", identity.hardware), ("Software", identity.software))
    yield from (f"{name}={text}" for name, text in named if text)
    yield from ("", f"[{REFUSED}]")
    yield from (f"{key(at)}={why}" for at, why in sorted(saved.refused.items(), key=lambda row: _order(row[0])))
    yield from ("", f"[{EXACT}]")
    for at, text in texts.items():
        is_written = at.sub or at.index not in eds.compact
        if not is_written or to_bytes(text, _type(eds, at), saved.node_id or 0) != saved.values[at]:
            yield f"{key(at)}={saved.values[at].hex().upper()}"


def key(at: Address) -> str:
    """An object in the sections of ours: `6041sub0`."""
    return f"{at.index:04X}sub{at.sub:X}"


def _order(at: Address) -> tuple[int, int]:
    return at.index, at.sub
