"""The boot leaves a drive one SDO channel, the default one. CiA 301, SDO server parameter (1201h to 127Fh).

Driver and watchdog watch 600h + node id. What comes by another channel changes the drive, and is seen by nobody.
"""

from __future__ import annotations

from typing import Final

from canbase_config.profile import SDO_SERVERS, Profile
from canbase_driver.boot.advice import ELSE_UNUSABLE, see
from canbase_driver.boot.steps import BootError, NodeAccess, Steps, unsigned
from canbase_driver.cia301.sdo_client import (
    DEVICE_STATE,
    GENERAL_ERROR,
    NO_OBJECT,
    NO_SUB_INDEX,
    Read,
    SdoAborted,
    Write,
)

CHANNELS: Final = SDO_SERVERS[1:]
CLOSED: Final = 1 << 31
"""Bit 31 of either COB-ID: there is no such channel."""
REQUESTS, ANSWERS = 1, 2
"""Sub-indexes with the COB-IDs of requests to the drive, and of its answers."""
_IDENTIFIER: Final = 0x1FFF_FFFF


def close_sdo_channels(node: NodeAccess, kind: Profile) -> Steps[None]:
    """Most drives have none. The first one that is missing ends the search.

    Raises BootError for one that stays open.
    """
    for index in CHANNELS if kind.options.sdo_channels != "no" else ():
        requests = yield from _requests(node, index)
        if requests is None:
            return
        if not requests & CLOSED:
            yield from _close(node, index, requests)


def _requests(node: NodeAccess, index: int) -> Steps[int | None]:
    """None: there is no such channel, or the drive neither shows nor closes it, which is noted. One that it closes
    without showing it counts as closed, and the next one is looked for."""
    try:
        return unsigned((yield Read(index, REQUESTS)))
    except SdoAborted as refused:
        if refused.code in (NO_OBJECT, NO_SUB_INDEX):
            return None
        may_exist = refused.code != GENERAL_ERROR  # which many drives answer for what they do not have
        if may_exist and (yield from node.tries(Write(index, REQUESTS, CLOSED, 4))):
            return CLOSED
        tool = (
            "where it has a second SDO channel, close it with the manufacturer's tool and store that (1010h): nobody "
            "sees what comes by it"
        )
        node.notes.append(f"{index:04X}h:{REQUESTS} cannot be read: {refused.text}{see(index, REQUESTS)}; {tool}")
        return None


def _close(node: NodeAccess, index: int, requests: int) -> Steps[None]:
    """A channel needs both COB-IDs: where a drive keeps the first one, bit 31 of the other one closes it as well."""
    answers = yield from node.read_if_present(index, ANSWERS)
    if answers is not None and answers & CLOSED:
        return
    refusals = []
    for sub, before in ((REQUESTS, requests), (ANSWERS, answers or 0)):
        off = Write(index, sub, before | CLOSED, 4)
        refusal = yield from _refusal(off)
        if refusal is None and ((yield from node.read_if_present(index, sub)) or 0) & CLOSED:
            node.note_change(off, f"{before:08X}h")
            if requests & _IDENTIFIER:
                how = f"a second SDO channel, requests by {requests & _IDENTIFIER:03X}h, was open and is closed"
                node.notes.append(f"{index:04X}h: {how}: a panel or a tool that uses it gets no answer")
            return
        refusals.append(refusal)
    if requests & _IDENTIFIER:  # 000h is NMT: no request can come by it
        raise _stays_open(node, index, requests, [refused for refused in refusals if refused is not None])


def _stays_open(node: NodeAccess, index: int, requests: int, refusals: list[SdoAborted]) -> BootError:
    why = f" ({refusals[0].text})" if refusals else ""
    channel = f"a second SDO channel takes requests by {requests & _IDENTIFIER:03X}h"
    problem = f"{index:04X}h:{REQUESTS} stays at {requests:08X}h{why}: {channel}, where nobody sees what they change"
    tool = (
        f"Close it with the manufacturer's tool (bit 31 of {index:04X}h:{REQUESTS}) and store that (1010h): the "
        f"boot resets the drive; {ELSE_UNUSABLE}"
    )
    codes = [refused.code for refused in refusals]
    return BootError.refused(node.node_id, problem, DEVICE_STATE if DEVICE_STATE in codes else 0, tool)


def _refusal(step: Write) -> Steps[SdoAborted | None]:
    try:
        yield step
    except SdoAborted as refused:
        return refused
    return None
