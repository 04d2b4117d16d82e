"""The boot of a node step by step: what is written, what is waited for, what is stopped."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_config.drive import Identity
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from support.fake_drive import (
    OFF,
    Bench,
    FakeDrive,
    boot_one_axis,
    error_of,
    factory_objects,
    notes_of,
    robot,
    u16,
    u32,
)


def test_a_drive_out_of_its_box_is_made_ready_without_a_note() -> None:
    drive = FakeDrive()
    bench = Bench(drive, robot())
    boot = bench.run()
    assert notes_of(boot) == ()
    assert boot.report is not None
    assert boot.report.stops_by_itself
    assert boot.report.identity == Identity(vendor_id=0x1111, product_code=0x2222, revision=0x10002, serial=0x4444)
    assert drive.nmt == [0x82, 0x80]  # reset communication, enter pre-operational; starting it is not ours
    assert boot.waiting_for == ""
    assert bench.now_s == 100.0  # nothing had to be waited for


def test_every_write_in_its_order() -> None:
    drive = FakeDrive()
    boot_one_axis(drive)
    assert drive.writes == [
        # the reset that follows is no loss of the master
        (0x6007, 0, 3),
        # how it moves: the target of an earlier life is gone before anything can enable the drive
        (0x6060, 0, 3),
        (0x60FF, 0, 0),
        (0x6083, 0, 2865),  # 1.5 m/s² at the rim in rpm/s: harder than 0.5 + 2.0 × 0.25 of a curve
        (0x6084, 0, 3820),  # 0.5 + 6.0 × 0.25 = 2.0 m/s²
        (0x6085, 0, 2865),
        # heartbeat every 100 ms; watchdog and driver are watched with 300 ms
        (0x1017, 0, 100),
        (0x1016, 1, 0x007E_012C),
        (0x1016, 2, 0x007F_012C),
        (0x1029, 1, 0),
        (0x605A, 0, 2),
        (0x605E, 0, 2),
        # every PDO that is not used off, bit 30 kept
        (0x1401, 1, 0xC000_0301),
        (0x1402, 1, 0xC000_0401),
        (0x1802, 1, 0xC000_0381),
        (0x1803, 1, 0xC000_0481),
        # RPDO1: off, 6040h, 60FFh with SYNC, on
        (0x1400, 1, 0xC000_0201),
        (0x1600, 0, 0),
        (0x1600, 1, 0x6040_0010),
        (0x1600, 2, 0x60FF_0020),
        (0x1600, 0, 2),
        (0x1400, 2, 1),
        (0x1400, 1, 0x4000_0201),
        # RPDO4: 6040h at once, for the watchdog's quick stop
        (0x1403, 1, 0xC000_0501),
        (0x1603, 0, 0),
        (0x1603, 1, 0x6040_0010),
        (0x1603, 0, 1),
        (0x1403, 2, 255),
        (0x1403, 1, 0x4000_0501),
        # TPDO1: 6041h, 6064h
        (0x1800, 1, 0xC000_0181),
        (0x1A00, 0, 0),
        (0x1A00, 1, 0x6041_0010),
        (0x1A00, 2, 0x6064_0020),
        (0x1A00, 0, 2),
        (0x1800, 2, 1),
        (0x1800, 1, 0x4000_0181),
        # TPDO2: 606Ch, 6077h
        (0x1801, 1, 0xC000_0281),
        (0x1A01, 0, 0),
        (0x1A01, 1, 0x606C_0020),
        (0x1A01, 2, 0x6077_0010),
        (0x1A01, 0, 2),
        (0x1801, 2, 1),
        (0x1801, 1, 0x4000_0281),
    ]


def test_unused_pdos_are_off_in_the_end_even_those_beyond_the_fourth() -> None:
    drive = FakeDrive(objects=factory_objects(pdos=8))
    boot_one_axis(drive)
    off = [index for index in (*range(0x1400, 0x1408), *range(0x1800, 0x1808)) if drive.number(index, 1) & OFF]
    assert off == [0x1401, 0x1402, 0x1404, 0x1405, 0x1406, 0x1407, *range(0x1802, 0x1808)]


def test_two_axes_on_one_node() -> None:
    drive = FakeDrive(objects=factory_objects(axes=(0, 1)))
    both = robot()
    boot = Bench(drive, both, drives=both.drives[::-1]).run()
    assert notes_of(boot) == ()
    assert [drive.number(0x1600, sub) for sub in range(3)] == [2, 0x6040_0010, 0x60FF_0020]
    assert [drive.number(0x1601, sub) for sub in range(3)] == [2, 0x6840_0010, 0x68FF_0020]
    assert [drive.number(0x1603, sub) for sub in range(3)] == [2, 0x6040_0010, 0x6840_0010]
    assert [drive.number(0x1A02, sub) for sub in range(3)] == [2, 0x6841_0010, 0x6864_0020]
    assert [drive.number(index) for index in (0x6807, 0x685A, 0x685E, 0x6860, 0x68FF)] == [3, 2, 2, 3, 0]
    assert [drive.number(index, 1) for index in (0x1401, 0x1802, 0x1803)] == [0x4000_0301, 0x4000_0381, 0x4000_0481]


def test_the_first_boot_takes_not_more_than_115_transfers() -> None:
    drive = FakeDrive()
    Bench(drive, robot(), identify=False).run()
    assert drive.transfers <= 115


HEARTBEATS = [(0x1017, 0, 100), (0x1016, 1, 0x007E_012C), (0x1016, 2, 0x007F_012C)]


def test_a_second_boot_of_a_drive_that_keeps_all_over_a_reset_writes_the_heartbeats_alone() -> None:
    """An NMT reset takes them back in most drives: they are written, and then read."""
    drive = FakeDrive()
    boot_one_axis(drive)
    drive.writes, drive.transfers = [], 0
    boot = Bench(drive, robot(), identify=False).run()
    assert drive.writes == HEARTBEATS
    assert boot.report is not None
    assert [change.partition(":")[0] for change in boot.report.changes] == ["1017h", "1016h", "1016h"]
    assert drive.transfers <= 56


def test_without_a_boot_up_message_nothing_counts_as_reset_and_a_second_boot_writes_nothing() -> None:
    drive = FakeDrive(answers_nmt_reset=False)
    boot_one_axis(drive)
    drive.writes = []
    boot = boot_one_axis(drive)
    assert drive.writes == []
    assert boot.report is not None
    assert boot.report.changes == ()


def test_what_was_changed_is_told_with_both_values() -> None:
    drive = FakeDrive()
    boot_one_axis(drive)
    drive.objects |= {(0x6085, 0): u32(10), (0x1600, 2): u32(0x607A_0020)}
    boot = boot_one_axis(drive)
    assert boot.report is not None
    assert boot.report.changes[0] == "6085h:0: 0000000Ah → 00000B31h"
    assert "RPDO1: mapped anew, 2 objects" in boot.report.changes


# -- waiting


def test_a_missing_drive_is_waited_for_and_may_come_late() -> None:
    drive = FakeDrive(powered=False)
    bench = Bench(drive, robot())
    boot = bench.run(seconds=20.0)
    assert not boot.done
    assert boot.waiting_for == "waiting for node 1 (left): the answer to 1000h:0"
    drive.powered = True
    bench.run(seconds=1.0)
    assert boot.report is not None


def test_a_stopped_node_is_sent_to_pre_operational_to_be_heard() -> None:
    drive = FakeDrive()
    bench = Bench(drive, robot())
    serve = drive.on_frame

    def stopped_at_first(frame: Frame) -> list[Frame]:
        is_deaf = 0x80 not in drive.nmt and frame.cob_id != 0x000
        return [] if is_deaf else serve(frame)

    drive.on_frame = stopped_at_first  # type: ignore[method-assign]
    boot = bench.run()
    assert boot.report is not None
    assert drive.nmt == [0x80, 0x82, 0x80]


def test_a_boot_up_message_that_never_comes_is_a_note() -> None:
    bench = Bench(FakeDrive(answers_nmt_reset=False), robot())
    assert bench.run(seconds=4.9).waiting_for == "waiting for node 1 (left): its boot-up message"
    assert notes_of(bench.run()) == ("no boot-up message within 5 s of NMT reset communication",)


def test_a_drive_that_falls_silent_in_the_middle_is_an_error_that_names_the_object() -> None:
    drive = FakeDrive(on_write={(0x6060, 0): lambda drive, _: setattr(drive, "powered", False)})
    boot = boot_one_axis(drive)
    assert error_of(boot) == (
        "node 1: 6061h:0: no answer to 3 requests, 0.3 s each. "
        "It answered before, so its node id and the bit rate are right, and the boot is tried again each second. If "
        "this goes on, check its supply and its cable, and let no other program use its SDO channel "
        "(canbase bus sdo, the "
        "manufacturer's tool); where the drive does not have it, `options.mode_display: no` in its drive profile."
    )


def test_a_drive_that_starts_anew_in_the_middle_has_forgotten_everything() -> None:
    drive = FakeDrive(on_write={(0x6060, 0): lambda drive, _: setattr(drive, "powered", False)})
    bench = Bench(drive, robot())
    bench.run(seconds=0.2)
    bench.boot.on_frame(Frame(0x701, b"\0"), bench.now_s)
    assert "it started anew while it was being configured" in error_of(bench.boot)
    assert bench.boot.tick(bench.now_s + 10.0) == []


def test_boot_up_messages_before_the_reset_are_normal() -> None:
    drive = FakeDrive(powered=False)
    bench = Bench(drive, robot())
    bench.run(seconds=0.1)
    bench.boot.on_frame(Frame(0x701, b"\0"), bench.now_s)  # its boot loader
    bench.boot.on_frame(Frame(0x701, b"\0"), bench.now_s)  # its firmware
    drive.powered = True
    assert bench.run().report is not None


# -- who it is


def test_the_configured_identity_is_compared() -> None:
    boot = Bench(FakeDrive(), robot(vendor_id=0x1111, product_code=0x9999)).run()
    assert error_of(boot) == (
        "node 1: 1018h:2 (product_code) is 00002222h, expected 00009999h. "
        "Another drive or firmware has this node id, or `identity` in robot.yaml is wrong."
    )


def test_nothing_is_written_to_the_wrong_drive() -> None:
    drive = FakeDrive()
    Bench(drive, robot(vendor_id=1)).run()
    assert (drive.writes, drive.nmt) == ([], [])


def test_an_identity_that_the_drive_does_not_have() -> None:
    drive = FakeDrive()
    del drive.objects[0x1018, 4]
    assert "1018h:4 (serial) is missing, expected 00000007h" in error_of(Bench(drive, robot(serial=7)).run())


def test_a_strange_device_type_is_a_note_only() -> None:
    drive = FakeDrive()
    drive.objects[0x1000, 0] = u32(0x000F_0191)
    assert notes_of(boot_one_axis(drive)) == ("1000h:0 is 000F0191h, not the profile 402 (0192h) of a motor drive",)


# -- a drive that is still running


def running_drive(after_quick_stop: int) -> FakeDrive:
    """A drive at 955 rpm in operation enabled; a quick stop ends at once, with statusword `after_quick_stop`."""
    drive = FakeDrive()
    drive.objects[0x6041, 0] = u16(0x1637)
    drive.objects[0x606C, 0] = u32(955)

    def control(drive: FakeDrive, data: bytes) -> None:
        drive.objects[0x6041, 0] = u16({0x02: after_quick_stop, 0x00: 0x0240}[data[0]])
        drive.objects[0x606C, 0] = u32(0)

    drive.on_write[0x6040, 0] = control
    return drive


def test_a_running_drive_is_quick_stopped_before_its_communication_is_reset() -> None:
    drive = running_drive(after_quick_stop=0x0240)
    assert boot_one_axis(drive).report is not None
    assert drive.writes[:2] == [(0x6040, 0, 0x02), (0x6007, 0, 3)]


def test_a_statusword_that_shows_no_state_may_be_a_running_drive() -> None:
    drive = running_drive(after_quick_stop=0x0240)
    drive.objects[0x6041, 0] = u16(0x0011)
    assert boot_one_axis(drive).report is not None
    assert drive.writes[0] == (0x6040, 0, 0x02)


def test_a_drive_that_stays_in_quick_stop_is_disabled_when_it_stands() -> None:
    drive = running_drive(after_quick_stop=0x0217)
    bench = Bench(drive, robot())
    assert bench.run().report is not None
    assert drive.writes[:2] == [(0x6040, 0, 0x02), (0x6040, 0, 0x00)]
    assert bench.now_s == pytest.approx(100.1, abs=0.011)  # five polls of 20 ms


def test_a_drive_that_is_switched_on_but_not_enabled_is_disabled() -> None:
    drive = FakeDrive()
    drive.objects[0x6041, 0] = u16(0x0233)
    assert boot_one_axis(drive).report is not None
    assert drive.writes[0] == (0x6040, 0, 0x00)


def test_a_drive_that_does_not_stop_loses_its_voltage_and_is_an_error() -> None:
    drive = FakeDrive()
    drive.objects[0x6041, 0] = u16(0x1637)
    drive.objects[0x606C, 0] = u32(2**32 - 955)  # backward
    bench = Bench(drive, robot())
    boot = bench.run()
    assert "left turns at 0.500 m/s 0.6 s after a quick stop. Its voltage is now disabled" in error_of(boot)
    assert drive.nmt == [0x80]
    assert drive.writes == [(0x6040, 0, 0x02), (0x6040, 0, 0x00)]
    assert bench.now_s == pytest.approx(100.6, abs=0.05)


# quick stop ── 0.5 m/s ── from there on just slower than the watchdog's floor of noise, and never at standstill
def test_a_drive_that_never_quite_stands_loses_its_voltage_too() -> None:
    drive = FakeDrive()
    drive.objects[0x6041, 0] = u16(0x1637)
    drive.objects[0x606C, 0] = u32(40)  # 0.021 m/s
    bench = Bench(drive, robot())
    boot = bench.run()
    assert "a quick stop. Its voltage is now disabled" in error_of(boot)
    assert bench.now_s < 101.0


def test_both_axes_get_their_quick_stop_before_either_is_waited_for() -> None:
    drive = FakeDrive(objects=factory_objects(axes=(0, 1)))
    drive.objects[0x6041, 0] = drive.objects[0x6841, 0] = u16(0x1637)
    drive.objects[0x606C, 0] = drive.objects[0x686C, 0] = u32(955)
    both = robot()
    Bench(drive, both, drives=both.drives).run(seconds=0.5)
    assert drive.writes == [(0x6040, 0, 0x02), (0x6840, 0, 0x02)]


# -- anything may be on the bus

frames = st.builds(
    Frame, st.sampled_from([0x000, 0x080, 0x081, 0x181, 0x581, 0x601, 0x701, 0x77E]), st.binary(max_size=8)
)


@settings(max_examples=50)
@given(st.lists(st.lists(frames, max_size=4), max_size=150))
def test_no_frame_raises(noise: list[list[Frame]]) -> None:
    drive = FakeDrive()
    boot = NodeBoot(1, robot().drives[:1], robot())
    for cycle, strays in enumerate(noise):
        now_s = 0.01 * cycle
        for frame in [answer for sent in boot.tick(now_s) for answer in drive.on_frame(sent)] + strays:
            boot.on_frame(frame, now_s)


def test_a_frame_before_the_first_tick_does_nothing() -> None:
    boot = NodeBoot(1, robot().drives[:1], robot())
    boot.on_frame(Frame(0x701, b"\0"), now_s=0.0)
    assert boot.tick(now_s=0.0) == [Frame(0x601, bytes.fromhex("40 00 10 00 00 00 00 00"))]


def test_other_answers_on_the_channel_change_nothing() -> None:
    boot = NodeBoot(1, robot().drives[:1], robot())
    boot.tick(now_s=0.0)
    waits_for = boot.waiting_for
    boot.on_frame(Frame(0x581, bytes.fromhex("4B 41 60 00 37 06 00 00")), now_s=0.0)
    assert boot.waiting_for == waits_for != ""


def test_a_request_that_waits_for_the_bus_is_no_drive_that_does_not_answer() -> None:
    """On a slow and full bus a node's share of a cycle is less than a request: it waits for several cycles."""
    boot, drive = NodeBoot(1, robot().drives[:1], robot()), FakeDrive()
    for frame in [answer for sent in boot.tick(0.0) for answer in drive.on_frame(sent)]:
        boot.on_frame(frame, 0.001)
    assert (boot.transfers, boot.is_transferring(0.001), boot.is_transferring(0.5)) == (1, True, True)
    assert boot.tick(0.5) != []
    assert not boot.is_transferring(0.6)


def test_looking_for_a_drive_that_is_not_there_counts_for_nothing_in_the_shares_of_the_bus() -> None:
    """After a minute it would be far ahead of a drive that begins its boot then, and would get no share meanwhile."""
    boot = NodeBoot(1, robot().drives[:1], robot())
    requests = [frame for cycle in range(6000) for frame in boot.tick(cycle * 0.01)]
    assert len(requests) > 100
    assert boot.transfers == 0


def test_a_drive_that_waits_for_its_boot_up_message_makes_no_transfers() -> None:
    bench = Bench(FakeDrive(answers_nmt_reset=False), robot())
    boot = bench.run(seconds=1.0)
    assert boot.configuring
    assert not boot.is_transferring(bench.now_s)


def test_axes_that_no_node_has_raise_at_once() -> None:
    with pytest.raises(ValueError, match="axes"):
        NodeBoot(1, (), robot())
