"""How each source and lock of velocity_mux stands, as canbase/msg/MuxSource and MuxLock number it."""

from __future__ import annotations

from enum import IntEnum


class SourceStanding(IntEnum):
    """Why a source of velocities drives or does not. The numbers are the constants of MuxSource.msg."""

    UNKNOWN = 0
    """A number that the interface does not have; the mux never sends it."""
    FOLLOWED = 1
    UNARMED = 2
    """It has the base, and has not shown zero yet, or cannot be armed."""
    DELAYED = 3
    """It has the base, and its commands arrive late."""
    NEVER_RECEIVED = 4
    SILENT = 5
    LOCKED = 6
    LOWER_PRIORITY = 7
    SHUTDOWN = 8


IGNORED = frozenset({SourceStanding.UNARMED, SourceStanding.DELAYED})
"""The source has the base and is not followed: the order is zero, and no lower source moves the base."""


class LockStanding(IntEnum):
    """Why a lock holds sources back or does not. The numbers are the constants of MuxLock.msg."""

    UNKNOWN = 0
    """A number that the interface does not have; the mux never sends it."""
    FREE = 1
    LOCKED = 2
    SHARED = 3
    """Several publishers: a message of one does not release what another one holds."""
    NEVER_RECEIVED = 4
    SILENT = 5

    @property
    def word(self) -> str:
        """In a headline."""
        return self.name.lower().replace("_", " ")


def source_standing(number: int) -> SourceStanding:
    """The standing with this number; UNKNOWN for one that is not in the interface."""
    return SourceStanding(number) if number in _SOURCE_NUMBERS else SourceStanding.UNKNOWN


def lock_standing(number: int) -> LockStanding:
    """The standing with this number; UNKNOWN for one that is not in the interface."""
    return LockStanding(number) if number in _LOCK_NUMBERS else LockStanding.UNKNOWN


_SOURCE_NUMBERS, _LOCK_NUMBERS = frozenset(SourceStanding), frozenset(LockStanding)
