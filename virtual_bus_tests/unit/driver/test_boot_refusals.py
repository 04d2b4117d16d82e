"""Boots of drives that lack, refuse or change something: what is a note, and what is an error."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from support.fake_drive import (
    DEVICE_STATE,
    INVALID,
    NO_OBJECT,
    READ_ONLY,
    WRITE_ONLY,
    Bench,
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
from support.fake_drive import robot as fake_robot

BY_HAND = "with the manufacturer's tool"
NO_SELF_STOP = (
    "or node guarding stops the motor: canbase setup commission shows whether it stops in another way, "
    "else only a wired STO does"
)


@pytest.mark.parametrize(
    ("index", "sub", "note"),
    [
        (
            0x1017,
            0,
            "1017h:0: 0602 0000h the object does not exist; so its heartbeat must come by itself, within 150 ms: set "
            "that with the manufacturer's tool; "
            "where it has node guarding alone, set `self_stop.node_guarding: true` and "
            "`self_stop.heartbeat_entries: 0` in its drive profile",
        ),
        (
            0x1029,
            1,
            "1029h:1: 0602 0000h the object does not exist; so after a lost heartbeat it may stay operational and take "
            "setpoints",
        ),
        (
            0x605E,
            0,
            "605Eh:0: 0602 0000h the object does not exist; so a fault may take the power away and let the wheel coast",
        ),
        (
            0x6083,
            0,
            "6083h:0: 0602 0000h the object does not exist; so it may accelerate more slowly than ordered",
        ),
    ],
)
def test_a_missing_option_is_a_note(index: int, sub: int, note: str) -> None:
    drive = FakeDrive()
    del drive.objects[index, sub]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == (note,)
    assert boot.report is not None
    assert boot.report.stops_by_itself


@pytest.mark.parametrize(
    ("index", "unknown"),
    [
        (
            0x605A,
            "how a quick stop ends is unknown: it must brake left and not let it coast; make sure by the manual, then "
            "press the emergency stop once at low speed",
        ),
        (
            0x6084,
            "how hard left brakes is unknown: it must be at least 2 m/s² (limits.deceleration_mps2, in a curve or an "
            "emergency), a value of 3820 in the unit of its profile; set it with the manufacturer's tool",
        ),
        (
            0x6085,
            "how hard left brakes is unknown: it must be at least 1.5 m/s² (limits.emergency_deceleration_mps2), a "
            "value of 2865 in the unit of its profile; set it with the manufacturer's tool",
        ),
    ],
)
def test_a_stop_that_cannot_be_set_nor_read_is_named_with_the_value_that_it_needs(index: int, unknown: str) -> None:
    drive = FakeDrive()
    del drive.objects[index, 0]
    boot = boot_one_axis(drive)
    first, second = notes_of(boot)
    assert first.startswith(f"{index:04X}h:0: 0602 0000h the object does not exist")
    assert second == unknown
    assert boot.report is not None
    assert boot.report.stops_by_itself


def test_a_drive_without_6007h_does_not_stop_by_itself() -> None:
    drive = FakeDrive()
    del drive.objects[0x6007, 0]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == ("6007h:0: 0602 0000h the object does not exist; so no lost heartbeat " + NO_SELF_STOP,)
    assert boot.report is not None
    assert not boot.report.stops_by_itself


@pytest.mark.parametrize(
    ("key", "so"),
    [
        (
            (0x1016, 1),
            f"so it does not stop by the watchdog's heartbeat: set 1016h:1 to 007E012Ch {BY_HAND}, or "
            "`timeouts.drive_heartbeat_s` in robot.yaml to what it takes",
        ),
        ((0x6007, 0), f"so no lost heartbeat or node guarding stops the motor: set 6007h:0 to 0003h {BY_HAND}"),
    ],
)
def test_what_a_drive_refuses_of_its_self_stop_is_named_with_what_that_means(key: Key, so: str) -> None:
    """A proof by commissioning would not count: the drive has both objects, so it is not offered."""
    boot = boot_one_axis(FakeDrive(refuse={key: INVALID}))
    assert any(f"{so}, else only a wired STO does" in note for note in notes_of(boot))
    assert "canbase setup commission" not in str(notes_of(boot))
    assert boot.report is not None
    assert not boot.report.stops_by_itself


def test_a_drive_without_1016h_does_not_stop_by_itself() -> None:
    drive = FakeDrive()
    for sub in range(3):
        del drive.objects[0x1016, sub]
    boot = boot_one_axis(drive)
    assert notes_of(boot) == (
        "1016h: the drive monitors no heartbeat, and none stops it; where it has node guarding, set "
        "`self_stop.node_guarding: true` in its drive profile",
    )
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
        "6083h:0 is 000003E8h, expected 00000B31h; so it may accelerate more slowly than ordered: set 6083h:0 to "
        "00000B31h with the manufacturer's tool",
    )


def test_a_read_only_option_passes_when_it_is_right_and_is_a_note_when_not() -> None:
    drive = FakeDrive(refuse={(0x605A, 0): READ_ONLY, (0x605E, 0): READ_ONLY})
    drive.objects[0x605A, 0] = u16(2)
    assert notes_of(boot_one_axis(drive)) == (
        "605Eh:0 is 0000h, expected 0002h (0601 0002h the object is read-only); so a fault may take the power away and "
        "let the wheel coast: set 605Eh:0 to 0002h " + BY_HAND,
    )


def test_a_mode_that_can_only_be_written_is_believed() -> None:
    assert notes_of(boot_one_axis(FakeDrive(refuse_read={(0x6060, 0): WRITE_ONLY}))) == ()


def test_a_fixed_mapping_that_is_right_is_left_alone() -> None:
    fixed = {(0x1A01, sub): READ_ONLY for sub in range(5)}
    drive = FakeDrive(refuse=fixed)
    drive.objects |= {(0x1A01, 0): u8(2), (0x1A01, 1): u32(0x606C_0020), (0x1A01, 2): u32(0x6077_0010)}
    assert notes_of(boot_one_axis(drive)) == ()


NO_TORQUE = (
    "Where it can map the other one of 6077h and 6078h, name that in `options.torque` of its drive profile; without "
    "torque the power goes off for a moment at each standstill (watchdog.stand_proof)"
)


def test_a_drive_without_torque_does_without() -> None:
    drive = FakeDrive()
    del drive.objects[0x6077, 0]
    notes = ("torque unknown: the drive has no 6077h:0. " + NO_TORQUE,)
    assert notes_of(boot_one_axis(drive)) == notes
    assert [drive.number(0x1A01, sub) for sub in range(2)] == [1, 0x606C_0020]


@pytest.mark.parametrize("refused", [{(0x1A01, 2): 0x06040041}, {(0x1A01, 0): READ_ONLY, (0x1A01, 1): READ_ONLY}])
def test_a_drive_whose_pdo_does_not_take_the_torque_does_without(refused: dict[Key, int]) -> None:
    drive = FakeDrive(refuse=refused)
    drive.objects |= {(0x1A01, 0): u8(1), (0x1A01, 1): u32(0x606C_0020)}
    (note,) = notes_of(boot_one_axis(drive))
    assert note.startswith("torque unknown: TPDO2 does not take ")
    assert note.endswith(NO_TORQUE)
    assert [drive.number(0x1A01, sub) for sub in range(2)] == [1, 0x606C_0020]
    assert drive.number(0x1801, 1) == 0x4000_0281


def test_a_velocity_that_no_pdo_takes_is_an_error_with_a_torque_too() -> None:
    drive = FakeDrive(refuse={(0x1A01, 1): 0x06040041})
    assert "1A01h:1" in error_of(boot_one_axis(drive))


GENERAL_ERROR, LOCAL_CONTROL, TOO_HIGH, TOO_LOW = 0x08000000, 0x08000021, 0x06090031, 0x06090032


@pytest.mark.parametrize("abort", [GENERAL_ERROR, LOCAL_CONTROL, 0x06060000, 0x12345678])
@pytest.mark.parametrize(
    ("key", "named"),
    [
        ((0x1016, 0), "self_stop.heartbeat_entries"),
        ((0x1018, 3), ""),
        ((0x1019, 0), "options.sync_counter"),
        ((0x6007, 0), "self_stop.abort_connection"),
        ((0x6061, 0), "options.mode_display"),
    ],
)
def test_whatever_the_abort_code_an_optional_object_that_cannot_be_read_is_a_note(
    key: Key, named: str, abort: int
) -> None:
    drive = FakeDrive(refuse_read={key: abort}, refuse={key: abort})
    drive.objects.setdefault(key, u8(0))
    assert any(f"{key[0]:04X}h:{key[1]}" in note and named in note for note in notes_of(boot_one_axis(drive)))


def test_a_drive_whose_1016h_cannot_be_read_does_not_stop_by_itself() -> None:
    boot = boot_one_axis(FakeDrive(refuse_read={(0x1016, 0): GENERAL_ERROR}))
    assert boot.report is not None
    assert not boot.report.stops_by_itself


def bounded(
    accepted: dict[Key, Callable[[int], bool]], abort: int = INVALID, lacks: tuple[Key, ...] = ()
) -> tuple[FakeDrive, NodeBoot]:
    """A drive that takes only some values of these objects, and has no `lacks`; and its boot."""

    @dataclass
    class Choosy(FakeDrive):
        def _write(self, key: Key, data: bytes) -> int:
            wrong = key in accepted and not accepted[key](int.from_bytes(data, "little"))
            return abort if wrong else super()._write(key, data)

    drive = Choosy()
    drive.objects |= {key: u8(1) for key in accepted if key[1] == 2 and key[0] < 0x1A00}
    times = {(index, sub): u16(0) for index, _ in accepted if 0x1800 <= index < 0x1A00 for sub in (3, 5)}
    drive.objects |= {key: value for key, value in times.items() if key not in lacks}
    return drive, boot_one_axis(drive)


def heartbeat_of(accepted: Callable[[int], bool], abort: int = INVALID) -> tuple[FakeDrive, NodeBoot]:
    """A drive that takes only some periods of 1017h, and its boot."""
    return bounded({(0x1017, 0): accepted}, abort)


@pytest.mark.parametrize(
    ("accepted", "period_ms"),
    [
        (lambda ms: ms % 64 == 0, 128),
        (lambda ms: ms <= 50, 50),
        (lambda ms: ms >= 125, 125),
        (lambda ms: ms % 50 == 0, 100),
    ],
)
@pytest.mark.parametrize("abort", [INVALID, TOO_HIGH, TOO_LOW])
def test_where_the_wanted_heartbeat_period_is_refused_the_nearest_allowed_one_is_set(
    accepted: Callable[[int], bool], period_ms: int, abort: int
) -> None:
    drive, boot = heartbeat_of(accepted, abort)
    assert drive.number(0x1017) == period_ms
    said = (f"1017h:0: heartbeat every {period_ms} ms, 100 ms was refused",)
    assert notes_of(boot) == (said if period_ms != 100 else ())


@pytest.mark.parametrize(
    ("shortest_ms", "hint"),
    [
        (160, "It keeps 160 ms: set `timeouts.drive_heartbeat_s: 0.32` in robot.yaml"),
        (500, "It keeps 500 ms: set `timeouts.drive_heartbeat_s: 1` in robot.yaml"),
        (
            501,
            "Nor any up to 500 ms: set 1017h:0 to 1 to 150 with the manufacturer's tool, "
            "or, where it has node guarding alone",
        ),
        (501, "set `self_stop.node_guarding: true` and `self_stop.heartbeat_entries: 0` in its drive profile"),
    ],
)
def test_a_drive_that_takes_no_heartbeat_period_that_is_short_enough_is_tried_with_longer_ones(
    shortest_ms: int, hint: str
) -> None:
    _, boot = heartbeat_of(lambda ms: ms >= shortest_ms)
    text = error_of(boot)
    assert "it takes no heartbeat period of at most 150 ms (1017h:0: 0609 0030h value not valid)" in text
    assert hint in text


@pytest.mark.parametrize(
    ("period_ms", "hint"),
    [(200, "It keeps 200 ms: set `timeouts.drive_heartbeat_s: 0.4`"), (501, "Nor any up to 500 ms"), (0, "Nor any")],
)
def test_a_fixed_heartbeat_period_that_is_too_long_is_told_with_the_key_that_allows_it(
    period_ms: int, hint: str
) -> None:
    drive = FakeDrive(
        objects=factory_objects() | {(0x1017, 0): period_ms.to_bytes(2, "little")}, refuse={(0x1017, 0): READ_ONLY}
    )
    assert hint in error_of(boot_one_axis(drive))


def test_of_the_periods_that_it_takes_the_shortest_is_told_whatever_it_had() -> None:
    drive, boot = heartbeat_of(lambda ms: ms >= 200)
    assert "It keeps 200 ms: set `timeouts.drive_heartbeat_s: 0.4`" in error_of(boot)
    assert drive.number(0x1017) == 200


def test_what_cannot_be_read_is_written_all_the_same_and_proves_nothing() -> None:
    """Its own 605Ah of 0 would coast: it is set. That it took 6007h no read shows, so nothing relies on it."""
    drive = FakeDrive(refuse_read={(0x605A, 0): GENERAL_ERROR, (0x6007, 0): GENERAL_ERROR})
    boot = boot_one_axis(drive)
    assert drive.number(0x605A) == 2
    assert drive.number(0x6007) == 3
    assert "605Ah:0 is written, and cannot be read back" in notes_of(boot)
    assert boot.report is not None
    assert not boot.report.stops_by_itself


def test_a_pdo_that_cannot_be_switched_off_nor_mapped_is_one_for_the_makers_tool() -> None:
    drive = FakeDrive(refuse={(0x1400, 1): READ_ONLY})
    text = error_of(boot_one_axis(drive))
    assert (
        "RPDO1 cannot be switched off (1400h:1: 0601 0002h the object is read-only), nor mapped while it is on" in text
    )
    assert "manufacturer's tool" in text


@pytest.mark.parametrize(("found", "fits"), [(128, True), (150, True), (151, False), (0, False)])
def test_a_period_that_the_drive_rounds_is_taken_when_it_is_short_enough(found: int, fits: bool) -> None:
    def rounded(drive: FakeDrive, _: bytes) -> None:
        drive.objects[0x1017, 0] = u16(found)

    boot = boot_one_axis(FakeDrive(on_write={(0x1017, 0): rounded}))
    assert (boot.error is None) is fits


def without_sync(**missing: Key) -> tuple[FakeDrive, NodeBoot]:
    """A drive that takes event-driven PDOs alone. `missing`: a time that it lacks."""
    types = {(base + n, 2): lambda value: value in (254, 255) for base in (0x1400, 0x1800) for n in range(2)}
    drive, boot = bounded(types, lacks=tuple(missing.values()))
    return drive, boot


def test_a_drive_that_takes_no_synchronous_pdo_sends_by_its_timer_once_in_a_cycle() -> None:
    drive, boot = without_sync()
    assert boot.error is None, boot.error
    assert [drive.number(index, 2) for index in (0x1400, 0x1800, 0x1801)] == [255] * 3
    assert [drive.number(index, sub) for index in (0x1800, 0x1801) for sub in (3, 5)] == [100, 10, 100, 10]
    notes = "; ".join(notes_of(boot))
    assert "RPDO1 does not take type 1: it acts when it arrives" in notes
    assert "TPDO1 does not take type 1: it is sent every 10 ms by its timer" in notes


@pytest.mark.parametrize("sub", [3, 5])
def test_without_sync_and_without_its_times_a_drive_cannot_be_used(sub: int) -> None:
    """At standstill nothing would change, and nothing would come; or it would come as often as from two drives."""
    _, boot = without_sync(time=(0x1800, sub))
    text = error_of(boot)
    assert f"1800h:2: 0609 0030h value not valid, TPDO1 does not take type 1, nor 1800h:{sub}" in text
    assert "Without SYNC it must come every 10 ms" in text


def test_a_fixed_event_driven_type_is_taken_as_it_is() -> None:
    drive = FakeDrive(refuse={(0x1400, 2): READ_ONLY})
    drive.objects[0x1400, 2] = u8(254)
    (note,) = notes_of(boot_one_axis(drive))
    assert note.startswith("1400h:2 is FEh, expected 01h")
    assert note.endswith("RPDO1 does not take type 1: it acts when it arrives (type 255 or 254)")


def test_a_drive_that_takes_neither_type_is_one_for_the_makers_tool() -> None:
    text = error_of(boot_one_axis(FakeDrive(refuse={(0x1400, 2): INVALID})))
    assert "1400h:2: 0609 0030h value not valid" in text
    assert "It takes no other type either. Set 1400h:2 to 1 with the manufacturer's tool" in text


@pytest.mark.parametrize("abort", [0x06070010, 0x06070012, 0x06070013])
@pytest.mark.parametrize(
    ("key", "where"),
    [
        ((0x60FF, 0), "set `layout.target_bits` in its drive profile to that of its manual, 16"),
        ((0x6060, 0), "such a drive cannot be used"),
    ],
)
def test_an_object_of_another_width_is_said_to_be_one(key: Key, where: str, abort: int) -> None:
    text = error_of(boot_one_axis(FakeDrive(refuse={key: abort})))
    assert "another width than CiA 402" in text
    assert where in text


def test_two_drives_with_one_node_id_are_named() -> None:
    class Twins(FakeDrive):
        def on_frame(self, frame: Frame) -> list[Frame]:
            return super().on_frame(frame) * 2

    text = error_of(boot_one_axis(Twins()))
    assert text.startswith(
        "node 1: each request is answered twice: two devices on the bus have this node id, or a gatew"
    )
    assert "canbase bus adopt" in text
    assert "If one drive alone has it, take out the gateway" in text


def test_a_watchdog_that_stops_the_drive_meanwhile_is_no_second_drive() -> None:
    """It writes 6040h and reads 6041h, 6064h and 606Ch of a drive with power, just as the boot does."""

    class Watched(FakeDrive):
        def on_frame(self, frame: Frame) -> list[Frame]:
            index = int.from_bytes(frame.data[1:3], "little")
            return super().on_frame(frame) * (2 if index in (0x6040, 0x6041, 0x6064, 0x606C) else 1)

    drive = Watched()
    drive.objects[0x6041, 0] = u16(0x0237)
    boot = Bench(drive, fake_robot()).run(10.0)
    assert boot.error is None


def test_an_answer_that_comes_late_and_then_again_names_no_second_drive() -> None:
    """The first request of each transfer is lost, so that two were sent, and both are answered in the end."""

    class Slow(FakeDrive):
        asked = 0

        def on_frame(self, frame: Frame) -> list[Frame]:
            if frame.cob_id != 0x601 or frame.data[0] == 0x80:
                return super().on_frame(frame)
            self.asked += 1
            return super().on_frame(frame) * 2 if self.asked % 2 == 0 else []

    boot = Bench(Slow(), fake_robot()).run(200.0)
    assert boot.error is None


# -- what no drive may lack


@pytest.mark.parametrize(
    ("key", "abort", "problem", "hint"),
    [
        (
            (0x6060, 0),
            INVALID,
            "6060h:0: 0609 0030h value not valid",
            "Set `mode` in robot.yaml to one that the drive has: in 6502h (canbase bus sdo read 1 6502)",
        ),
        ((0x60FF, 0), INVALID, "60FFh:0: 0609 0030h", "let the drive take its commands from the bus"),
        ((0x60FF, 0), GENERAL_ERROR, "60FFh:0: 0800 0000h", "check `axis` in robot.yaml"),
        ((0x6041, 0), GENERAL_ERROR, "6041h:0: 0800 0000h", "check `axis` in robot.yaml"),
        ((0x1400, 1), DEVICE_STATE, "RPDO1 cannot be switched off (1400h:1: 0800 0022h", "switch the drive off and on"),
        ((0x60FF, 0), DEVICE_STATE, "60FFh:0: 0800 0022h", "switch the drive off and on again"),
        ((0x6041, 0), NO_OBJECT, "6041h:0: 0602 0000h the object does not exist", "check `axis` in robot.yaml"),
        (
            (0x1600, 2),
            0x06040041,
            "does not take 60FFh:0 (1600h:2: 0604 0041h the object",
            "Let RPDO1 carry 6040h:0, 60F",
        ),
        (
            (0x1A00, 0),
            READ_ONLY,
            "TPDO1 does not take another mapping (1A00h:0: 0601 0002h",
            "it carries 2000h:0",
        ),
        ((0x1600, 1), DEVICE_STATE, "RPDO1 does not take 6040h:0 (1600h:1: 0800 0022h", "switch the drive off and on"),
        ((0x1400, 2), DEVICE_STATE, "1400h:2: 0800 0022h", "switch the drive off and on again"),
    ],
)
def test_a_refused_necessity_is_an_error(key: Key, abort: int, problem: str, hint: str) -> None:
    refuses = {key: abort}
    text = error_of(boot_one_axis(FakeDrive(refuse=refuses, refuse_read=refuses if key[0] == 0x6041 else {})))
    assert problem in text
    assert hint in text


def test_a_type_of_pdo_that_is_fixed_and_waits_for_another_sync_is_one_for_the_makers_tool() -> None:
    drive = FakeDrive(refuse={(0x1400, 2): READ_ONLY})
    drive.objects[0x1400, 2] = u8(10)
    text = error_of(boot_one_axis(drive))
    assert (
        "It takes no other type either. Set 1400h:2 to 1 with the manufacturer's tool; where that cannot be done"
        in text
    )
    assert "pdo.synchronous" not in text


class Choosy(FakeDrive):
    """It takes these values of one object alone."""

    at: Key = (0, 0)
    takes: frozenset[int] = frozenset()

    def _write(self, key: Key, data: bytes) -> int:
        return INVALID if key == self.at and data[0] not in self.takes else super()._write(key, data)


@pytest.mark.parametrize(("takes", "is_usable"), [({254}, True), ({255}, True), ({0}, False), ({10}, False)])
def test_a_drive_without_synchronous_setpoints_is_one_for_the_makers_tool_where_it_takes_no_event_either(
    takes: set[int], is_usable: bool
) -> None:
    drive = Choosy()
    drive.objects[0x1400, 2] = u8(0)
    drive.at, drive.takes = (0x1400, 2), frozenset(takes)
    boot = boot_one_axis(drive)
    if is_usable:
        assert boot.report is not None
        assert any("it acts when it arrives (type 255 or 254)" in note for note in boot.report.notes)
    else:
        assert "It takes no other type either. Set 1400h:2 to 1 with the manufacturer's tool" in error_of(boot)


@pytest.mark.parametrize(("takes", "key_helps"), [({1}, True), ({0}, False)])
def test_the_key_for_synchronous_pdos_is_named_only_where_the_drive_takes_them(
    takes: set[int], key_helps: bool
) -> None:
    """The profile of Roboteq has `pdo.synchronous: false`."""
    drive = Choosy(objects=factory_objects(axes=(0, 1)))
    drive.objects |= {(0x1800 + i, sub): u16(0) for i in range(4) for sub in (3, 5)} | {(0x1800, 2): u8(0)}
    drive.at, drive.takes = (0x1800, 2), frozenset(takes)
    values = fake_robot().model_dump()
    values["drives"] = [each | {"profile": "roboteq"} for each in values["drives"]]
    base = Robot.model_validate(values)
    text = error_of(Bench(drive, base, base.drives).run())
    assert ("set `pdo.synchronous: true` in its drive profile" in text) is key_helps
    assert ("It takes no other type either. Set 1800h:2 to 255" in text) is not key_helps


def test_a_drive_that_refuses_1000h_is_there() -> None:
    for refuse_read, said in (
        (
            {(0x1000, 0): GENERAL_ERROR},
            "1000h:0 cannot be read: 0800 0000h general error; so nothing shows that it is a motor drive; it is used "
            "as one",
        ),
        ({(0x1000, 0): NO_OBJECT}, "it has no 1000h, which CiA 301 requires of every device"),
    ):
        notes = notes_of(boot_one_axis(FakeDrive(refuse_read=refuse_read)))
        assert notes == (said,)


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


@pytest.mark.parametrize("index", [0x1600, 0x1603])
def test_an_rpdo_that_keeps_another_number_of_objects_is_an_error(index: int) -> None:
    """Nobody hears an RPDO: all of it is read back, also what shows by itself in a TPDO."""

    def kept(drive: FakeDrive, data: bytes) -> None:
        drive.objects[index, 0] = u8(max(0, data[0] - 1))

    text = error_of(boot_one_axis(FakeDrive(on_write={(index, 0): kept})))
    assert f"reads back another mapping than was written to {index:04X}h" in text


@pytest.mark.parametrize(("key", "found"), [((0x1400, 2), 254), ((0x1800, 2), 254), ((0x1016, 1), 0), ((0x1016, 2), 0)])
def test_what_is_written_after_a_reset_without_a_look_is_read_back_all_the_same(key: Key, found: int) -> None:
    before = FakeDrive().objects[key]

    def ignored(drive: FakeDrive, _: bytes) -> None:
        drive.objects[key] = before

    boot = boot_one_axis(FakeDrive(on_write={key: ignored}))
    said = (*boot.report.notes,) if boot.report else (error_of(boot),)
    assert any(f"{key[0]:04X}h:{key[1]} is {found:0{2 * len(before)}X}h" in text for text in said)


def test_a_pdo_that_does_not_come_back_on_is_an_error() -> None:
    def stays_off(drive: FakeDrive, data: bytes) -> None:
        drive.objects[0x1403, 1] = u32(int.from_bytes(data, "little") | 0x8000_0000)

    assert "1403h:1 is C0000501h" in error_of(boot_one_axis(FakeDrive(on_write={(0x1403, 1): stays_off})))


def test_entries_that_a_drive_has_stored_the_other_way_round_are_sorted_out() -> None:
    """No node may be in two entries (CiA 301, 1016h): the first write is refused until the second entry is cleared."""

    @dataclass
    class Strict(FakeDrive):
        def _write(self, key: Key, data: bytes) -> int:
            others = [self.number(0x1016, sub) >> 16 for sub in (1, 2) if key != (0x1016, sub)]
            node = int.from_bytes(data, "little") >> 16
            return 0x06040043 if key[0] == 0x1016 and node and node in others else super()._write(key, data)

    drive = Strict()
    drive.objects |= {(0x1016, 1): u32(0x007F_0064), (0x1016, 2): u32(0x007E_0064)}
    boot = boot_one_axis(drive)
    assert [drive.number(0x1016, sub) for sub in (1, 2)] == [0x007E_012C, 0x007F_012C]
    assert boot.report is not None
    assert boot.report.stops_by_itself


def test_the_quick_stop_of_the_watchdog_takes_the_last_rpdo_of_a_drive_with_few() -> None:
    """Its profile says four, and the drive has three, or two."""
    for pdos in (2, 3):
        drive = FakeDrive(objects=factory_objects(pdos=pdos))
        assert notes_of(boot_one_axis(drive)) == ()
        assert drive.number(0x1400 + pdos - 1, 1) == 0x4000_0501
        assert [drive.number(0x1600 + pdos - 1, sub) for sub in range(2)] == [1, 0x6040_0010]
        assert drive.number(0x1400, 1) == 0x4000_0201


@pytest.mark.parametrize(
    ("lacks", "text"),
    [
        ((0x1401, 0x1402, 0x1403), "it has no RPDO4 (1403h), but 1 RPDOs, 4 TPDOs"),
        ((0x1801,), "it has no TPDO2 (1801h)"),
        ((0x1801, 0x606C), "it has no TPDO2 (1801h)"),
    ],
)
def test_a_drive_with_too_few_pdos_cannot_be_used(lacks: tuple[int, ...], text: str) -> None:
    objects = {key: value for key, value in factory_objects().items() if key[0] not in lacks}
    said = error_of(boot_one_axis(FakeDrive(objects=objects)))
    assert text in said
    assert "cannot be used" in said


@pytest.mark.parametrize("only", [254, 255])
def test_of_the_event_driven_types_a_drive_may_take_one_alone(only: int) -> None:
    other = {254: 255, 255: 254}[only]
    drive, boot = bounded({(0x1403, 2): lambda value: value != other})
    assert boot.error is None, boot.error
    assert drive.number(0x1403, 2) == only


def test_a_drive_that_takes_no_event_driven_rpdo_cannot_be_used_and_is_told_no_key() -> None:
    """The watchdog's quick stop comes when nobody sends SYNCs any more."""
    _, boot = bounded({(0x1403, 2): lambda value: value <= 240})
    text = error_of(boot)
    assert "1403h:2: 0609 0030h value not valid, RPDO4 does not take type 255" in text
    assert "cannot be used" in text
    assert "pdo.synchronous" not in text


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ((0x1600, 2), "RPDO1 takes 60FFh:0 with 16 bits, and not with 32 (0604 0041h"),
        ((0x1A01, 1), "TPDO2 takes 606Ch:0 with 16 bits, and not with 32 (0604 0041h"),
        ((0x1A00, 1), "TPDO1 takes 6041h:0 with 32 bits, and not with 16 (0604 0041h"),
    ],
)
def test_an_object_that_goes_into_a_pdo_in_another_width_is_named_with_its_key(entry: Key, said: str) -> None:
    keys = {
        (0x1600, 2): "set `layout.target_bits: 16`",
        (0x1A01, 1): "set `layout.velocity_bits: 16`",
        (0x1A00, 1): "cannot be used",
    }
    wanted = {(0x1600, 2): 0x60FF_0010, (0x1A01, 1): 0x606C_0010, (0x1A00, 1): 0x6041_0020}[entry]
    _, boot = bounded({entry: lambda value: value == wanted}, abort=0x06040041)
    text = error_of(boot)
    assert said in text
    assert keys[entry] in text


def test_an_unused_pdo_that_stays_on_is_a_note() -> None:
    boot = boot_one_axis(FakeDrive(refuse={(0x1402, 1): READ_ONLY}))
    assert notes_of(boot) == ("1402h:1 is 40000401h, expected C0000401h (0601 0002h the object is read-only)",)


def test_a_pdo_that_cannot_be_switched_off_is_a_note_where_its_fixed_identifier_and_mapping_are_right() -> None:
    drive = FakeDrive(refuse={(0x1801, 1): READ_ONLY})
    mapping = {(0x1A01, 0): u8(2), (0x1A01, 1): u32(0x606C_0020), (0x1A01, 2): u32(0x6077_0010)}
    drive.objects |= {(0x1801, 1): u32(0x4000_0281)} | mapping
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


def test_a_drive_that_keeps_a_softer_quick_stop_is_refused_with_what_it_can_do() -> None:
    """The safety filter and the watchdog count with limits.emergency_deceleration_mps2."""
    drive = FakeDrive()
    drive.objects[0x6085, 0] = u32(286)
    drive.refuse[0x6085, 0] = 0x06090031
    problem = str(error_of(boot_one_axis(drive)))
    assert "6085h:0 stays at 286: left brakes with 0.15 m/s² by it" in problem
    assert "set `limits.emergency_deceleration_mps2: 0.149` in robot.yaml, where it is 1.5" in problem


@pytest.mark.parametrize("kept", [2723, 2865, 9999])
def test_a_drive_that_keeps_a_quick_stop_as_hard_or_harder_is_noted(kept: int) -> None:
    drive = FakeDrive()
    drive.objects[0x6085, 0] = u32(kept)
    drive.refuse[0x6085, 0] = 0x06090031
    boot = boot_one_axis(drive)
    assert boot.report is not None
    assert [note for note in notes_of(boot) if "6085h" in note] == (
        [] if kept == 2865 else ["6085h:0: 0609 0031h value too high"]
    )


def test_an_ordinary_ramp_that_is_softer_than_the_driver_brakes_is_refused_too() -> None:
    """In a curve a wheel brakes with 0.5 m/s² and 1.5 m/s²: both limits have to fit, by the same share."""
    drive = FakeDrive()
    drive.objects[0x6084, 0] = u32(955)
    drive.refuse[0x6084, 0] = 0x06090031
    said = str(error_of(boot_one_axis(drive)))
    assert "6084h:0 stays at 955: left brakes with 0.5 m/s² by it" in said
    assert "set `limits.deceleration_mps2: 0.125`, `limits.angular_deceleration_radps2: " in said
    assert "and `limits.emergency_deceleration_mps2: 0.5` in robot.yaml, where they are 0.5, " in said


@pytest.mark.parametrize(("kept", "boots"), [(2000, False), (2721, False), (2723, True)])
def test_a_ramp_that_is_softer_than_the_emergency_needs_is_refused_though_a_curve_needs_less(
    kept: int, boots: bool
) -> None:
    """0.5 m/s² and 0.5 rad/s² in a curve, 1.5 m/s² in an emergency: the driver shapes that ramp too."""
    base = fake_robot()
    calm = base.model_copy(update={"limits": base.limits.model_copy(update={"angular_deceleration_radps2": 0.5})})
    drive = FakeDrive()
    drive.objects[0x6084, 0] = u32(kept)
    drive.refuse[0x6084, 0] = 0x06090031
    assert (Bench(drive, calm).run().report is not None) is boots


@pytest.mark.parametrize(("kept", "boots"), [(3628, False), (3631, True), (3820, True)])
def test_an_ordinary_ramp_may_be_a_twentieth_softer_than_a_curve_needs(kept: int, boots: bool) -> None:
    drive = FakeDrive()
    drive.objects[0x6084, 0] = u32(kept)
    drive.refuse[0x6084, 0] = 0x06090031
    assert (boot_one_axis(drive).report is not None) is boots


def test_a_drive_whose_quick_stop_coasts_and_cannot_be_told_otherwise_is_refused() -> None:
    drive = FakeDrive()
    drive.objects[0x605A, 0] = u16(0)
    drive.refuse[0x605A, 0] = READ_ONLY
    problem = str(error_of(boot_one_axis(drive)))
    assert "605Ah:0 stays at 0: a quick stop lets left coast" in problem
    assert "options.quick_stop: no in its drive profile" in problem


def test_a_drive_that_keeps_another_way_to_brake_in_a_quick_stop_is_noted() -> None:
    drive = FakeDrive()
    drive.objects[0x605A, 0] = u16(6)
    drive.refuse[0x605A, 0] = READ_ONLY
    assert boot_one_axis(drive).report is not None


def test_a_drive_that_reads_back_another_mapping_is_told_what_its_pdo_needs() -> None:
    def swaps(drive: FakeDrive, _: bytes) -> None:
        drive.objects[0x1600, 1], drive.objects[0x1600, 2] = drive.objects[0x1600, 2], drive.objects[0x1600, 1]

    text = error_of(boot_one_axis(FakeDrive(on_write={(0x1600, 0): swaps})))
    assert "RPDO1 reads back another mapping than was written to 1600h" in text
    assert "Let RPDO1 carry 6040h:0, 60FFh:0 with the manufacturer's tool" in text


def test_a_sync_counter_that_stays_is_noted_with_the_key_and_the_tool() -> None:
    drive = FakeDrive(objects=factory_objects() | {(0x1019, 0): u8(10)}, refuse={(0x1019, 0): READ_ONLY})
    assert "set `bus.sync_counter: 10` in robot.yaml, or 1019h:0 to 0 with the manuf" in str(
        notes_of(boot_one_axis(drive))
    )


@pytest.mark.parametrize(
    ("lowest", "highest", "is_refused", "is_noted"),
    [
        (0, 99_999, True, False),
        (-1_000_000_000, 1_000_000_000, False, True),
        (-(2**31), 2**31 - 1, False, False),
        (0, 0, False, False),
    ],
)
def test_a_range_in_which_the_position_wraps_is_refused_where_it_is_short(
    lowest: int, highest: int, is_refused: bool, is_noted: bool
) -> None:
    ends = {(0x607B, 1): u32(lowest % 2**32), (0x607B, 2): u32(highest % 2**32)}
    boot = boot_one_axis(FakeDrive(objects=factory_objects() | ends))
    said = f"607Bh lets 6064h of left wrap between {lowest} and {highest}"
    assert (said in str(boot.error)) is is_refused
    assert (boot.report is not None and said in str(boot.report.notes)) is is_noted


class Busy(FakeDrive):
    """Its state forbids each write so often, and then allows it."""

    def __init__(self, times: int, only: Key | None = None) -> None:
        super().__init__()
        self.times, self.only = times, only
        self.refused: list[Key] = []

    def _write(self, key: Key, data: bytes) -> int:
        if self.only in (None, key) and self.refused.count(key) < self.times:
            self.refused.append(key)
            return DEVICE_STATE
        return super()._write(key, data)


@pytest.mark.parametrize("abort", [DEVICE_STATE, INVALID])
@pytest.mark.parametrize("refuses", [0x6040, 0x6840])
def test_each_axis_gets_its_quick_stop_at_once_whatever_the_other_one_answers(refuses: int, abort: int) -> None:
    """Both have power, of an earlier master."""
    drive = FakeDrive(objects=factory_objects((0, 1)), refuse={(refuses, 0): abort})
    drive.objects[0x6041, 0] = drive.objects[0x6841, 0] = u16(0x0237)
    base = fake_robot()
    bench = Bench(drive, base, base.drives)
    assert f"{refuses:04X}h" in error_of(bench.run())
    assert bench.now_s < 100.5
    (other,) = {0x6040, 0x6840} - {refuses}
    assert [value for index, _, value in drive.writes if index == other] == [0x0002]


def test_each_write_that_the_state_of_the_drive_forbids_is_tried_again() -> None:
    drive = Busy(1)
    assert notes_of(boot_one_axis(drive)) == ()
    assert len(drive.refused) == len(set(drive.refused)) > 10


def test_a_drive_that_is_busy_for_almost_two_seconds_after_its_reset_is_booted() -> None:
    """A pause takes 20 ms."""
    assert notes_of(boot_one_axis(Busy(99, (0x6060, 0)))) == ()


def test_after_two_seconds_of_pauses_a_write_is_tried_once_again_and_no_third_time() -> None:
    drive = Busy(10_000)
    assert "0800 0022h" in str(error_of(boot_one_axis(drive)))
    counts = sorted({drive.refused.count(key) for key in drive.refused})
    assert counts in ([101], [2, 101])
