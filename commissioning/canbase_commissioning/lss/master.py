"""What an LSS master does with one drive after the other: each request has an answer, or it ends with the reason."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from canbase_commissioning.conversation import ConversationError, Exchange, Progress, Talk, say
from canbase_commissioning.lss import protocol
from canbase_commissioning.lss.protocol import Identity, is_answer
from canbase_driver.cia301.frame import Frame

ATTEMPTS: Final = 3
PATIENT: Final = 12
"""Attempts where a drive may be restarting."""
WAIT_S: Final = 0.3
"""For an answer [s]. A drive that writes its memory first (STORE) may need longer."""
STORE_WAIT_S: Final = 2.0
LINGER_S: Final = 0.01
"""After the first answer, for that of a second drive [s]."""
SETTLE_S: Final = 0.02
"""After a request without an answer [s]."""


def ask(request: Frame, who: str, wait_s: float = WAIT_S) -> Talk[Frame]:
    """The one answer of the drive in LSS configuration. Raises ConversationError for none, or for several."""
    return (yield from _ask((request,), request.data[0], who, wait_s))


def select(identity: Identity, attempts: int = ATTEMPTS) -> Talk[None]:
    """This drive alone enters LSS configuration, and proves by inquiry that it is the one. Raises ConversationError."""
    who = str(identity)
    yield say(protocol.switch_all(configuration=False), wait_s=SETTLE_S)
    yield from _ask(protocol.select(identity), protocol.SELECTED, who, attempts=attempts)
    for sub, part in enumerate(identity.parts, 1):
        answer = yield from ask(protocol.inquire(sub), who)
        found = int.from_bytes(answer.data[1:5], "little")
        if found != part:
            raise ConversationError(f"{who}: 1018h:{sub} is {found:X}h by LSS, {part:X}h was selected; nothing is set")


def set_up(identity: Identity, node_id: int, bitrate: int | None) -> Talk[None]:
    """The drive takes node id and bit rate [bit/s], None: keeps it; neither is in use yet. Raises ConversationError."""
    yield from select(identity, PATIENT)
    yield from _set(protocol.set_node_id(node_id), f"{identity}, node id {node_id}")
    if bitrate is not None:
        yield from _set(protocol.set_bit_rate(bitrate), f"{identity}, {bitrate} bit/s")


def keep(identity: Identity) -> Talk[None]:
    """The drive stores what was set. Raises ConversationError."""
    yield from select(identity, PATIENT)
    yield from _set(protocol.store(), f"{identity}, store", STORE_WAIT_S)


def set_up_all(node_ids: dict[Identity, int], bitrate: int | None) -> Talk[None]:
    """Every drive. The first refusal ends it, with nothing in use and nothing stored. Raises ConversationError."""
    for i, (identity, node_id) in enumerate(node_ids.items()):
        yield Progress(f"{identity}: node {node_id}", i, len(node_ids))
        yield from set_up(identity, node_id, bitrate)
    yield say(protocol.switch_all(configuration=False), wait_s=SETTLE_S)


def keep_all(node_ids: dict[Identity, int]) -> Talk[list[Identity]]:
    """Every drive stores. Raises ConversationError that names those that have stored already."""
    kept: list[Identity] = []
    for i, identity in enumerate(node_ids):
        yield Progress(f"{identity}: store", i, len(node_ids))
        try:
            yield from keep(identity)
        except ConversationError as error:
            done = ", ".join(map(str, kept)) or "none"
            raise ConversationError(
                f"{error}. Stored so far: {done}. Run it again with the others connected"
            ) from error
        kept.append(identity)
    yield say(protocol.switch_all(configuration=False), wait_s=SETTLE_S)
    return kept


def change_rate(identities: Iterable[Identity], delay_s: float) -> Talk[None]:
    """Every drive changes to its next bit rate at once: two rates on one cable destroy each other's frames.

    A drive that got its first node id has restarted by itself: all of them have to answer before. Raises
    ConversationError when one does not; then none changes.
    """
    for identity in identities:
        yield from select(identity, PATIENT)
    yield say(protocol.switch_all(configuration=True), wait_s=SETTLE_S)
    yield say(protocol.activate(delay_s))


def _set(request: Frame, what: str, wait_s: float = WAIT_S) -> Talk[None]:
    why = protocol.refusal((yield from ask(request, what, wait_s)))
    if why:
        raise ConversationError(f"{what}: {why}")


def _ask(
    requests: tuple[Frame, ...], command: int, who: str, wait_s: float = WAIT_S, attempts: int = ATTEMPTS
) -> Talk[Frame]:
    for attempt in range(attempts):
        answers: tuple[Frame, ...] = yield Exchange(requests, is_answer(command), wait_s, LINGER_S)
        if len(answers) > attempt + 1:  # one may be late: of an earlier attempt
            raise ConversationError(f"{who}: {len(answers)} drives answer. Connect one of them at a time")
        if answers:
            return answers[-1]
    raise ConversationError(f"{who}: no answer to LSS {command:02X}h, {attempts} requests. Is it still connected?")
