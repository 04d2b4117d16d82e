"""Boots of drives that lack, refuse or change something: what is a note, and what is an error."""

import pytest

from unit.fake_drive import (
    DEVICE_STATE,
    INVALID,
    READ_ONLY,
    WRITE_ONLY,
    FakeDrive,
    Key,
    boot_one_axis,
    error_of,
    factory_objects,
    notes_of,
    u8,
    u16,
    u32,
)


@pytest.mark.parametrize(
    ("index", "sub", "note"),
    [
        (0x1017, 0, "1017h:0: 0602 0000h the object does not exist"),
        (0x1029, 1, "1029h:1: 0602 0000h the object does not exist"),
        (0x605A, 0, "605Ah:0: 0602 0000h the object does not exist"),
        (0x605E, 0, "605Eh:0: 0602 0000h the object does not exist"),
        (0x6084, 0, "6084h:0: 0602 0000h the object does not exist"),
    ],
)
def test_a_missing_option_is_a_note(index: int, sub: int, note: str) -> None:
    drive = FakeDrive()
    del drive.objects[index, sub]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == (note,)
    assert boot.report is not None
    assert boot.report.stops_by_itself


def test_a_drive_without_6007h_does_not_stop_by_itself() -> None:
    drive = FakeDrive()
    del drive.objects[0x6007, 0]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == ("6007h:0: 0602 0000h the object does not exist",)
    assert boot.report is not None
    assert not boot.report.stops_by_itself


def test_a_drive_without_1016h_does_not_stop_by_itself() -> None:
    drive = FakeDrive()
    for sub in range(3):
        del drive.objects[0x1016, sub]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == ("1016h: the drive watches no heartbeat, it will not stop by it",)
    assert boot.report is not None
    assert not boot.report.stops_by_itself


def test_with_one_entry_the_watchdog_is_watched() -> None:
    drive = FakeDrive(objects=factory_objects(consumers=1))
    boot = boot_one_axis(drive)
    assert drive.number(0x1016, 1) == 0x007E_012C
    assert boot.report is not None
    assert boot.report.stops_by_itself


def test_stored_entries_of_an_earlier_life_go_first() -> None:
    drive = FakeDrive(objects=factory_objects(consumers=4))
    drive.objects |= {(0x1016, 1): u32(0x007F_0064), (0x1016, 2): u32(0x007E_0064), (0x1016, 4): u32(0x0001_0064)}
    boot_one_axis(drive)
    consumers = [(sub, value) for index, sub, value in drive.writes if index == 0x1016]
    assert consumers == [(2, 0), (4, 0), (1, 0x007E_012C), (2, 0x007F_012C)]


def test_an_option_that_the_drive_changes_is_a_note() -> None:
    def clamp(drive: FakeDrive, _: bytes) -> None:
        drive.objects[0x6083, 0] = u32(1000)

    assert notes_of(boot_one_axis(FakeDrive(on_write={(0x6083, 0): clamp}))) == (
        "6083h:0 is 000003E8h, expected 00000B31h",
    )


def test_a_read_only_option_passes_when_it_is_right_and_is_a_note_when_not() -> None:
    drive = FakeDrive(refuse={(0x605A, 0): READ_ONLY, (0x605E, 0): READ_ONLY})
    drive.objects[0x605A, 0] = u16(2)
    assert notes_of(boot_one_axis(drive)) == ("605Eh:0 is 0000h, expected 0002h (0601 0002h the object is read-only)",)


def test_a_mode_that_can_only_be_written_is_believed() -> None:
    assert notes_of(boot_one_axis(FakeDrive(refuse_read={(0x6060, 0): WRITE_ONLY}))) == ()


def test_a_fixed_mapping_that_is_right_is_left_alone() -> None:
    fixed = {(0x1A01, sub): READ_ONLY for sub in range(5)}
    drive = FakeDrive(refuse=fixed)
    drive.objects |= {(0x1A01, 0): u8(1), (0x1A01, 1): u32(0x606C_0020)}
    assert notes_of(boot_one_axis(drive)) == ()


# -- what no drive may lack


@pytest.mark.parametrize(
    ("key", "abort", "problem", "hint"),
    [
        ((0x6060, 0), INVALID, "6060h:0: 0609 0030h value not valid", "must support `mode`"),
        ((0x60FF, 0), DEVICE_STATE, "60FFh:0: 0800 0022h", "Switch the drive off and on again"),
        ((0x1600, 2), 0x06040041, "1600h:2: 0604 0041h the object cannot be mapped", "the manual of the drive"),
        ((0x1A00, 0), READ_ONLY, "1A00h:0: 0601 0002h the object is read-only", "the manual of the drive"),
    ],
)
def test_a_refused_necessity_is_an_error(key: Key, abort: int, problem: str, hint: str) -> None:
    text = error_of(boot_one_axis(FakeDrive(refuse={key: abort})))
    assert problem in text
    assert hint in text


def test_a_target_that_does_not_become_0_is_an_error() -> None:
    def stuck(drive: FakeDrive, _: bytes) -> None:
        drive.objects[0x60FF, 0] = u32(777)

    text = error_of(boot_one_axis(FakeDrive(on_write={(0x60FF, 0): stuck})))
    assert "60FFh:0 is 00000309h, expected 00000000h" in text


def test_a_mapping_that_reads_back_differently_is_an_error() -> None:
    def other(drive: FakeDrive, _: bytes) -> None:
        drive.objects[0x1A00, 2] = u32(0x6063_0020)

    text = error_of(boot_one_axis(FakeDrive(on_write={(0x1A00, 2): other})))
    assert "TPDO1 reads back another mapping than was written to 1A00h" in text


def test_a_missing_pdo_is_an_error() -> None:
    text = error_of(boot_one_axis(FakeDrive(objects=factory_objects(pdos=3))))
    assert "it has no RPDO4 (1403h)" in text


def test_an_unused_pdo_that_stays_on_is_a_note() -> None:
    boot = boot_one_axis(FakeDrive(refuse={(0x1402, 1): READ_ONLY}))
    assert notes_of(boot) == ("1402h:1 is 40000401h, expected C0000401h (0601 0002h the object is read-only)",)


def test_a_pdo_that_cannot_be_switched_off_is_a_note_where_its_fixed_identifier_and_mapping_are_right() -> None:
    drive = FakeDrive(refuse={(0x1801, 1): READ_ONLY})
    drive.objects |= {(0x1801, 1): u32(0x4000_0281), (0x1A01, 0): u8(1), (0x1A01, 1): u32(0x606C_0020)}
    assert notes_of(boot_one_axis(drive)) == ("1801h:1: 0601 0002h the object is read-only",)
    assert drive.number(0x1801, 2) == 1


def test_a_mapping_that_is_empty_is_not_emptied() -> None:
    drive = FakeDrive()
    drive.objects[0x1A00, 0] = u8(0)
    boot_one_axis(drive)
    mapping = [(sub, value) for index, sub, value in drive.writes if index == 0x1A00]
    assert mapping == [(1, 0x6041_0010), (2, 0x6064_0020), (0, 2)]


def test_an_answer_that_is_wider_than_the_object_is_another_value() -> None:
    drive = FakeDrive()
    drive.objects[0x6007, 0] = u32(0x0001_0003)
    assert notes_of(boot_one_axis(drive)) == ()
    assert drive.objects[0x6007, 0] == u16(3)
