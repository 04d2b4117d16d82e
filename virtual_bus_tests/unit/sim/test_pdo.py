"""PDOs of the simulated drive: remapping by the rules, transmission types, timers, wrong lengths. As bus logs."""

from __future__ import annotations

import struct

import pytest

from canbase_sim.cia301.dictionary import key
from canbase_sim.cia402.states import State
from support.sim_rig import MPS, Rig

OFF = 0x8000_0000
CONTROLWORD, TARGET, STATUS, POSITION = 0x6040_0010, 0x60FF_0020, 0x6041_0010, 0x6064_0020
VELOCITY, MODE = 0x606C_0020, 0x6060_0008


def remap(rig: Rig, comm: int, cob_id: int, objects: tuple[int, ...], kind: int, **times: int) -> None:
    """The order of CiA 301: off, no entries, entries, their number, type and times, on."""
    mapping = comm + 0x200
    assert rig.write(comm, OFF | cob_id, sub=1) == "ok"
    assert rig.write(mapping, 0) == "ok"
    for sub, value in enumerate(objects, start=1):
        assert rig.write(mapping, value, sub=sub) == "ok"
    assert rig.write(mapping, len(objects)) == "ok"
    assert rig.write(comm, kind, sub=2) == "ok"
    for name, value in times.items():
        assert rig.write(comm, value, sub={"inhibit": 3, "event": 5}[name]) == "ok"
    assert rig.write(comm, cob_id, sub=1) == "ok"


def _quiet() -> Rig:
    """Node 1 with every PDO off."""
    rig = Rig()
    for comm in (0x1400, 0x1401, 0x1402, 0x1800, 0x1801, 0x1802):
        assert rig.write(comm, rig.read(comm, 1) | OFF, sub=1) == "ok"
    return rig


def test_the_layout_of_the_driver_works_cycle_by_cycle() -> None:
    """RPDO1 6040h + 60FFh, TPDO1 6041h + 6064h, TPDO2 606Ch, all of type 1. 123456 counts = 1E240h."""
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (CONTROLWORD, TARGET), 1)
    remap(rig, 0x1800, 0x181, (STATUS, POSITION), 1)
    remap(rig, 0x1801, 0x281, (VELOCITY,), 1)
    rig.write(0x6060, 3)
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert rig.tx("080") == ["181 50 12 40 E2 01 00", "281 00 00 00 00"]  # switch on disabled, speed zero
    assert rig.tx("201 06 00 00 00 00 00") == []
    assert rig.state() is State.SWITCH_ON_DISABLED  # waits for its SYNC
    assert rig.tx("080") == ["181 50 12 40 E2 01 00", "281 00 00 00 00"]  # sampled before the setpoint acts
    assert rig.tx("080") == ["181 31 12 40 E2 01 00", "281 00 00 00 00"]  # ready to switch on
    rig.tx("201 0F 00 55 25 00 00")  # enable, 9557 raw: 1 m/s
    rig.tx("080")
    rig.wait(0.5)
    status, velocity = rig.tx("080")
    assert status.startswith("181 37 02 ")  # operation enabled, target not reached
    assert velocity == f"281 {struct.pack('<i', rig.read(0x606C)).hex(' ').upper()}"
    assert rig.read(0x606C) == pytest.approx(500, abs=20)  # 6083h is 1000 raw/s


def test_of_two_setpoints_before_one_sync_the_last_counts() -> None:
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (CONTROLWORD, TARGET), 1)
    rig.tx("000 01 01")
    for frame in ("201 00 00 01 00 00 00", "201 00 00 02 00 00 00", "080"):
        rig.tx(frame)
    assert rig.read(0x60FF) == 2


@pytest.mark.parametrize("kind", [254, 255])
def test_an_event_driven_rpdo_acts_at_once(kind: int) -> None:
    rig = _quiet()
    remap(rig, 0x1403, 0x501, (CONTROLWORD,), kind)
    rig.tx("000 01 01")
    rig.tx("501 06 00")
    assert rig.state() is State.READY_TO_SWITCH_ON


@pytest.mark.parametrize(
    ("index", "sub", "value", "code"),
    [
        (0x1400, 1, 0x202, "06090030"),  # another id while the PDO is on
        (0x1600, 0, 0, "06010000"),  # mapping while the PDO is on
        (0x1600, 1, CONTROLWORD, "06010000"),
        (0x1400, 2, 241, "06090030"),  # types that nobody uses
        (0x1400, 2, 253, "06090030"),
        (0x1400, 1, 0x2000_0201, "06090030"),  # 29-bit identifier
        (0x1400, 1, 0x0000_0A01, "06090030"),  # bits above 10
        (0x1800, 3, 100, "06090030"),  # inhibit time while the PDO is on
        (0x1403, 1, 0x501, "06090030"),  # nothing is mapped
        (0x1603, 1, 0x6041_0010, "06040041"),  # an RPDO cannot write the statusword
        (0x1603, 1, 0x6040_0008, "06040041"),  # wrong length
        (0x1603, 1, 0x605A_0010, "06040041"),  # not mappable
        (0x1603, 1, 0x2000_0010, "06040041"),  # no such object
        (0x1A03, 1, 0x0005_0008, "06040041"),  # dummies are for RPDOs
        (0x1A03, 0, 9, "06090031"),  # more than eight entries
    ],
)
def test_refusals(index: int, sub: int, value: int, code: str) -> None:
    assert Rig().write(index, value, sub=sub) == code


@pytest.mark.parametrize(
    ("cob_ids", "answer"),
    [
        (
            (0x000, 0x001, 0x07F, 0x101, 0x180, 0x581, 0x601, 0x67F, 0x6E0, 0x701, 0x780, 0x7E3, 0x7E6, 0x7FF),
            "06090030",
        ),
        ((0x080, 0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700), "ok"),
    ],
)
def test_restricted_identifiers_alone_are_refused(cob_ids: tuple[int, ...], answer: str) -> None:
    """CiA 301, 7.3.5."""
    for cob_id in cob_ids:
        rig = Rig()
        rig.write(0x1400, OFF | 0x201, sub=1)
        assert rig.write(0x1400, cob_id, sub=1) == answer, f"{cob_id:03X}h"


def test_entries_change_only_while_sub_0_is_0() -> None:
    rig = _quiet()
    assert rig.write(0x1600, TARGET, sub=2) == "06010000"
    assert rig.write(0x1600, 0) == "ok"
    assert rig.write(0x1600, TARGET, sub=2) == "ok"


def test_more_than_eight_bytes_are_refused() -> None:
    rig = _quiet()
    rig.write(0x1A00, 0)
    for sub, value in enumerate((POSITION, VELOCITY, STATUS), start=1):
        assert rig.write(0x1A00, value, sub=sub) == "ok"
    assert rig.write(0x1A00, 3) == "06040042"
    assert rig.write(0x1A00, 2) == "ok"


def test_in_operational_a_pdo_may_only_be_switched_off() -> None:
    rig = _quiet()
    remap(rig, 0x1403, 0x501, (CONTROLWORD,), 255)
    remap(rig, 0x1800, 0x181, (STATUS,), 1)
    rig.tx("000 01 01")
    assert rig.write(0x1403, 1, sub=2) == "08000022"
    assert rig.write(0x1603, 0) == "08000022"
    assert rig.tx("080") == ["181 50 02"]
    assert rig.write(0x1403, OFF | 0x501, sub=1) == "ok"
    assert rig.write(0x1800, OFF | 0x181, sub=1) == "ok"
    assert rig.write(0x1403, 0x501, sub=1) == "08000022"
    rig.tx("501 06 00")
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert rig.tx("080") == []


def test_dummy_entries_skip_bytes() -> None:
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (0x0005_0008, 0x0004_0020, CONTROLWORD), 255)
    rig.tx("000 01 01")
    rig.tx("201 FF FF FF FF FF 06 00")
    assert rig.state() is State.READY_TO_SWITCH_ON


def test_a_value_that_the_object_refuses_is_dropped() -> None:
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (MODE, CONTROLWORD), 255)
    rig.tx("000 01 01")
    rig.tx("201 01 06 00")  # mode 1 is not there; the controlword counts nevertheless
    assert rig.read(0x6060) == 0
    assert rig.state() is State.READY_TO_SWITCH_ON


def test_a_short_rpdo_is_dropped_and_a_long_one_counts_by_its_first_bytes() -> None:
    rig = _quiet()
    remap(rig, 0x1403, 0x501, (CONTROLWORD,), 255)
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert rig.tx("501 06") == ["081 10 82 11 04 00 00 00 00"]
    assert rig.tx("501") == []  # told once
    assert rig.state() is State.SWITCH_ON_DISABLED
    assert rig.tx("501 06 00 00") == ["081 20 82 11 04 00 00 00 00"]
    assert rig.state() is State.READY_TO_SWITCH_ON
    assert rig.tx("501 06 00") == ["081 00 00 11 04 00 00 00 00", "081 00 00 00 04 00 00 00 00"]


def test_rpdos_count_in_operational_only() -> None:
    rig = Rig()
    for state in ("80", "02"):
        rig.tx(f"000 {state} 01")
        rig.tx("201 06 00")
        assert rig.state() is State.SWITCH_ON_DISABLED


def test_the_deadline_of_an_rpdo_starts_with_the_first_one() -> None:
    """
    event timer : 50 ms
    RPDO        : ------R--R-------R
    EMCY 8250h  : .............!...0       and the axis faults, by 6007h = 1
    """
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (CONTROLWORD,), 1, event=50)
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert rig.wait(1.0) == []
    rig.tx("201 00 00")
    rig.wait(0.04)
    rig.tx("201 00 00")
    rig.heard.clear()
    start = rig.now_s
    assert rig.wait(0.5) == ["081 50 82 11 01 00 00 00 00"]
    assert rig.heard[0][0] - start == pytest.approx(0.05, abs=0.002)
    assert rig.state() is State.FAULT
    assert rig.tx("201 00 00") == ["081 00 00 00 01 00 00 00 00"]


def test_leaving_operational_ends_the_deadline() -> None:
    rig = _quiet()
    remap(rig, 0x1400, 0x201, (CONTROLWORD,), 1, event=50)
    rig.tx("000 01 01")
    rig.tx("201 00 00")
    rig.tx("000 80 01")
    assert rig.wait(0.5) == []


def test_type_3_is_sent_on_every_third_sync() -> None:
    rig = _quiet()
    remap(rig, 0x1800, 0x181, (STATUS,), 3)
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert [len(rig.tx("080")) for _ in range(7)] == [0, 0, 1, 0, 0, 1, 0]


def test_type_0_is_sent_on_the_sync_after_a_change() -> None:
    rig = _quiet()
    remap(rig, 0x1800, 0x181, (STATUS,), 0)
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert [len(rig.tx("080")) for _ in range(3)] == [1, 0, 0]
    rig.write(0x6040, 0x06)
    assert [len(rig.tx("080")) for _ in range(3)] == [1, 0, 0]


def test_an_event_driven_tpdo_is_sent_on_entering_operational_and_on_change() -> None:
    rig = Rig()  # defaults: TPDO1 statusword, TPDO2 statusword and mode, both of type 255
    assert rig.tx("000 01 01") == ["181 50 02", "281 50 02 00"]
    assert rig.wait(0.5) == []
    rig.tx("601 2B 40 60 00 06 00 00 00")
    assert [text for _, text in rig.heard[-3:]] == ["581 60 40 60 00 00 00 00 00", "181 31 02", "281 31 02 00"]


def test_the_inhibit_time_limits_the_rate_and_the_event_timer_repeats() -> None:
    """The position of a moving wheel: at most every 20 ms (200 × 100 µs). The mode: every 100 ms without a change."""
    rig = _quiet()
    remap(rig, 0x1800, 0x181, (POSITION,), 255, inhibit=200)
    remap(rig, 0x1801, 0x281, (MODE + 0x1_0000,), 255, event=100)
    rig.drive(MPS // 2, MPS // 2, 1.0)
    rig.tx("000 01 01")
    said = rig.wait(1.0)
    assert 45 <= sum(text.startswith("181") for text in said) <= 51
    assert 9 <= sum(text.startswith("281") for text in said) <= 11


def test_a_node_that_is_started_in_the_middle_of_a_mapping_has_that_pdo_off() -> None:
    """1600h and 1A00h count an entry that was never written; the drive says nothing with them, and goes on."""
    rig = _quiet()
    for comm, cob_id in ((0x1400, 0x201), (0x1800, 0x181)):
        node = rig.node.dictionary.values
        node[key(comm + 0x200, 0)], node[key(comm + 0x200, 1)], node[key(comm, 1)] = 1, 0, cob_id
    rig.tx("000 01 01")
    rig.wait(0.01)
    assert rig.tx("201 0F 00 55 25 00 00") == []
    assert rig.tx("080") == []
