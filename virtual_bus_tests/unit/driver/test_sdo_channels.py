"""Further SDO channels of a drive (1201h to 127Fh): what the boot does with one that is open."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from support.fake_drive import (
    DEVICE_STATE,
    NO_OBJECT,
    READ_ONLY,
    WRITE_ONLY,
    Bench,
    FakeDrive,
    Key,
    error_of,
    notes_of,
    robot,
    u32,
)

OPEN = {(0x1201, 1): u32(0x6A1), (0x1201, 2): u32(0x6C1)}
GENERAL, CLOSED_ID = 0x0800_0000, 0x8000_0000
CLOSED = "was open and is closed: a panel or a tool that uses it gets no answer"


def with_channels(objects: dict[Key, bytes], **changes: dict[Key, int]) -> FakeDrive:
    drive = FakeDrive(**changes)  # type: ignore[arg-type]
    drive.objects |= objects
    return drive


def booted(drive: FakeDrive) -> NodeBoot:
    """As the driver boots it."""
    return Bench(drive, robot(), identify=False).run()


def cost(objects: dict[Key, bytes], profile: Path) -> int:
    """Transfers more than a boot that does not look for channels."""
    drive = with_channels(objects)
    assert booted(drive).error is None
    return drive.transfers - without_a_look(profile).transfers


def without_a_look(profile: Path) -> FakeDrive:
    """`options.sdo_channels: no`."""
    keys = load_profile("generic").model_dump(mode="json", exclude_unset=True)
    profile.write_text(json.dumps(keys | {"options": keys.get("options", {}) | {"sdo_channels": "no"}}, indent=1))
    drive, base = with_channels(OPEN), robot()
    values = base.model_dump()
    values["drives"] = [each | {"profile": str(profile)} for each in values["drives"]]
    of = Robot.model_validate(values)
    assert Bench(drive, of, of.drives[:1], identify=False).run().error is None
    return drive


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Where a profile can be written."""
    return tmp_path / "own.yaml"


def test_a_drive_without_them_costs_one_transfer_and_one_whose_profile_denies_them_none(own: Path) -> None:
    assert cost({}, own) == 1
    assert without_a_look(own).number(0x1201, 1) == 0x6A1


@pytest.mark.parametrize(
    ("found", "transfers"),
    [
        ({(0x1201, 1): u32(0x8000_0000), (0x1201, 2): u32(0x8000_0000)}, 2),  # closed; and there is no 1202h
        ({(0x1201, 1): u32(0x6A1), (0x1201, 2): u32(0x8000_06C1)}, 3),  # needs both identifiers to be open
    ],
)
def test_a_channel_that_is_closed_is_left_alone(found: dict[Key, bytes], transfers: int, own: Path) -> None:
    drive = with_channels(found)
    assert notes_of(booted(drive)) == ()
    assert {key: drive.objects[key] for key in found} == found
    assert cost(found, own) == transfers


def test_an_open_channel_is_closed_first_after_the_reset_and_its_identifier_stays(own: Path) -> None:
    drive = with_channels(OPEN)
    boot = booted(drive)
    assert notes_of(boot) == (f"1201h: a second SDO channel, requests by 6A1h, {CLOSED}",)
    assert drive.number(0x1201, 1) == 0x8000_06A1
    assert boot.report is not None
    assert "1201h:1: 000006A1h → 800006A1h" in boot.report.changes
    written = [index for index, _, _ in drive.writes]
    assert set(written[: written.index(0x1201)]) <= {0x6007, 0x6040}, "nothing that the channel could undo"
    assert cost(OPEN, own) == 5


def test_all_channels_up_to_the_first_that_is_missing_are_closed() -> None:
    objects = OPEN | {(0x1202, 1): u32(0x2000_0123), (0x1202, 2): u32(0x6C2), (0x1204, 1): u32(0x6A4)}
    drive = with_channels(objects)
    assert [note.split(",")[1] for note in notes_of(booted(drive))] == [" requests by 6A1h", " requests by 123h"]
    assert [drive.number(index, 1) >> 31 for index in (0x1201, 0x1202, 0x1204)] == [1, 1, 0]


def test_where_the_drive_keeps_one_identifier_the_other_one_closes_the_channel() -> None:
    drive = with_channels(OPEN, refuse={(0x1201, 1): READ_ONLY})
    assert notes_of(booted(drive))[0].endswith(CLOSED)
    assert (drive.number(0x1201, 1), drive.number(0x1201, 2)) == (0x6A1, 0x8000_06C1)


def test_a_drive_that_takes_the_write_and_stays_open_is_tried_by_the_other_identifier_as_well() -> None:
    drive = with_channels(OPEN)
    drive.on_write[0x1201, 1] = lambda self, _data: self.objects.update({(0x1201, 1): u32(0x6A1)})
    assert notes_of(booted(drive))[0].endswith(CLOSED)
    assert drive.number(0x1201, 2) == 0x8000_06C1


@pytest.mark.parametrize("code", [READ_ONLY, DEVICE_STATE])
def test_a_channel_that_stays_open_gets_no_power_and_the_message_names_it(code: int) -> None:
    told = error_of(booted(with_channels(OPEN, refuse={(0x1201, 1): code, (0x1201, 2): code})))
    assert told.startswith("node 1: 1201h:1 stays at 000006A1h (")
    assert "takes requests by 6A1h" in told
    cure = (
        "switch the drive off and on again" if code == DEVICE_STATE else "Close it with the manufacturer's tool (bit 31"
    )
    assert cure in told


def test_a_drive_that_takes_both_writes_and_stays_open_gets_no_power_either() -> None:
    drive = with_channels(OPEN)
    for sub, value in ((1, 0x6A1), (2, 0x6C1)):
        drive.on_write[0x1201, sub] = lambda self, _data, sub=sub, value=value: self.objects.update(  # type: ignore[misc]
            {(0x1201, sub): u32(value)}
        )
    assert "1201h:1 stays at 000006A1h: a second SDO channel" in error_of(booted(drive))


def test_a_channel_without_its_second_identifier_counts_as_open() -> None:
    drive = with_channels({(0x1201, 1): u32(0x6A1)}, refuse={(0x1201, 1): READ_ONLY})
    assert "1201h:1 stays at 000006A1h" in error_of(booted(drive))


def test_identifier_0_is_none_it_belongs_to_nmt() -> None:
    objects = {(0x1201, 1): u32(0), (0x1201, 2): u32(0)}
    assert notes_of(booted(with_channels(objects, refuse=dict.fromkeys(objects, READ_ONLY)))) == ()


@pytest.mark.parametrize(
    ("code", "takes", "shown"),
    [
        (WRITE_ONLY, True, ""),
        (WRITE_ONLY, False, "0601 0001h the object is write-only"),
        (GENERAL, True, "0800 0000h general error"),  # as many drives answer for what they do not have
    ],
)
def test_what_cannot_be_read_is_closed_all_the_same_or_noted(code: int, takes: bool, shown: str) -> None:
    refuse = {} if takes else {(0x1201, 1): DEVICE_STATE}
    drive = with_channels(OPEN, refuse_read={(0x1201, 1): code}, refuse=refuse)
    notes = notes_of(booted(drive))
    if not shown:
        assert (notes, drive.number(0x1201, 1)) == ((), CLOSED_ID)
    else:
        key = "where the drive does not have it, `options.sdo_channels: no` in its drive profile"
        assert notes[0].startswith(f"1201h:1 cannot be read: {shown}; {key}; where it has a second SDO channel, close")


@pytest.mark.parametrize("code", [WRITE_ONLY, DEVICE_STATE])
def test_behind_a_channel_that_is_closed_without_being_read_the_next_one_is_closed_too(code: int) -> None:
    second = {(0x1202, 1): u32(0x6A2), (0x1202, 2): u32(0x6C2)}
    drive = with_channels(OPEN | second, refuse_read={(0x1201, 1): code})
    assert notes_of(booted(drive)) == (f"1202h: a second SDO channel, requests by 6A2h, {CLOSED}",)
    assert [drive.number(index, 1) for index in (0x1201, 0x1202)] == [CLOSED_ID, 0x8000_06A2]


class Mute(FakeDrive):
    """It answers no request for an object that it lacks, against CiA 301."""

    def on_frame(self, frame: Frame) -> list[Frame]:
        return [answer for answer in super().on_frame(frame) if answer.data[4:] != u32(NO_OBJECT)]


def test_a_drive_that_does_not_answer_for_the_channels_that_it_lacks_is_told_the_key_that_spares_the_question() -> None:
    told = error_of(booted(Mute()))
    assert told.startswith("node 1: 1201h:1: no answer to 3 requests")
    assert told.endswith("where the drive does not have it, `options.sdo_channels: no` in its drive profile.")
