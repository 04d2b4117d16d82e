"""What one oddity is, and one as it was drawn for one drive, with what the drive's manual says about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

from canbase_sim.odd.manner import Manner

Value = Any
"""Of a key of a drive profile or of robot.yaml."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """One oddity of one drive. `text`: with its values."""

    text: str
    change: Callable[[Manner], Manner]
    keys: Mapping[str, Value] = field(default_factory=dict)
    """What its manual has: keys that describe the oddity, and their right values. Empty: none is needed."""
    tool: frozenset[int] = frozenset()
    """Indexes that the manufacturer's tool sets as they should be: then the oddity is gone."""
    unusable: bool = False
    """A drive without something that canbase needs (docs/drives.md)."""
    stops: frozenset[str] = frozenset()
    """Nothing in robot.yaml cures it: it drives, or it is stopped and the message has one of these words."""
    name: str = ""


@dataclass(frozen=True, slots=True)
class Oddity:
    """A behaviour. `clause`: what makes it legal; `draw`: its values for one drive."""

    clause: str
    sentence: str
    draw: Callable[[Random], Drawn]


def with_personality(**changes: Any) -> Callable[[Manner], Manner]:
    """These fields of its personality; sets and mappings are added to those that it has."""

    def change(manner: Manner) -> Manner:
        kept = manner.personality
        merged = {name: _joined(getattr(kept, name), value) for name, value in changes.items()}
        return replace(manner, personality=replace(kept, **merged))

    return change


def with_manner(**changes: Any) -> Callable[[Manner], Manner]:
    """These fields; mappings are added to those that it has."""
    return lambda manner: replace(
        manner, **{name: _joined(getattr(manner, name), value) for name, value in changes.items()}
    )


def both(*changes: Callable[[Manner], Manner]) -> Callable[[Manner], Manner]:
    """One after the other."""

    def change(manner: Manner) -> Manner:
        for each in changes:
            manner = each(manner)
        return manner

    return change


def _joined(kept: Any, more: Any) -> Any:
    if isinstance(more, Mapping):
        return {**kept, **more}
    return kept | more if isinstance(more, frozenset) else more
