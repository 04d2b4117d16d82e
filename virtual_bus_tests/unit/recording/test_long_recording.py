"""A recording of any length: two million frames go through, and memory does not grow with them."""

from __future__ import annotations

import resource
import struct
from collections.abc import Callable, Iterator

import pytest

from canbase_config.load import load_robot, sample
from canbase_recording.entry import RecordedFrame
from canbase_recording.explanation import MOST_EVENTS, explain
from canbase_recording.story_finder import MOST_STOPS

BENCH = load_robot(sample("bench")).robot
FRAMES = 2_000_000
SETTLED = 600_000
"""Frames after which all that is kept is full."""
MOST_GROWTH_KIB = 30_000


def driving(frames: int, seen: list[int]) -> Iterator[RecordedFrame]:
    """Ten frames a cycle; every 20 s a drive goes to fault and back. `seen`: memory in use, then and at the end."""
    for number in range(frames):
        if number in (SETTLED, frames - 1):
            seen.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
        cob_id, data = PARTS.get(number % 10, anything)(number)
        yield RecordedFrame(number * 0.001, cob_id, data)


def status(number: int) -> tuple[int, bytes]:
    word = 0x0208 if number % 20_000 < 500 else 0x0237
    return 0x181, struct.pack("<Hi", word, number % 1_000_000)


def anything(number: int) -> tuple[int, bytes]:
    """PDOs and SDO requests of all nodes, never the same twice."""
    return (0x300, 0x600)[number % 2] + number // 10 % 127 + 1, number.to_bytes(8, "little")


PARTS: dict[int, Callable[[int], tuple[int, bytes]]] = {
    0: lambda number: (0x201, struct.pack("<Hi", 0x0F, 1000)),
    2: lambda number: (0x080, b""),
    3: status,
    4: lambda number: (0x281, struct.pack("<ih", 1000, 5)),
    5: lambda number: (0x701, b"\x05"),
}


@pytest.mark.timeout(300)
def test_two_million_frames_in_bounded_memory() -> None:
    seen: list[int] = []
    told = explain(driving(FRAMES, seen), BENCH)
    assert told.frames == FRAMES
    assert len(told.stories) == MOST_STOPS
    assert told.further_stops > 50
    assert len(told.events) <= MOST_EVENTS
    assert seen[1] - seen[0] < MOST_GROWTH_KIB
