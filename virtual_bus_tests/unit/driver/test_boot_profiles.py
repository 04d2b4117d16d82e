"""What the profile of a drive changes in its boot: where things are, what is not tried, what is written besides."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from canbase_config.drive import Drive
from canbase_config.profile_file import load_profile
from canbase_config.robot import Robot
from canbase_driver.boot.node_boot import NodeBoot
from canbase_driver.cia301.frame import Frame
from support.fake_drive import Bench, FakeDrive, Key, error_of, factory_objects, notes_of, robot, u8, u16, u32


def of_kind(profile: str, **keys: Any) -> Robot:
    """The robot of the boot tests with other drives."""
    values = robot().model_dump()
    apart = {"node_id": 2, "axis": 0} if load_profile(profile).layout.axes == 1 else {}
    values["drives"] = [drive | {"profile": profile} | keys for drive in values["drives"]]
    values["drives"][1] |= apart
    return Robot.model_validate(values)


def booted(drive: FakeDrive, base: Robot, seconds: float = 30.0) -> tuple[NodeBoot, Bench]:
    drives = tuple(drive for drive in base.drives if drive.node_id == 1)
    bench = Bench(drive, base, drives)
    return bench.run(seconds), bench


def hub_motors() -> dict[Key, bytes]:
    """A ZLAC8015D: arrays, one controlword, a statusword of 32 bits, its own watchdog, nothing optional."""
    objects = factory_objects()
    gone = (0x1016, 0x1029, 0x6007, 0x605A, 0x605E, 0x606C, 0x6083, 0x6084, 0x6085, 0x60FF)
    objects = {key: value for key, value in objects.items() if key[0] not in gone}
    arrays = (0x606C, 0x6083, 0x6084, 0x6085, 0x60FF)
    objects |= {(index, sub): u32(5) for index in arrays for sub in (1, 2)}
    objects |= {(0x606C, sub): u32(0) for sub in (1, 2)}
    return objects | {(0x6041, 0): u32(0x0240_0240), (0x6061, 0): u8(3), (0x2000, 0): u16(0), (0x200F, 0): u16(1)}


def test_two_hub_motors_on_one_controlword() -> None:
    drive = FakeDrive(objects=hub_motors())
    boot, _ = booted(drive, of_kind("zlac8015d"))
    assert notes_of(boot) == (
        "1016h: the drive monitors no heartbeat, and none stops it; where it has node guarding, set "
        "`self_stop.node_guarding: true` in its drive profile",
        "2000h:0: communication offline time is set, but not proven to stop the motor: canbase setup "
        "commission proves it",
    )
    assert boot.report is not None
    assert not boot.report.stops_by_itself
    assert [drive.number(0x1600, sub) for sub in range(3)] == [2, 0x6040_0010, 0x60FF_0120]
    assert [drive.number(0x1601, sub) for sub in range(3)] == [2, 0x6040_0010, 0x60FF_0220]
    assert [drive.number(0x1603, sub) for sub in range(2)] == [1, 0x6040_0010]
    assert [drive.number(0x1A02, sub) for sub in range(3)] == [2, 0x6041_0020, 0x6064_0220]
    assert [drive.number(0x1A03, sub) for sub in range(2)] == [1, 0x606C_0220]
    assert (drive.number(0x2000), drive.number(0x200F)) == (300, 0)
    # 1.5 m/s² at the rim are 47.7 rev/s² of the motor: 1000 rpm in 349 ms
    assert (drive.number(0x6083, 1), drive.number(0x6085, 2)) == (349, 349)
    assert (drive.number(0x60FF, 1), drive.number(0x60FF, 2)) == (0, 0)


def test_the_right_hub_motor_that_runs_is_seen_in_the_upper_half() -> None:
    drive = FakeDrive(objects=hub_motors() | {(0x6041, 0): u32(0x0237_0240)})
    quick_stops: list[int] = []
    drive.on_write[0x6040, 0] = lambda drive, data: quick_stops.append(data[0])
    _, bench = booted(drive, of_kind("zlac8015d"), seconds=0.05)
    assert quick_stops == [0x02]
    assert "to stop after a quick stop" in bench.boot.waiting_for


def test_what_the_profile_denies_is_not_asked_for() -> None:
    drive = FakeDrive(objects=factory_objects(axes=(0, 1)))
    asked: list[int] = []
    serve = drive.on_frame

    def listening(frame: Frame) -> list[Frame]:
        asked.append(int.from_bytes(frame.data[1:3], "little"))
        return serve(frame)

    drive.on_frame = listening  # type: ignore[method-assign]
    boot, _ = booted(drive, of_kind("roboteq"))
    assert boot.report is not None
    assert {0x6007, 0x6807, 0x1029, 0x605A, 0x605E}.isdisjoint(asked)
    assert 0x6083 in asked


def test_drives_without_sync_send_by_their_timer_and_act_at_once() -> None:
    objects = factory_objects(axes=(0, 1))
    objects |= {(0x1800 + i, sub): u16(0) for i in range(4) for sub in (3, 5)}
    drive = FakeDrive(objects=objects)
    boot, _ = booted(drive, of_kind("roboteq"))
    assert boot.report is not None
    assert [drive.number(index, 2) for index in (0x1400, 0x1401, 0x1800, 0x1803)] == [255] * 4
    assert (drive.number(0x1800, 3), drive.number(0x1800, 5)) == (100, 10)  # 10 ms in 0.1 ms and in ms
    assert (drive.number(0x6083), drive.number(0x6883)) == (28648, 28648)  # 1.5 m/s² in 0.1 rpm/s


def test_an_rpdo_timer_is_set_where_it_exists() -> None:
    objects = factory_objects() | {(0x1400 + i, 5): u16(0) for i in range(4)}
    drive = FakeDrive(objects=objects)
    boot, _ = booted(drive, of_kind("dryve_d1", velocity_unit="0.001rev/s"))
    assert boot.report is not None
    assert (drive.number(0x1400, 5), drive.number(0x1403, 5)) == (300, 0)
    assert not boot.report.stops_by_itself  # without 6007h nothing says what it does then


def test_another_value_of_6007h_and_none_while_the_reset_lasts() -> None:
    drive = FakeDrive()
    boot, _ = booted(drive, of_kind("kinco"))
    assert boot.report is not None
    assert [value for index, _, value in drive.writes if index == 0x6007] == [1]  # it was 0
    drive.writes = []
    booted(drive, of_kind("kinco"))
    assert [value for index, _, value in drive.writes if index == 0x6007] == [0, 1]


def test_mode_9_has_its_period_in_60c2h() -> None:
    drive = FakeDrive(objects=factory_objects() | {(0x60C2, 1): u8(1), (0x60C2, 2): u8(0xFE), (0x6061, 0): u8(9)})
    boot, _ = booted(drive, of_kind("epos4", mode=9))
    assert notes_of(boot) == ()
    assert (drive.number(0x6060), drive.number(0x60C2, 1), drive.number(0x60C2, 2)) == (9, 10, 0xFD)


def inverter(**pairs: int) -> FakeDrive:
    """A drive of mode 2 alone. `pairs`: `min`, `max`, `numerator`, `seconds` after power on."""
    gone = (0x606C, 0x6083, 0x6084, 0x6085, 0x60FF)
    objects = {key: value for key, value in factory_objects().items() if key[0] not in gone}
    objects |= {(0x6042, 0): u16(7), (0x6044, 0): u16(0), (0x6046, 1): u32(pairs.get("min", 30))}
    objects |= {(0x6046, 2): u32(pairs.get("max", 1500)), (0x604C, 2): u32(1)}
    objects |= {(0x604C, 1): u32(pairs.get("numerator", 10))}
    ramps = (0x6048, 0x6049, 0x604A)
    objects |= {(index, 1): u32(100) for index in ramps} | {(index, 2): u16(pairs.get("seconds", 5)) for index in ramps}
    return FakeDrive(objects=objects)


def test_mode_2_has_its_own_target_ramps_limits_and_unit() -> None:
    drive = inverter()
    boot, _ = booted(drive, of_kind("inverter"))
    assert boot.report is not None
    assert [drive.number(0x1600, sub) for sub in range(3)] == [2, 0x6040_0010, 0x6042_0010]
    assert [drive.number(0x1A01, sub) for sub in range(3)] == [2, 0x6044_0010, 0x6077_0010]
    assert (drive.number(0x6060), drive.number(0x6042), drive.number(0x6046, 1)) == (2, 0, 0)
    assert (drive.number(0x604C, 1), drive.number(0x604C, 2)) == (1, 1)
    # 1.5 m/s² at the rim are 47.7 rev/s² of the motor, 2865 rpm in 1 s; in a curve a wheel brakes with 2 m/s²
    assert [drive.number(index, sub) for index in (0x6049, 0x604A) for sub in (1, 2)] == [3820, 1, 2865, 1]
    assert not [index for index, _, _ in drive.writes if index in (0x60FF, 0x6083, 0x6084, 0x6085)]


@pytest.mark.parametrize("torque", ["probe", "none"])
def test_an_inverter_with_one_tpdo_sends_its_velocity_behind_the_position(torque: str, tmp_path: Path) -> None:
    drive = inverter()
    drive.objects = {key: value for key, value in drive.objects.items() if key[0] not in range(0x1801, 0x1804)}
    keys = load_profile("inverter").model_dump(mode="json", exclude_unset=True) | {"options": {"torque": torque}}
    (tmp_path / "own.yaml").write_text(json.dumps(keys, indent=1))
    boot, _ = booted(drive, of_kind(str(tmp_path / "own.yaml")))
    assert boot.report is not None
    assert [drive.number(0x1A00, sub) for sub in range(4)] == [3, 0x6041_0010, 0x6064_0020, 0x6044_0010]
    assert drive.number(0x1800, 1) & 0x7FF == 0x181
    said = any("torque unknown: one TPDO for each motor has no room for it" in note for note in boot.report.notes)
    assert said == (torque == "probe")


def test_a_tpdo_that_an_inverter_refuses_to_show_may_be_there_and_on() -> None:
    """A refusal of this moment is no proof that it has one TPDO alone."""
    drive = inverter()
    drive.refuse_read[0x1801, 1] = 0x0800_0000
    boot, _ = booted(drive, of_kind("inverter"))
    assert boot.report is None
    assert "It does not say that 1801h does not exist: reset it." in str(boot.error)
    assert "set `pdo.tpdos: 1` in its drive profile" in str(boot.error)


@pytest.mark.parametrize(
    ("size", "cure"),
    [
        (2, "606Ch has 16 bits, and one TPDO is enough for such a drive: set `layout.velocity_bits: 16` in its drive"),
        (4, "(one, where its velocity has 16 bits: `layout.velocity_bits`)"),
    ],
)
def test_a_drive_with_one_tpdo_is_told_from_one_whose_velocity_is_narrower_than_its_profile(
    size: int, cure: str
) -> None:
    objects = {key: value for key, value in factory_objects().items() if key[0] not in range(0x1801, 0x1804)}
    boot, _ = booted(FakeDrive(objects=objects | {(0x606C, 0): bytes(size)}), of_kind("nanotec", velocity_unit="rpm"))
    assert boot.error is not None
    assert "it has no TPDO2 (1801h), but 4 RPDOs, 1 TPDOs" in str(boot.error)
    assert cure in str(boot.error)


def test_a_ramp_of_mode_2_whose_time_is_fixed_gets_the_speed_for_that_time() -> None:
    drive = inverter(seconds=5)
    drive.refuse |= {(index, 2): 0x0601_0002 for index in (0x6048, 0x6049, 0x604A)}
    boot, _ = booted(drive, of_kind("inverter"))
    assert boot.report is not None
    assert (drive.number(0x604A, 1), drive.number(0x604A, 2)) == (14324, 5)


@pytest.mark.parametrize(
    ("refused", "pairs", "told"),
    [
        ((0x604A, 1), {}, "604Ah stays at 100 in 1 s: left brakes with 0.0524 m/s² by it"),
        ((0x6046, 1), {}, "6046h:1 stays at 30: left turns at 0.0157 m/s where less is ordered"),
        ((0x6046, 2), {"max": 900}, "6046h:2 stays at 900: left turns at 0.471 m/s at most"),
        ((0x604C, 1), {}, "604Ch:1 stays at 10: one bit of 6042h is not 1 rpm"),
    ],
)
def test_a_drive_of_mode_2_that_would_turn_or_brake_otherwise_than_ordered_is_refused(
    refused: Key, pairs: dict[str, int], told: str
) -> None:
    drive = inverter(**pairs)
    drive.refuse[refused] = 0x0601_0002
    boot, _ = booted(drive, of_kind("inverter"))
    assert told in str(error_of(boot))


def test_a_mode_that_is_not_taken_is_told() -> None:
    drive = FakeDrive(objects=factory_objects() | {(0x6061, 0): u8(0)})
    boot, _ = booted(drive, of_kind("epos4"))
    assert boot.report is not None
    assert boot.report.unshown_mode in notes_of(boot)
    assert boot.report.unshown_mode == (
        "6061h:0 shows mode 0, 3 was set 6 s ago: look what else sets it, the manufacturer's tool or an input"
    )


@pytest.mark.parametrize(("shows", "waits"), [("yes", True), ("probe", False)])
def test_a_mode_that_is_shown_late_is_waited_for_where_the_profile_says_that_it_is_shown(
    shows: str, waits: bool, tmp_path: Path
) -> None:
    profile = tmp_path / "late.yaml"
    profile.write_text(f"title: late\noptions: {{mode_display: {shows}}}\n")
    drive = FakeDrive(objects=factory_objects() | {(0x6061, 0): u8(0)})
    base = of_kind(str(profile))
    bench = Bench(drive, base, base.drives[:1])
    bench.run(3.0)
    assert bench.boot.done is not waits
    assert (
        "it may take power to change, or time: with `options.mode_display: yes`" in str(bench.boot.report)
    ) is not waits
    drive.objects[0x6061, 0] = u8(3)
    assert ("6061h" in str(notes_of(bench.run(1.0)))) is not waits


def test_a_drive_that_shows_its_mode_with_power_alone_is_not_asked() -> None:
    drive = FakeDrive(objects=factory_objects() | {(0x6061, 0): u8(0)})
    assert "6061h" not in str(notes_of(booted(drive, of_kind("kinco"))[0]))


def test_a_second_boot_up_message_is_waited_for() -> None:
    """Boot loader, then firmware 0.4 s later."""
    drive = FakeDrive()
    base = of_kind("nanotec", velocity_unit="rpm")
    bench = Bench(drive, base, base.drives[:1])
    bench.run(seconds=0.4)
    assert bench.boot.waiting_for.endswith("no further boot-up message")
    bench.boot.on_frame(Frame(0x701, b"\0"), bench.now_s)
    bench.run(seconds=0.4)
    assert bench.boot.waiting_for.endswith("no further boot-up message")
    assert bench.run(seconds=0.2).report is not None


def test_a_drive_that_is_switched_on_late_is_asked_again_at_once() -> None:
    drive = FakeDrive(powered=False)
    bench = Bench(drive, robot())
    bench.run(seconds=0.05)
    drive.powered = True
    bench.boot.on_frame(Frame(0x701, b"\0"), bench.now_s)
    assert bench.run(seconds=0.02).report is not None


def test_sdo_timeouts_are_those_of_the_profile(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = load_profile("epos4").model_copy(
        update={"sdo": load_profile("epos4").sdo.model_copy(update={"timeout_s": 2.0, "attempts": 1})}
    )
    base = of_kind("epos4")
    monkeypatch.setattr(Drive, "kind", slow)
    drive = FakeDrive(on_write={(0x6060, 0): lambda drive, _: setattr(drive, "powered", False)})
    boot, bench = booted(drive, base)
    assert "6061h:0: no answer to 1 requests, 2 s each" in error_of(boot)
    assert bench.now_s == pytest.approx(102.0, abs=0.03)


def test_requests_keep_the_distance_that_the_profile_wants(monkeypatch: pytest.MonkeyPatch) -> None:
    generic = load_profile("generic")
    slow = generic.model_copy(update={"sdo": generic.sdo.model_copy(update={"gap_s": 0.009})})
    monkeypatch.setattr(Drive, "kind", slow)
    drive = FakeDrive(objects=factory_objects(axes=(0, 1)))
    boot, bench = booted(drive, robot())
    assert boot.report is not None
    assert bench.now_s - 100.0 == pytest.approx(0.01 * drive.transfers, rel=0.05)


def test_another_firmware_is_refused() -> None:
    drive = FakeDrive(objects=factory_objects(axes=(0, 1)) | {(0x100A, 0): b"2.1a"})
    base = of_kind("generic", identity={"software": "2.0"})
    assert '100Ah:0 (software) is "2.1a", expected "2.0"' in error_of(booted(drive, base)[0])
    right, _ = booted(drive, of_kind("generic", identity={"software": "2.1a"}))
    assert right.report is not None
    assert right.report.identity.software == "2.1a"


def test_a_sync_counter_is_set_or_refused() -> None:
    values = robot().model_dump()
    values["bus"]["sync_counter"] = 200
    values["drives"] = [drive | {"profile": "roboteq"} for drive in values["drives"]]
    with pytest.raises(ValueError, match="knows no counter in SYNC"):
        Robot.model_validate(values)
