"""From drives as they come out of their boxes to drives with node ids and a bit rate of their own: the steps. Pure.

0. `require_lss`: what can be known while each drive still has its node id is known before they are taken away.
1. `discover`: every drive loses its node id until its next power cycle, and fastscan finds them one after the other.
   What drives answer meanwhile is the same for all of them, so two with one node id do not disturb each other. A drive
   that was found gets a node id for the time being: so it leaves the scan.
2. `master.set_up_all`: each takes its node id and the bit rate. Neither is in use, and nothing is stored.
3. `master.change_rate`: all change their bit rate at once.
4. `master.keep_all`: at the new rate, each proves that it is there, and stores. A drive that is lost before this step
   has its old settings after a power cycle.
5. `take_into_use`: NMT reset communication, and each node id has one drive, with the identity that belongs to it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from canbase_commissioning.census import ALL, Census, read, require_no_power, take_census
from canbase_commissioning.conversation import ConversationError, Exchange, Progress, Talk, say
from canbase_commissioning.lss import master, protocol
from canbase_commissioning.lss.fastscan import WAITS_S, scan_for_all
from canbase_commissioning.lss.protocol import IDENTIFIED, SELECTED, SET_NODE_ID, UNCONFIGURED, Identity, is_answer
from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import ALL_NODES, NmtCommand, nmt, parse_heartbeat

RESTART_S: Final = 3.0
"""After NMT reset communication every drive answers by then [s]."""
QUIET_S: Final = 0.5
"""No drive has answered for the first time for so long: all of them are there [s]."""
NO_LSS: Final = "no drive answers LSS. Set node ids and bit rate by switches or the manufacturer's tool, drive by drive"


def look(bitrate: int, *, one_drive_each: bool = False) -> Talk[Census]:
    """Who is there by SDO. Raises ConversationError where a motor has power, or cannot report that it has none."""
    census = yield from take_census(bitrate, one_drive_each=one_drive_each)
    yield Progress("power", 5, 5)
    yield from require_no_power(census.node_ids, bitrate)
    return census


def is_anybody_here(bitrate: int) -> Talk[bool]:
    """Whether anybody answers at this bit rate: an SDO read, or, without a node id, fastscan's first request."""
    if (yield from read(ALL, 0x1000, 0, bitrate, attempts=1)):
        return True
    return (yield from _unconfigured(WAITS_S[1]))


def require_lss(census: Census) -> Talk[None]:
    """Each drive whose identity is known answers its selection, and keeps its node id. Raises ConversationError."""
    mute = []
    for node_id, identity in census.identities.items():
        for _ in range(master.ATTEMPTS):
            yield say(protocol.switch_all(configuration=False), wait_s=master.SETTLE_S)
            if (yield Exchange(protocol.select(identity), is_answer(SELECTED), master.WAIT_S)):
                break
        else:
            mute.append(node_id)
    if mute:
        raise ConversationError(NO_LSS if len(mute) == len(census.node_ids) else _without_lss(mute))


def _without_lss(node_ids: Iterable[int]) -> str:
    return (
        f"node {', '.join(map(str, node_ids))} answers SDO and takes no LSS: disconnect it, and set it by its switches "
        "or its manufacturer's tool"
    )


def discover(census: Census, bitrate: int) -> Talk[list[Identity]]:
    """Every drive that speaks LSS, by identity. Raises ConversationError for none, or for drives that are not found."""
    yield Progress("drives without a node id", 0, 1)
    if census.node_ids:
        yield from _take_node_ids()
    elif not (yield from _unconfigured(WAITS_S[-1])):
        raise ConversationError(NO_LSS)
    likely = tuple(Identity(*kind, 0) for kind in sorted(census.kinds))
    found = yield from scan_for_all(bitrate, likely, census.node_ids)
    yield say(protocol.switch_all(configuration=False), wait_s=master.SETTLE_S)
    remaining = yield from read(census.node_ids, 0x1000, 0, bitrate, attempts=1)
    if remaining:
        raise ConversationError(f"{_without_lss(remaining)}. Found: {', '.join(map(str, found)) or 'none'}")
    if not found:
        raise ConversationError(NO_LSS)
    return found


def take_into_use(node_ids: dict[Identity, int], bitrate: int) -> Talk[None]:
    """The new node ids count. Raises ConversationError unless each of them is one drive with the right identity."""
    yield Progress("restart with the new node ids", 0, 2)
    yield from _restart(set(node_ids.values()))
    if (yield from _unconfigured(WAITS_S[-1])):
        raise ConversationError("another drive without a node id is on the bus: run it again for that one")
    yield Progress("identities at the new node ids", 1, 2)
    census = yield from look(bitrate, one_drive_each=True)
    for identity, node_id in node_ids.items():
        if node_id in census.twins:
            raise ConversationError(f"two drives answer as node {node_id}: connect one at a time, and run it again")
        found = census.identities.get(node_id)
        if found != identity:
            raise ConversationError(f"node {node_id} is {found or 'not there'}, expected {identity}")


def _take_node_ids() -> Talk[None]:
    """All drives get node id 255, in use after NMT reset communication; nothing is stored."""
    yield say(protocol.switch_all(configuration=True), wait_s=master.SETTLE_S)
    request = protocol.set_node_id(UNCONFIGURED)
    answers: tuple[Frame, ...] = yield Exchange((request,), is_answer(SET_NODE_ID), master.WAIT_S)
    yield say(protocol.switch_all(configuration=False), wait_s=master.SETTLE_S)
    if not answers:
        raise ConversationError(NO_LSS)
    yield say(nmt(NmtCommand.RESET_COMMUNICATION, ALL_NODES))
    quiet_s = waited_s = 0.0
    before = False
    while waited_s < RESTART_S and quiet_s < QUIET_S:
        is_there = yield from _unconfigured(WAITS_S[-1])
        waited_s += WAITS_S[-1]
        quiet_s = quiet_s + WAITS_S[-1] if is_there and before else 0.0
        before = is_there


def _unconfigured(wait_s: float) -> Talk[bool]:
    answers: tuple[Frame, ...] = yield Exchange((protocol.scan_again(),), is_answer(IDENTIFIED), wait_s)
    return bool(answers)


def _restart(node_ids: set[int]) -> Talk[None]:
    """NMT reset communication to all, until each of these has sent its boot-up, RESTART_S at most."""

    def is_boot_up(frame: Frame) -> bool:
        parsed = parse_heartbeat(frame)
        return parsed is not None and parsed[0] in node_ids

    request: tuple[Frame, ...] = (nmt(NmtCommand.RESET_COMMUNICATION, ALL_NODES),)
    missing, waited_s = set(node_ids), 0.0
    while missing and waited_s < RESTART_S:
        frames: tuple[Frame, ...] = yield Exchange(request, is_boot_up, QUIET_S)
        missing -= {frame.cob_id & 0x7F for frame in frames}
        request, waited_s = (), waited_s + QUIET_S
