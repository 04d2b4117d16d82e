"""The SDO server of the simulated drive, as bus logs: expedited, segmented, and every refusal with its abort code."""

from __future__ import annotations

import pytest

from support.sim_rig import Rig


def test_expedited_upload_and_download() -> None:
    rig = Rig()
    assert rig.tx("601 40 00 10 00 00 00 00 00") == ["581 43 00 10 00 92 01 02 00"]  # 1000h: 20192h, CiA 402 servo
    assert rig.tx("601 2B 5A 60 00 06 00 00 00") == ["581 60 5A 60 00 00 00 00 00"]  # 605Ah = 6
    assert rig.tx("601 40 5A 60 00 00 00 00 00") == ["581 4B 5A 60 00 06 00 00 00"]
    assert rig.tx("601 40 29 10 00 00 00 00 00") == ["581 4F 29 10 00 01 00 00 00"]  # one byte: 1029h:0


def test_segmented_upload_of_the_device_name() -> None:
    rig = Rig()
    assert rig.tx("601 40 08 10 00 00 00 00 00") == ["581 41 08 10 00 17 00 00 00"]  # 1008h: 23 bytes
    name, toggle = b"", 0x00
    for _ in range(4):
        (answer,) = rig.tx(f"601 {0x60 | toggle:02X} 00 00 00 00 00 00 00")
        raw = bytes.fromhex(answer[4:])
        assert raw[0] & 0x10 == toggle
        name += raw[1 : 8 - (raw[0] >> 1 & 0x07)]
        toggle ^= 0x10
    assert raw[0] & 0x01  # the last segment says so
    assert name == b"canbase simulated drive"


def test_segmented_download_of_four_bytes() -> None:
    rig = Rig()
    assert rig.tx("601 21 83 60 00 04 00 00 00") == ["581 60 83 60 00 00 00 00 00"]
    assert rig.tx("601 07 10 27 00 00 00 00 00") == ["581 20 00 00 00 00 00 00 00"]  # 4 bytes, last segment
    assert rig.read(0x6083) == 10_000


@pytest.mark.parametrize(
    ("request_", "code", "why"),
    [
        ("40 00 20 00 00 00 00 00", "00 00 02 06", "0602 0000h: no object 2000h"),
        ("40 41 68 00 00 00 00 00", "00 00 02 06", "0602 0000h: no second axis on this node"),
        ("40 18 10 09 00 00 00 00", "11 00 09 06", "0609 0011h: no 1018h:9"),
        ("2B 41 60 00 00 00 00 00", "02 00 01 06", "0601 0002h: the statusword is read-only"),
        ("2F 40 60 00 06 00 00 00", "10 00 07 06", "0607 0010h: the controlword has two bytes"),
        ("23 40 60 00 06 00 00 00", "10 00 07 06", "0607 0010h"),
        ("2B 5A 60 00 09 00 00 00", "31 00 09 06", "0609 0031h: 605Ah above 8"),
        ("2B 5A 60 00 FF FF 00 00", "32 00 09 06", "0609 0032h: 605Ah below 0"),
        ("23 84 60 00 00 00 00 00", "32 00 09 06", "0609 0032h: a ramp of 0 never ends"),
        ("2F 60 60 00 01 00 00 00", "30 00 09 06", "0609 0030h: no mode 1"),
        ("2F 03 10 00 01 00 00 00", "30 00 09 06", "0609 0030h: 1003h:0 takes 0 alone"),
        ("23 10 10 01 73 61 76 64", "20 00 00 08", "0800 0020h: not the signature 'save'"),
        ("C6 00 10 00 00 00 00 00", "01 00 04 05", "0504 0001h: no block download"),
        ("E0 00 00 00 00 00 00 00", "01 00 04 05", "0504 0001h: no such command"),
    ],
)
def test_refusals(request_: str, code: str, why: str) -> None:
    (answer,) = Rig().tx(f"601 {request_}")
    assert answer.startswith("581 80 "), why
    assert answer.endswith(code), why


def test_a_wrong_toggle_aborts() -> None:
    rig = Rig()
    rig.tx("601 40 08 10 00 00 00 00 00")
    assert rig.tx("601 70 00 00 00 00 00 00 00") == ["581 80 08 10 00 00 00 03 05"]


@pytest.mark.parametrize("length", [0, 1, 4, 7])
def test_an_sdo_frame_without_eight_bytes_is_dropped_and_counted(length: int) -> None:
    rig = Rig()
    assert rig.tx("601 " + "40 " * length) == []
    assert rig.node.sdo.malformed == 1


def test_an_abort_of_the_client_is_not_answered() -> None:
    assert Rig().tx("601 80 08 10 00 00 00 04 05") == []


def test_nothing_is_answered_for_another_node_or_in_stopped() -> None:
    rig = Rig()
    assert rig.tx("603 40 00 10 00 00 00 00 00") == []
    rig.tx("000 02 01")
    assert rig.tx("601 40 00 10 00 00 00 00 00") == []


def test_save_keeps_parameters_over_a_reset_and_load_gives_the_defaults_back() -> None:
    rig = Rig()
    rig.write(0x6084, 777)
    rig.write(0x60FF, 5)
    assert rig.tx("601 23 10 10 01 73 61 76 65") == ["581 60 10 10 01 00 00 00 00"]
    rig.write(0x6084, 888)
    rig.tx("000 81 01")
    rig.wait(0.2)
    assert rig.read(0x6084) == 777
    assert rig.read(0x60FF) == 0  # targets are never kept
    assert rig.tx("601 23 11 10 01 6C 6F 61 64") == ["581 60 11 10 01 00 00 00 00"]
    assert rig.read(0x6084) == 777  # counts from the next reset
    rig.tx("000 81 01")
    rig.wait(0.2)
    assert rig.read(0x6084) == 1000
