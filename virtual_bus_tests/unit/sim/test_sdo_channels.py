"""Further SDO servers of a simulated drive: 1201h opens and closes them (CiA 301)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.sdo_channels import NOT_VALID, SdoChannels
from canbase_sim.frame import Frame
from canbase_sim.personality import Personality, sdo_channel

READ = bytes.fromhex("40 00 10 00 00 00 00 00")


class Channels:
    """1201h open, 1202h closed."""

    def __init__(self) -> None:
        extras = sdo_channel(0x1201, 0x6A1, 0x6C1) | sdo_channel(0x1202)
        self.dictionary = Dictionary(1, personality=Personality(extras=extras))
        self.said: list[Frame] = []
        self.changes = 0
        self.channels = SdoChannels(self.dictionary, self.said.append, self._count)

    def _count(self) -> None:
        self.changes += 1

    def write(self, index: int, sub: int, value: int) -> None:
        self.dictionary.set_data(index, sub, value.to_bytes(4, "little"), check_writable=True)

    @property
    def routes(self) -> dict[int, Callable[[bytes, float], None]]:
        return self.channels.routes()


@pytest.fixture
def two() -> Channels:
    return Channels()


def test_an_open_one_answers_by_its_own_identifiers(two: Channels) -> None:
    assert list(two.routes) == [0x6A1]
    two.routes[0x6A1](READ, 0.0)
    assert [(frame.cob_id, frame.data[:4]) for frame in two.said] == [(0x6C1, bytes.fromhex("43 00 10 00"))]


@pytest.mark.parametrize("sub", [1, 2])
def test_bit_31_of_either_identifier_closes_it(two: Channels, sub: int) -> None:
    two.write(0x1201, sub, NOT_VALID | (0x6A1 if sub == 1 else 0x6C1))
    assert (two.routes, two.changes) == ({}, 1)


def test_a_closed_one_is_moved_and_opened(two: Channels) -> None:
    two.write(0x1202, 1, 0x641)
    assert list(two.routes) == [0x6A1], "needs both"
    two.write(0x1202, 2, 0x5C1)
    assert list(two.routes) == [0x6A1, 0x641]


def test_an_open_one_is_not_moved(two: Channels) -> None:
    with pytest.raises(Exception, match=f"{abort.INVALID_VALUE:08X}"):
        two.write(0x1201, 1, 0x6A2)


def test_a_reset_forgets_the_transfer_that_is_under_way(two: Channels) -> None:
    two.routes[0x6A1](bytes.fromhex("C2 16 10 01 04 00 00 00"), 0.0)
    two.channels.reset()
    two.routes[0x6A1](READ, 0.0)
    assert two.said[-1].data[:4] == bytes.fromhex("43 00 10 00")
