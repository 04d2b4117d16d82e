"""Which SDO answers show that another client has changed what the boot of a drive has set."""

from __future__ import annotations

import pytest

from canbase_driver.cia301.frame import Frame
from canbase_driver.drives.foreign_writes import ForeignWrites


@pytest.mark.parametrize(
    ("data", "shown"),
    [
        ("60 16 10 01 00 00 00 00", "1016h:1"),
        ("60 0C 10 00 00 00 00 00", "100Ch:0"),
        ("60 03 14 01 00 00 00 00", "1403h:1"),  # the PDO of the watchdog's quick stop
        ("60 00 1A 00 00 00 00 00", "1A00h:0"),
        ("60 07 60 00 00 00 00 00", "6007h:0"),
        ("60 5A 68 00 00 00 00 00", "685Ah:0"),  # of the second axis
        ("60 85 60 00 00 00 00 00", "6085h:0"),
        ("60 4C 60 01 00 00 00 00", "604Ch:1"),  # the unit of the speeds of mode 2
        ("60 4A 60 01 00 00 00 00", "604Ah:1"),
        ("60 01 12 01 00 00 00 00", "1201h:1"),  # a further SDO channel
        ("60 7F 12 02 00 00 00 00", "127Fh:2"),
        ("60 0F 20 00 00 00 00 00", "200Fh:0"),  # of the manufacturer
        ("60 7E 60 00 00 00 00 00", "607Eh:0"),  # which way is positive
        ("60 91 68 01 00 00 00 00", "6891h:1"),  # how far one bit goes
        ("A4 16 10 01 20 00 00 00", "1016h:1"),  # a block is accepted, with and without checksum
        ("A0 16 10 01 20 00 00 00", "1016h:1"),
        ("A2 16 10 01 00 00 00 00", ""),  # an answer inside a block
        ("A1 00 00 00 00 00 00 00", ""),
        ("C4 16 10 01 04 00 00 00", ""),  # read in a block
        ("60 40 60 00 00 00 00 00", ""),  # the watchdog stops by it
        ("60 F9 60 01 00 00 00 00", "60F9h:1"),  # a gain
        ("60 FF 60 00 00 00 00 00", ""),  # the driver commands a stop by it
        ("60 42 68 00 00 00 00 00", ""),
        ("60 60 60 00 00 00 00 00", "6060h:0"),
        ("4B 16 10 01 00 00 00 00", ""),  # read
        ("80 16 10 01 00 00 00 08", ""),  # refused
        ("60 16 10", ""),
    ],
)
def test_the_object_is_named_that_decides_how_the_drive_stops(data: str, shown: str) -> None:
    assert ForeignWrites().take_sdo_answer(Frame(0x581, bytes.fromhex(data))) == shown


# another client reads an object of 900 bytes in a block ── 127 segments, 2 more ── its end ── then a write
def test_the_segments_of_a_block_that_is_read_are_no_writes() -> None:
    foreign = ForeignWrites()

    def taken(first: int) -> str:
        return foreign.take_sdo_answer(Frame(0x581, bytes((first, 0x16, 0x10, 1, 0, 0, 0, 0))))

    assert taken(0xC6) == ""
    assert [number for number in range(1, 128) if taken(number)] == []
    assert (taken(0x01), taken(0x82), taken(0xC1)) == ("", "", "")
    assert taken(0x60) == "1016h:1"
    assert (taken(0xC6), taken(0x60)) == ("", "1016h:1"), "not the first segment"
    assert (taken(0xC6), taken(0x01), taken(0x80), taken(0x60)) == ("", "", "", "1016h:1"), "aborted"
