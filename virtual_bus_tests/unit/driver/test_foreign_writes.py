"""Which SDO answers show that another client has changed what the boot of a drive has set."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from canbase_config.drive import Drive
from canbase_config.scale_objects import Expected
from canbase_driver.cia301.frame import Frame
from canbase_driver.drives.foreign_writes import ForeignWrites
from support.crews import robot_with

GENERIC = robot_with("generic").drives[:1]


def taken(data: str, drives: Sequence[Drive] = GENERIC) -> str:
    return ForeignWrites(drives).take(Frame(0x581, bytes.fromhex(data)))


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
        ("60 80 12 01 00 00 00 00", ""),  # of the drive as a client
        ("60 7E 60 00 00 00 00 00", "607Eh:0"),  # which way is positive
        ("60 91 68 01 00 00 00 00", "6891h:1"),  # how far one bit goes
        ("A4 16 10 01 20 00 00 00", "1016h:1"),  # a block is accepted, with and without checksum
        ("A0 16 10 01 20 00 00 00", "1016h:1"),
        ("A2 16 10 01 00 00 00 00", ""),  # an answer inside a block
        ("A1 00 00 00 00 00 00 00", ""),
        ("C4 16 10 01 04 00 00 00", ""),  # read in a block
        ("60 40 60 00 00 00 00 00", ""),  # the watchdog stops by it
        ("60 F9 60 01 00 00 00 00", ""),  # a gain
        ("4B 16 10 01 00 00 00 00", ""),  # read
        ("80 16 10 01 00 00 00 08", ""),  # refused
        ("60 16 10", ""),
    ],
)
def test_the_object_is_named_that_decides_how_the_drive_stops(data: str, shown: str) -> None:
    assert taken(data) == shown


def test_the_makers_own_watchdog_is_one_where_the_profile_names_it() -> None:
    assert taken("60 00 20 00 00 00 00 00") == ""
    assert taken("60 00 20 00 00 00 00 00", robot_with("zlac8015d").drives) == "2000h:0"


def test_what_the_boot_writes_besides_is_one_where_the_profile_names_it() -> None:
    assert taken("60 0F 20 00 00 00 00 00") == ""
    assert taken("60 0F 20 00 00 00 00 00", robot_with("zlac8015d").drives) == "200Fh:0"


def test_an_object_that_robot_yaml_expects_is_one_too() -> None:
    (drive,) = GENERIC
    noted = drive.model_copy(update={"expects": (Expected(index=0x2010, value=1),)})
    assert (taken("60 10 20 00 00 00 00 00"), taken("60 10 20 00 00 00 00 00", [noted])) == ("", "2010h:0")
