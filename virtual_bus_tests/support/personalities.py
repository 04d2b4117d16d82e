"""Simulated drives with other PDOs than their kind has: they refuse SYNC, or have one TPDO for each motor."""

from __future__ import annotations

from dataclasses import replace

import pytest

from canbase_sim.cia301.dictionary import key
from canbase_sim.personality import PERSONALITIES, Personality

NO_SYNC = Personality(missing=frozenset((0x1005, 0x1019)))
"""It heeds no SYNC, and refuses types 1 to 240 (CiA 301)."""


def set_personality(monkeypatch: pytest.MonkeyPatch, kind: str, personality: Personality) -> None:
    """All simulated drives of this kind, or with this profile file, are so until the test ends."""
    assert isinstance(PERSONALITIES, dict)
    monkeypatch.setitem(PERSONALITIES, kind, personality)


def with_tpdos(personality: Personality, number: int) -> Personality:
    """The same drive with so many of the four TPDOs."""
    missing = frozenset(base + n for base in (0x1800, 0x1A00) for n in range(number, 4))
    off = {key(0x1800 + n, 1): 1 << 31 for n in range(number, 4)}
    return replace(personality, missing=personality.missing | missing, defaults={**personality.defaults, **off})
