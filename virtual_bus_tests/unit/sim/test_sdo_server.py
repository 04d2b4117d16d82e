"""The SDO server of the simulated drive, as bus logs: expedited, segmented, and every refusal with its abort code."""

from __future__ import annotations

import pytest
from canopen import ObjectDictionary
from canopen.sdo.client import SdoClient

from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.sdo_block import checksum
from canbase_sim.cia301.sdo_server import SdoService
from support.sim_rig import Rig, robot


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
        ("A4 08 10 00 80 00 00 00", "02 00 04 05", "0504 0002h: a block has 127 segments at most"),
        ("C6 05 65 00 01 00 01 00", "05 00 04 05", "0504 0005h: a block download of 65537 bytes"),
        ("E0 00 00 00 00 00 00 00", "01 00 04 05", "0504 0001h: no such command"),
    ],
)
def test_refusals(request_: str, code: str, why: str) -> None:
    (answer,) = Rig().tx(f"601 {request_}")
    assert answer.startswith("581 80 "), why
    assert answer.endswith(code), why


def test_a_block_upload_of_the_device_name_in_blocks_of_three_segments() -> None:
    rig = Rig()
    assert rig.tx("601 A4 08 10 00 03 00 00 00") == ["581 C6 08 10 00 17 00 00 00"]
    block = rig.tx("601 A3 00 00 00 00 00 00 00")
    assert [text[:6] for text in block] == ["581 01", "581 02", "581 03"]
    again = rig.tx("601 A2 02 03 00 00 00 00 00")  # the third one was lost
    assert again[0] == block[2].replace("581 03", "581 01")
    assert again[1].startswith("581 82 ")  # the last one
    (end,) = rig.tx("601 A2 02 03 00 00 00 00 00")
    assert end.startswith("581 D5 ")  # 5 bytes of the last segment are unused; the checksum
    assert rig.tx("601 A1 00 00 00 00 00 00 00") == []
    assert rig.tx("601 40 00 10 00 00 00 00 00") == ["581 43 00 10 00 92 01 02 00"]  # the channel is free again


def test_a_block_download_whose_checksum_is_wrong_changes_nothing() -> None:
    rig = Rig()
    assert rig.tx("601 C6 05 65 00 09 00 00 00") == ["581 A4 05 65 00 20 00 00 00"]
    assert rig.tx("601 01 61 62 63 64 65 66 67") == []
    assert rig.tx("601 82 68 69 00 00 00 00 00") == ["581 A2 02 20 00 00 00 00 00"]
    assert rig.tx("601 D5 00 00 00 00 00 00 00") == ["581 80 05 65 00 04 00 04 05"]  # a wrong checksum: not taken
    assert rig.tx("601 40 05 65 00 00 00 00 00") == ["581 41 05 65 00 2C 00 00 00"]


def test_a_text_that_was_written_is_kept_by_1010h_like_a_number() -> None:
    rig = Rig()
    rig.tx("601 C6 05 65 00 05 00 00 00")
    assert rig.tx("601 81 48 65 6C 6C 6F 00 00") == ["581 A2 01 20 00 00 00 00 00"]
    checked = checksum(b"Hello").to_bytes(2, "little").hex(" ").upper()
    assert rig.tx(f"601 C9 {checked} 00 00 00 00 00") == ["581 A1 00 00 00 00 00 00 00"]
    rig.tx("601 23 10 10 01 73 61 76 65")
    rig.tx("000 81 01")
    rig.wait(0.2)
    assert rig.tx("601 40 05 65 00 00 00 00 00") == ["581 41 05 65 00 05 00 00 00"]
    rig.tx("601 23 11 10 01 6C 6F 61 64")
    rig.tx("000 81 01")
    rig.wait(0.2)
    assert rig.tx("601 40 05 65 00 00 00 00 00") == ["581 41 05 65 00 2C 00 00 00"]


class WireToServer:
    """What canopen's SdoClient needs of a network: the simulated drive at its other end, without a bus."""

    def __init__(self) -> None:
        self.client = SdoClient(0x601, 0x581, ObjectDictionary())
        self.client.network = self  # type: ignore[assignment]
        self.server = SdoService(1, Dictionary(1), lambda frame: self.client.on_response(0, frame.data, 0.0))

    def send_message(self, cob_id: int, data: bytes) -> None:
        self.server.receive(bytes(data))


def test_the_client_of_the_package_canopen_reads_and_writes_it_by_blocks() -> None:
    wire = WireToServer()
    with wire.client.open(0x1008, 0, "rb", block_transfer=True) as stream:
        assert stream.read() == b"canbase simulated drive"
    text = bytes(range(32, 127)) * 9
    with wire.client.open(0x6505, 0, "wb", size=len(text), block_transfer=True) as stream:
        stream.write(text)
    assert wire.client.upload(0x6505, 0) == text  # by segments


def test_a_kind_without_block_transfers_refuses_both() -> None:
    both = {"node_id": 1, "profile": "zlac8015d", "velocity_unit": None}
    rig = Rig(robot({"joint": "left", "side": "left", **both}, {"joint": "right", "side": "right", "axis": 1, **both}))
    assert rig.tx("601 A4 08 10 00 7F 1C 00 00") == ["581 80 08 10 00 01 00 04 05"]
    assert rig.tx("601 C6 05 65 00 09 00 00 00") == ["581 80 05 65 00 01 00 04 05"]


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
