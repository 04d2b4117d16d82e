"""Fastscan: drives without a node id are found one after the other by the bits of their identity (CiA 305).

Each step asks whether some drive has certain bits, and silence is an answer too: no. Several drives answer, each in its
own time, so every step takes all of its time. A drive that answers later than that would give wrong bits. So each of
the four numbers is confirmed as a whole at its end, when nothing is late any more, and a scan that fails is repeated
with longer waits.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

from canbase_commissioning.conversation import ConversationError, Exchange, Progress, Talk, say
from canbase_commissioning.lss import protocol
from canbase_commissioning.lss.assignment import MAX_DRIVE_ID
from canbase_commissioning.lss.master import ATTEMPTS, SETTLE_S
from canbase_commissioning.lss.protocol import IDENTIFIED, SET_NODE_ID, Identity, is_answer
from canbase_driver.cia301.frame import Frame

WAITS_S: Final = (0.02, 0.06, 0.25)
"""For an answer, in the first scan and in those after a failure [s]; CANopenNode's master waits 10 to 100 ms."""
FRAMES_BITS: Final = 3 * 135
"""Request and answer behind one other frame, with stuff bits."""
BITS: Final = 32
GUESSES: Final = 8
"""More identities to try first would take longer than to scan."""


def scan_for_all(bitrate: int, likely: tuple[Identity, ...] = (), taken: Collection[int] = ()) -> Talk[list[Identity]]:
    """Every drive without a node id, by identity. Each has one afterwards, until its next power cycle: the highest that
    is free of `taken`.

    `likely`: drives of these kinds come first to mind: their vendor, product and revision are tried as a whole.
    Raises ConversationError when drives answer and cannot be told apart.
    """
    free = (node_id for node_id in range(MAX_DRIVE_ID, 0, -1) if node_id not in taken)
    found: list[Identity] = []
    while True:
        one = yield from _scan_patiently(bitrate, likely, len(found))
        if one is None:
            return found
        if one in found:
            raise ConversationError(
                f"two drives have the same identity, {one}, or it does not leave the scan: connect one at a time"
            )
        found.append(one)
        node_id = next(free, None)
        if node_id is None:
            raise ConversationError(
                f"{len(found)} drives without a node id have answered, and no node id is free: no bus has so many; "
                "one device invents them. Connect one drive at a time"
            )
        yield from _leave(node_id)
        likely = (one, *likely)[:GUESSES]


def _leave(node_id: int) -> Talk[None]:
    """The drive that was found is alone in LSS configuration. It takes a node id and restarts with it, unstored.

    Configuration alone is not enough: the LSS slave of CANopenNode (commit 9b8beed, CO_LSSslave.c) answers every
    fastscan request there, and so hides the bits of all other drives.
    """
    yield Exchange((protocol.set_node_id(node_id),), is_answer(SET_NODE_ID), WAITS_S[-1])
    yield say(protocol.switch_all(configuration=False), wait_s=SETTLE_S)


def _scan_patiently(bitrate: int, likely: tuple[Identity, ...], number: int) -> Talk[Identity | None]:
    """None: nobody answers any more."""
    for wait_s in WAITS_S:
        pause_s = wait_s + FRAMES_BITS / bitrate
        if not (yield from _is_anybody_left()):
            return None
        parts = yield from _scan(pause_s, likely, number)
        if parts is not None:
            return Identity(*parts)
    raise ConversationError(
        "a drive without a node id answers fastscan, and its identity cannot be read: is the bus disturbed, or do two "
        "drives have the same serial number? Connect one drive at a time"
    )


def _is_anybody_left() -> Talk[bool]:
    """One lost frame must not end the scan: a drive that was found restarts meanwhile."""
    for _ in range(ATTEMPTS):
        if (yield from _matches(protocol.scan_again(), WAITS_S[-1])):
            return True
    return False


def _scan(wait_s: float, likely: tuple[Identity, ...], number: int) -> Talk[tuple[int, int, int, int] | None]:
    """The lowest identity that answers; None: its confirmation failed."""
    parts: list[int] = []
    for part in range(4):
        alike = [one.parts[part] for one in likely if list(one.parts[:part]) == parts]
        guesses = tuple(dict.fromkeys(alike)) if part < 3 else ()
        value = yield from _part(part, guesses, wait_s, number)
        if value is None:
            return None
        parts.append(value)
    return parts[0], parts[1], parts[2], parts[3]


def _part(part: int, guesses: tuple[int, ...], wait_s: float, drive: int) -> Talk[int | None]:
    """One number, bit by bit from the highest; None: the whole number is not confirmed."""
    following = (part + 1) % 4
    for guess in guesses:
        if (yield from _matches(protocol.scan(guess, 0, part, following), wait_s)):
            return guess
    value = 0
    for bit in reversed(range(BITS)):
        yield Progress(f"fastscan, drive {drive + 1}", (part + 1) * BITS - bit, 4 * BITS)
        # The drive stays at this part until its last bit is confirmed.
        if not (yield from _matches(protocol.scan(value, bit, part, part), wait_s)):
            value |= 1 << bit
    yield Exchange((), is_answer(IDENTIFIED), 2 * wait_s)  # a late answer must not confirm
    confirmed = yield from _matches(protocol.scan(value, 0, part, following), wait_s)
    return value if confirmed else None


def _matches(request: Frame, wait_s: float) -> Talk[bool]:
    answers: tuple[Frame, ...] = yield Exchange((request,), is_answer(IDENTIFIED), wait_s)
    return bool(answers)
