"""Reads EDS and DCF files (CiA 306) as manufacturers really write them: which objects a drive has. It decides nothing.

Whatever can be understood is taken; what is odd becomes a note with its line. An EDS is optional in canbase.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from canbase_config.bounded_file import read_bounded

MAX_BYTES: Final = 8_000_000
MAX_NUMBER: Final = 200
"""Characters of a number with its $NODEID, spaces and comment: more than any data type has."""
MAX_NOTES: Final = 1_000
"""What is odd after that is not noted."""
_ENCODINGS: Final = ("utf-8", "cp1252", "latin-1")
_OBJECT: Final = re.compile(r"([0-9a-f]{4})(?:sub([0-9a-f]{1,2}))?", re.IGNORECASE)
_NODE_ID: Final = re.compile(r"\$?NODEID", re.IGNORECASE)
_UNSIGNED8: Final = 0x05
_SIGNED_BITS: Final = {0x02: 8, 0x03: 16, 0x04: 32, 0x10: 24, 0x15: 64}
"""Bits of the signed data types (CiA 301)."""
MAX_COMPACT: Final = 254
"""Sub-indexes of an array."""
_ACCESS: Final = frozenset(("ro", "wo", "rw", "rwr", "rww", "const"))


class EdsError(Exception):
    """The file cannot be used. The text names file, line where there is one, and reason."""


@dataclass(frozen=True, slots=True)
class EdsObject:
    """One object or sub-object. `default`: its number as the drive comes up, node id 0; None: none is given.

    `low`, `high`: the range of its value; None: none is given, or it is no number. `text`: the value as the file has
    it, of a DCF its ParameterValue (then `is_set`), else the DefaultValue.
    """

    index: int
    sub: int
    name: str
    line: int
    data_type: int | None
    access: str
    default: int | None
    low: int | None = None
    high: int | None = None
    text: str = ""
    is_set: bool = False
    has_node_id: bool = False
    """Whether the node id is added to its value, or to its default."""
    is_mappable: bool | None = None
    """PDOMapping; None: the file does not say."""

    @property
    def is_writable(self) -> bool:
        """By its AccessType."""
        return self.access not in ("ro", "const")


@dataclass(frozen=True, slots=True)
class Eds:
    """The content of a file. `objects` by (index, sub-index); `info` is [DeviceInfo], keys in lower case."""

    path: Path
    encoding: str
    objects: Mapping[tuple[int, int], EdsObject]
    info: Mapping[str, str]
    notes: tuple[str, ...]
    """What is odd, a sentence each, with its line."""
    names: Mapping[int, str]
    """Of each index that has a section of its own: the name of a whole array or record."""
    compact: Mapping[int, int]
    """Arrays that the file does not spell out (CompactSubObj): how many sub-indexes follow sub-index 0."""
    sections: Mapping[str, Mapping[str, str]]
    """The sections that describe no object: by name and key, both in lower case."""

    def has(self, index: int, sub: int | None = None) -> bool:
        """Whether the object is described; any sub-index of it when `sub` is None."""
        return (index, sub) in self.objects if sub is not None else any(key[0] == index for key in self.objects)

    def default(self, index: int, sub: int = 0) -> int | None:
        """Its default value; None when the object or its default is not there."""
        found = self.objects.get((index, sub))
        return found.default if found else None


@dataclass(slots=True)
class _Section:
    name: str
    line: int
    values: dict[str, tuple[str, int]]
    """By key in lower case: text and line."""


def read_eds(path: str | Path) -> Eds:
    """The EDS or DCF file at `path`. Raises EdsError when nothing in it describes a CANopen device."""
    path = Path(path)
    text, encoding = read_text(path)
    notes: list[str] = [] if encoding == "utf-8" else [f"read as {encoding}: it is no UTF-8"]
    sections = _sections(text, notes)
    compact = dict(_compact(sections))
    objects = {(found.index, found.sub): found for found in _objects(sections, compact, notes)}
    if not objects:
        first = next((line for line in text.splitlines() if line.strip()), "")
        if first.lstrip().startswith("<"):
            raise EdsError(f"{path}:1: this is XML (XDD or XDC, CiA 311), which is not read: take the drive's EDS file")
        raise EdsError(f"{path}:1: no section describes an object ([1000], [6040], …); it begins with {first[:40]!r}")
    info = sections.get("deviceinfo")
    if info is None:
        notes.append("it has no section [DeviceInfo]")
    notes += _lists(sections, objects)
    others = {name: _plain(section) for name, section in sections.items() if not _OBJECT.fullmatch(name)}
    names = {int(name, 16): _plain(section).get("parametername", "") for name, section in _whole(sections)}
    return Eds(path, encoding, objects, others.get("deviceinfo", {}), tuple(notes[:MAX_NOTES]), names, compact, others)


def adds_node_id(text: str) -> bool:
    """Whether the value has a $NODEID, to which the node id belongs."""
    return bool(_NODE_ID.search(text[:MAX_NUMBER]))


def number(text: str) -> int | None:
    """The integer in an EDS value: decimal, 0x…, …h, octal with a leading 0 (CiA 306); `$NODEID` counts as 0."""
    if len(text) > MAX_NUMBER:
        return None
    rest = _NODE_ID.sub("0", text.split(";")[0]).replace(" ", "").replace("\t", "")
    terms = rest.split("+")
    numbers = [_term(term) for term in terms if term]
    return None if not numbers or None in numbers else sum(value for value in numbers if value is not None)


def _term(text: str) -> int | None:
    for pattern, base in ((r"([-+]?)0x([0-9a-f]+)", 16), (r"([-+]?)([0-9a-f]+)h", 16), (r"([-+]?)0([0-7]+)", 8)):
        match = re.fullmatch(pattern, text, re.IGNORECASE)
        if match:
            return int(match[1] + match[2], base)
    return int(text) if re.fullmatch(r"[-+]?\d+", text) else None


def read_text(path: Path) -> tuple[str, str]:
    """The content of an EDS file with its line ends, and its encoding. Raises EdsError."""
    try:
        data = read_bounded(path, MAX_BYTES)
    except OSError as error:
        raise EdsError(f"{path}: cannot be read: {error.strerror or error}") from error
    if len(data) > MAX_BYTES or b"\0" in data:
        what = f"is larger than {MAX_BYTES} bytes" if len(data) > MAX_BYTES else "has zero bytes"
        raise EdsError(f"{path}: {what}: no EDS file, which is text")
    for encoding in _ENCODINGS:
        try:
            return data.decode("utf-8-sig" if encoding == "utf-8" else encoding), encoding
        except UnicodeDecodeError:
            continue
    raise EdsError(f"{path}: in none of the encodings {', '.join(_ENCODINGS)}")


def _sections(text: str, notes: list[str]) -> dict[str, _Section]:
    """By name in lower case. Of a section or key that is there twice the first counts."""
    sections: dict[str, _Section] = {}
    current: _Section | None = None
    for number_of_line, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if not line or line[0] in ";#":
            continue
        if line.startswith("["):
            current = _begin(sections, line, number_of_line, notes)
        elif "=" in line and current is not None:
            _take(current, line, number_of_line, notes)
        else:
            notes.append(f"line {number_of_line}: neither a section nor a key: {line[:40]!r}")
    return sections


def _begin(sections: dict[str, _Section], line: str, at: int, notes: list[str]) -> _Section:
    name = line[1:].partition("]")[0].strip()
    section = _Section(name, at, {})
    before = sections.setdefault(name.lower(), section)
    if before is not section:
        notes.append(f"line {at}: section [{name}] is there already, in line {before.line}; the first counts")
    if "]" not in line:
        notes.append(f"line {at}: the bracket of [{name} is not closed")
    return section


def _take(section: _Section, line: str, at: int, notes: list[str]) -> None:
    key, _, value = line.partition("=")
    lower = key.strip().lower()
    if lower in section.values:
        notes.append(f"line {at}: {key.strip()} is there twice in [{section.name}]; the first counts")
        return
    section.values[lower] = (value.strip(), at)


def _plain(section: _Section) -> dict[str, str]:
    return {key: value for key, (value, _) in section.values.items()}


def _whole(sections: Mapping[str, _Section]) -> Iterator[tuple[str, _Section]]:
    """The sections of whole objects: by index alone."""
    return ((name, section) for name, section in sections.items() if re.fullmatch("[0-9a-f]{4}", name))


def _compact(sections: Mapping[str, _Section]) -> Iterator[tuple[int, int]]:
    for name, section in _whole(sections):
        count = number(section.values.get("compactsubobj", ("", 0))[0]) or 0
        if 0 < count <= MAX_COMPACT and name + "sub0" not in sections:
            yield int(name, 16), count


def _objects(sections: Mapping[str, _Section], compact: Mapping[int, int], notes: list[str]) -> Iterator[EdsObject]:
    for name, section in sections.items():
        match = _OBJECT.fullmatch(name)
        if match is None or (match[2] is None and name + "sub0" in sections):
            continue
        index = int(match[1], 16)
        if match[2] is None and index in compact:
            yield from _array(section, index, compact[index], sections, notes)
        else:
            yield _object(section, index, int(match[2] or "0", 16), notes)


def _array(
    section: _Section, index: int, count: int, sections: Mapping[str, _Section], notes: list[str]
) -> Iterator[EdsObject]:
    """An array with CompactSubObj: all sub-indexes are like its own section; a DCF has their values in [IIIIValue]."""
    yield EdsObject(index, 0, "Number of entries", section.line, _UNSIGNED8, "ro", count, text=str(count))
    values = sections.get(f"{section.name.lower()}value")
    alike = _object(section, index, 1, notes)
    for sub in range(1, count + 1):
        text, _ = values.values.get(str(sub), ("", 0)) if values else ("", 0)
        own = replace(alike, sub=sub, name=f"{alike.name} {sub}")
        yield replace(own, text=text, is_set=True, default=number(text)) if text else own


def _object(section: _Section, index: int, sub: int, notes: list[str]) -> EdsObject:
    def value(key: str) -> str:
        return section.values.get(key, ("", 0))[0]

    access = value("accesstype").lower()
    if access not in _ACCESS:
        if access:
            notes.append(f"line {section.line}: [{section.name}] has the access type {access!r}; rw is assumed")
        access = "rw"
    is_set = bool(value("parametervalue"))
    kind = number(value("datatype"))
    return EdsObject(
        index, sub, value("parametername"), section.line, kind, access, _default(section, notes),
        low=_limit(value("lowlimit"), kind), high=_limit(value("highlimit"), kind),
        text=value("parametervalue") if is_set else value("defaultvalue"), is_set=is_set,
        has_node_id=adds_node_id(value("parametervalue")) or adds_node_id(value("defaultvalue")),
        is_mappable=None if (mapping := number(value("pdomapping"))) is None else bool(mapping),
    )  # fmt: skip


def _limit(text: str, kind: int | None) -> int | None:
    """LowLimit or HighLimit. Of a signed number many files have the bit pattern: 0x8000 of sixteen bits is -32768."""
    limit = number(text)
    bits = _SIGNED_BITS.get(kind or 0)
    if limit is None or bits is None or limit >> (bits - 1) != 1:
        return limit
    return limit - (1 << bits)


def _default(section: _Section, notes: list[str]) -> int | None:
    """A DCF's ParameterValue goes before the DefaultValue."""
    for key in ("parametervalue", "defaultvalue"):
        text, at = section.values.get(key, ("", 0))
        if text:
            found = number(text)
            kind = number(section.values.get("datatype", ("", 0))[0])
            if found is None and kind in range(1, 8):
                notes.append(f"line {at}: {text[:30]!r} is no number")
            return found
    return None


def _lists(sections: Mapping[str, _Section], objects: Mapping[tuple[int, int], EdsObject]) -> Iterator[str]:
    """What the lists of objects and the sections do not agree on; the sections count."""
    listed: dict[int, int] = {}
    for name in ("mandatoryobjects", "optionalobjects", "manufacturerobjects"):
        section = sections.get(name)
        for key, (text, at) in section.values.items() if section else ():
            index = number(text) if key.isdigit() else None
            if index is not None:
                listed[index] = at
    described = {index for index, _ in objects}
    for index, at in listed.items():
        if index not in described:
            yield f"line {at}: {index:04X}h is listed, but no section describes it"
    unlisted = len(described - listed.keys())
    if unlisted:
        yield f"{unlisted} objects are described, but not listed"
