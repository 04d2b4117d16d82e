"""Objects by their names in an EDS, and what the EDS allows: access and range (CiA 306). Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import Final

from canbase_commissioning.object_dictionary import Address, decode, encode, parse_address
from canbase_config.eds_file import Eds, EdsObject
from canbase_config.errors import printable

MOST_NAMED: Final = 8
"""Candidates in a message."""
_WHOLE_TOKENS: Final = str.maketrans("_-", "  ")


def find_object(text: str, eds_files: Sequence[Eds]) -> Address:
    """An address (`6041`, `0x1018:4`), or a name: `Target velocity`, `Identity.Vendor-ID`, `Identity:4`.

    Case, spaces, `-` and `_` do not matter. The first file that has the name counts. Raises ValueError with the nearest
    names, or with all objects of that name.
    """
    try:
        return parse_address(text)
    except ValueError as error:
        no_address = str(error)
    if not any(one.isalpha() for one in text):
        raise ValueError(no_address)
    for eds in eds_files:
        found = _named(text, eds)
        if len(found) > 1:
            raise ValueError(f"{text!r} is the name of several objects: {_listed(found, eds)}. Write the index")
        if found:
            return found[0]
    raise ValueError(_nearest(text, eds_files))


def _named(text: str, eds: Eds) -> list[Address]:
    wanted = _plain(text)
    found = [at for at, name in _names(eds) if _plain(name) == wanted]
    if found:
        return list(dict.fromkeys(found))
    name, colon, sub = text.rpartition(":")
    if colon and sub.strip().isdecimal() and int(sub) <= 0xFF:
        return [Address(index, int(sub)) for index, whole in eds.names.items() if _plain(whole) == _plain(name)]
    return []


def _names(eds: Eds) -> Iterator[tuple[Address, str]]:
    """Every object by its own name, a part of an array or record also behind the name of the whole."""
    for index, sub in eds.objects:
        at, own = Address(index, sub), eds.objects[index, sub].name
        yield at, own
        whole = eds.names.get(index, "")
        if whole and whole != own:
            yield at, f"{whole}.{own}"


def _plain(name: str) -> str:
    return " ".join(name.translate(_WHOLE_TOKENS).casefold().split())


def _listed(found: Sequence[Address], eds: Eds) -> str:
    shown = ", ".join(f"{at} {_whole_name(at, eds)}" for at in found[:MOST_NAMED])
    return printable(shown if len(found) <= MOST_NAMED else f"{shown} and {len(found) - MOST_NAMED} more")


def _whole_name(at: Address, eds: Eds) -> str:
    whole, own = eds.names.get(at.index, ""), eds.objects[at.index, at.sub].name
    return own if whole in ("", own) else f"{whole}.{own}"


def _nearest(text: str, eds_files: Sequence[Eds]) -> str:
    names = {_plain(name): (at, name) for eds in reversed(eds_files[:1]) for at, name in _names(eds) if name}
    near = [names[each] for each in get_close_matches(_plain(text), names, n=5, cutoff=0.5)]
    file = eds_files[0].path.name if eds_files else "any EDS"
    hint = f"; near: {', '.join(f'{name} ({at})' for at, name in near)}" if near else ""
    return printable(f"no object {text!r} in {file}{hint}. An address is INDEX or INDEX:SUB, such as 6041 or 1018:4")


def why_not_read(entry: EdsObject | None) -> str:
    """Why the EDS does not let it be read; empty: it does, or the EDS does not have it."""
    return "it is write-only by the EDS" if entry is not None and entry.access == "wo" else ""


def why_not_write(entry: EdsObject | None, text: str, kind: str) -> str:
    """Why the EDS does not let `text` be written, an object of type `kind`; empty: it does, or does not have it.

    Raises ValueError when `text` does not fit `kind`.
    """
    if entry is None:
        return ""
    if entry.access in ("ro", "const"):
        return f"it is {'constant' if entry.access == 'const' else 'read-only'} by the EDS"
    value = decode(encode(text, kind), kind) if kind[:1] in ("u", "i", "f") else None
    if isinstance(value, str) or value is None:
        return ""
    below = entry.low is not None and value < entry.low
    above = entry.high is not None and value > entry.high
    return f"{text} is outside the range of the EDS, {limits(entry)}" if below or above else ""


def limits(entry: EdsObject) -> str:
    """The range for a person; empty: none is given."""
    if entry.low is None and entry.high is None:
        return ""
    low, high = ("…" if limit is None else str(limit) for limit in (entry.low, entry.high))
    return f"{low} to {high}"
