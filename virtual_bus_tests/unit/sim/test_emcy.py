"""EMCY, 1001h and 1003h of the simulated drive, as bus logs."""

from __future__ import annotations

from support.sim_rig import Rig


def test_a_fault_is_told_with_its_code_and_the_error_register() -> None:
    rig = Rig()
    rig.node.fail(0, 0x2310)
    assert rig.wait(0.001) == ["081 10 23 03 00 00 00 00 00"]  # over-current: generic and current
    assert rig.read(0x1001) == 0x03
    assert rig.read(0x603F) == 0x2310


def test_the_reset_is_told_with_code_0() -> None:
    rig = Rig()
    rig.node.fail(0, 0x4210)
    rig.wait(0.001)
    said = rig.tx("601 2B 40 60 00 80 00 00 00")
    assert said == ["081 00 00 00 00 00 00 00 00", "581 60 40 60 00 00 00 00 00"]
    assert rig.read(0x1001) == 0


def test_a_second_fault_of_another_code_is_told_and_both_are_reset() -> None:
    rig = Rig()
    rig.node.fail(0, 0x2310)
    rig.node.fail(0, 0x4210)
    rig.node.fail(0, 0x4210)
    assert rig.wait(0.001) == ["081 10 23 03 00 00 00 00 00", "081 10 42 0B 00 00 00 00 00"]
    rig.write(0x6040, 0x80)
    assert rig.read(0x1001) == 0


def test_history_has_the_newest_first_and_at_most_eight() -> None:
    rig = Rig()
    for code in range(0x2001, 0x200B):
        rig.node.fail(0, code)
    assert rig.read(0x1003) == 8
    assert [rig.read(0x1003, sub) for sub in (1, 2, 8)] == [0x200A, 0x2009, 0x2003]
    assert rig.write(0x1003, 1) == "06090030"
    assert rig.write(0x1003, 0) == "ok"
    assert [rig.read(0x1003, sub) for sub in range(9)] == [0] * 9


def test_bit_31_of_1014_silences_the_emcy() -> None:
    rig = Rig()
    rig.write(0x1014, 0x8000_0081)
    rig.node.fail(0, 0x2310)
    assert rig.wait(0.001) == []


def test_a_sync_with_data_is_told_once_until_a_good_one() -> None:
    rig = Rig()
    rig.tx("000 02 02")  # let node 1 speak alone
    assert rig.tx("080 01") == ["081 40 82 11 00 00 00 00 00"]
    assert rig.tx("080 02") == []
    assert rig.tx("080") == ["081 00 00 00 00 00 00 00 00"]
