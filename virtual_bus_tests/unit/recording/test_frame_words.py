"""One frame in words: every service of CiA 301 and 402 that a bus has, and bytes that mean nothing."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from canbase_recording.entry import FrameKind, RecordedFrame
from canbase_recording.explain_file import known_objects
from canbase_recording.frame_words import Decoder, controlword_text
from canbase_recording.kind import Kind
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_recording.sdo_words import SdoChannels

BENCH = load_robot(sample("bench")).robot
EDS = known_objects(())


def words(cob_id: int, data: bytes, kind: FrameKind = FrameKind.DATA, *, with_robot: bool = True) -> str:
    robot = BENCH if with_robot else None
    return Decoder(PdoLayouts(robot), robot, EDS).words(RecordedFrame(0.0, cob_id, data, kind=kind)).text


@pytest.mark.parametrize(
    ("cob_id", "data", "text"),
    [
        (0x000, b"\x01\x00", "NMT start, all nodes"),
        (0x000, b"\x80\x05", "NMT enter pre-operational, node 5"),
        (0x000, b"\x07\x05", "NMT command 7 that CiA 301 does not have, node 5"),
        (0x080, b"", "SYNC"),
        (0x080, b"\x05", "SYNC 5"),
        (0x081, struct.pack("<HB5x", 0x8130, 0x11), "EMCY 8130h heartbeat or life guarding lost, register 11h"),
        (0x082, struct.pack("<HB", 0, 0), "EMCY 0000h error reset or no error, register 00h"),
        (0x100, struct.pack("<IH", 43_200_000, 15_000), "TIME: day 15000 since 1984-01-01, 43200.000 s after midnight"),
        (0x181, struct.pack("<Hi", 0x0637, -5), "TPDO1 statusword 0637h operation enabled, position -5"),
        (0x282, struct.pack("<ih", -100, 30), "TPDO2 velocity -100, torque 30"),
        (0x201, struct.pack("<Hi", 0x0F, 1000), "RPDO1 controlword 000Fh enable operation, target velocity 1000"),
        (0x501, b"\x02\x00", "RPDO4 controlword 0002h quick stop"),
        (0x601, bytes.fromhex("2b40600006000000"), "SDO write 6040h:0 Axis 0 controlword = 0x0006 = 6 (u16)"),
        (0x601, bytes.fromhex("4018100100000000"), "SDO read 1018h:1 Vendor-ID"),
        (0x581, bytes.fromhex("4b41600037020000"), "SDO answer 6041h:0 Axis 0 statusword = 0x0237 = 567 (u16): oper"),
        (0x581, bytes.fromhex("6040600000000000"), "SDO written 6040h:0 Axis 0 controlword"),
        (0x581, bytes.fromhex("8017100000000206"), "SDO abort 1017h:0 Producer heartbeat time: 0602 0000h the object"),
        (0x601, bytes.fromhex("6000000000000000"), "SDO requests the next segment"),
        (0x701, b"\x00", "boot-up"),
        (0x701, b"\x05", "heartbeat operational"),
        (0x701, b"\x84", "heartbeat stopped (node guarding)"),
        (0x701, b"\x33", "heartbeat of an unknown state 33h"),
        (0x7E5, b"\x04\x01" + bytes(6), "LSS switch state global, 00000001h"),
        (0x1FE, struct.pack("<BBBBHBB", 2, 13, 1, 1, 20, 0, 0), "tripped: motion missing, node 1, quick stop, last"),
        (0x27E, b"\x03RST", "reset request 3"),
        (0x2FE, struct.pack("<HHHBB", 1, 2, 3, 4, 5), "trips 4, leases refused 1, frames dropped 2, bus errors 3"),
    ],
)  # fmt: skip
def test_each_service(cob_id: int, data: bytes, text: str) -> None:
    assert words(cob_id, data).startswith(text)


@pytest.mark.parametrize(
    ("kind", "cob_id", "text"),
    [
        (FrameKind.ERROR, 0x20, "error frame of the CAN controller"),
        (FrameKind.EXTENDED, 0x18FF1234, "29-bit identifier"),
        (FrameKind.REMOTE, 0x701, "node guarding request"),
    ],
)
def test_frames_that_are_no_data(kind: FrameKind, cob_id: int, text: str) -> None:
    assert words(cob_id, b"", kind).startswith(text)


def test_without_robot_yaml_a_mapping_is_assumed_and_said_to_be_or_not_known() -> None:
    assert words(0x185, b"\x37\x02", with_robot=False) == "TPDO1 statusword 0237h operation enabled (assumed mapping)"
    assert words(0x185, bytes(7), with_robot=False) == "TPDO1, 7 bytes: its mapping is not known"


def test_a_frame_of_another_length_than_robot_yaml_gives_is_not_decoded_in_another_way() -> None:
    """Two bytes would fit CiA 402's default mapping; of a drive of robot.yaml nothing is assumed."""
    assert words(0x181, b"\x37\x02") == "TPDO1, 2 bytes: its mapping is not known"


@pytest.mark.parametrize(
    ("word", "text"),
    [(0x00, "disable voltage"), (0x02, "quick stop"), (0x06, "shutdown"), (0x07, "switch on"),
     (0x0F, "enable operation"), (0x80, "fault reset"), (0x10F, "enable operation, halt"), (0x0B, "quick stop"),
     (0x04, "disable voltage")],
)  # fmt: skip
def test_controlwords(word: int, text: str) -> None:
    assert controlword_text(word) == text


SUPPLY = {"name": "dc_link", "index": 0x6079, "bits": 32, "scale": 0.001, "unit": "V"}
LOAD = {"name": "load", "index": 0x6077, "bits": 16, "signed": True}
RARE = {"name": "target_echo", "index": 0x60FF, "bits": 32, "period_s": 1.0}


def with_values(*values: dict[str, Any]) -> Robot:
    drives = [drive.model_dump(exclude_unset=True) for drive in BENCH.drives]
    drives[0]["values"] = values
    return Robot.model_validate(BENCH.model_dump(exclude_unset=True) | {"drives": tuple(drives)})


def test_named_values_of_robot_yaml_have_their_names_units_and_signs() -> None:
    robot = with_values(SUPPLY, LOAD, RARE)
    decoder = Decoder(PdoLayouts(robot), robot, EDS)

    def text(cob_id: int, data: bytes) -> str:
        return decoder.words(RecordedFrame(0.0, cob_id, data)).text

    assert text(0x381, struct.pack("<Ih", 48_200, -3)) == "TPDO3 dc_link 48.2 V, load -3"
    assert text(0x481, struct.pack("<I", 7)) == "TPDO4 target_echo 7"
    assert text(0x381, bytes(5)) == "TPDO3, 5 bytes: its mapping is not known"
    assert text(0x382, bytes(6)) == "TPDO3, 6 bytes: its mapping is not known"  # the other drive has none


def test_a_named_value_is_no_order_and_no_motion() -> None:
    """An echo of the target in a value PDO would be taken for a setpoint of the master."""
    layouts = PdoLayouts(with_values(RARE))
    found = layouts.of(0x381, 4)
    assert found is not None
    assert [each.base for each in found.mapped] == [0]


KINDS = st.sampled_from(list(FrameKind))


@given(st.integers(-1, 0x2000_0000), st.binary(max_size=70), KINDS, st.booleans())
def test_any_frame_has_words(cob_id: int, data: bytes, kind: FrameKind, with_robot: bool) -> None:
    robot = BENCH if with_robot else None
    found = Decoder(PdoLayouts(robot), robot).words(RecordedFrame(0.0, cob_id, data, kind=kind))
    assert found.text
    assert isinstance(found.kind, Kind)


@given(st.lists(st.tuples(st.booleans(), st.integers(1, 127), st.binary(max_size=8)), max_size=30))
def test_any_sdo_frames_in_any_order(frames: list[tuple[bool, int, bytes]]) -> None:
    channels = SdoChannels()
    for by_client, node_id, data in frames:
        done = channels.on_request(node_id, data) if by_client else channels.on_answer(node_id, data)
        assert done is None or len(done.data) <= 4
