"""A device that answers LSS fastscan without end, each time with a new serial number."""

from __future__ import annotations

import pytest

from canbase_commissioning.conversation import ConversationError, Exchange
from canbase_commissioning.lss.assignment import MAX_DRIVE_ID
from canbase_commissioning.lss.fastscan import scan_for_all
from canbase_driver.cia301.frame import Frame

LSS_ANSWER, FASTSCAN, ANSWERED, ANYBODY = 0x7E4, 0x51, 0x4F, 0x80
BITRATE = 500_000


def scanned(identities: int, taken: range = range(0)) -> int:
    """How many drives the scan finds; `identities`: so many serial numbers the device invents."""
    talk, serial = scan_for_all(BITRATE, taken=taken), 1
    answer: tuple[Frame, ...] | None = None
    try:
        while True:
            step = talk.send(answer)
            answer = ()
            if not isinstance(step, Exchange) or not step.requests:
                continue
            data = step.requests[0].data
            if data[0] == FASTSCAN and serial <= identities:
                number, bit, part = int.from_bytes(data[1:5], "little"), data[5], data[6]
                if bit == ANYBODY or number >> bit == (1, 2, 3, serial)[part] >> bit:
                    answer = (Frame(LSS_ANSWER, bytes((ANSWERED,)) + bytes(7)),)
            elif data[0] == 0x11:  # it takes a node id
                serial += 1
    except StopIteration as end:
        return len(end.value)


def test_a_bus_full_of_drives_is_scanned_to_its_end() -> None:
    assert scanned(MAX_DRIVE_ID) == MAX_DRIVE_ID


def test_more_drives_than_a_bus_has_are_one_device_that_invents_them() -> None:
    with pytest.raises(ConversationError, match=f"{MAX_DRIVE_ID + 1} drives without a node id .* no node id is free"):
        scanned(10**6)


def test_with_no_node_id_free_the_first_drive_is_one_too_many() -> None:
    with pytest.raises(ConversationError, match="1 drives without a node id"):
        scanned(1, taken=range(1, MAX_DRIVE_ID + 1))
