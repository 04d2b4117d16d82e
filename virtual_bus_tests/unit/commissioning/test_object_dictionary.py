"""Objects as people write and read them."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_commissioning.object_dictionary import (
    Address,
    decode,
    encode,
    known_object,
    meaning,
    parse_address,
    show,
)
from canbase_config.eds_file import read_eds
from canbase_config.profile_file import load_profile

OURS = read_eds(Path(str(files("canbase_config"))) / "eds" / "canbase_cia402.eds")


@pytest.mark.parametrize("text", ["1018:4", "0x1018:4", "1018h:4", "1018H:0x4", "1018sub4", " 1018:4h "])
def test_an_index_is_hexadecimal_however_it_is_written(text: str) -> None:
    assert parse_address(text) == Address(0x1018, 4)


def test_without_sub_index_it_is_0() -> None:
    assert str(parse_address("6041")) == "6041h:0"


@pytest.mark.parametrize("text", ["", "60410", "6041:256", "statusword", "6041:", "-6041", "6041:-1"])
def test_what_is_no_object_is_told_with_examples(text: str) -> None:
    with pytest.raises(ValueError, match=r"6041|0 to 255"):
        parse_address(text)


@pytest.mark.parametrize(
    ("at", "kind"),
    [
        ("6041", "u16"), ("6841", "u16"), ("606C", "i32"), ("60FF", "i32"), ("68FF", "i32"), ("6060", "i8"),
        ("1017", "u16"), ("1008", "str"), ("1018:4", "u32"), ("2345", ""),
    ],
)  # fmt: skip
def test_types_of_a_plain_drive_are_known_its_second_axis_too(at: str, kind: str) -> None:
    assert known_object(parse_address(at), [OURS], None).type == kind


@pytest.mark.parametrize(
    ("at", "kind"), [("6041", "u32"), ("60FF:2", "i32"), ("2000", "u16"), ("200F", "u16"), ("6040", "u16")]
)
def test_a_profile_knows_better_zlac8015d_packs_two_statuswords(at: str, kind: str) -> None:
    assert known_object(parse_address(at), [OURS], load_profile("zlac8015d")).type == kind


@given(
    st.sampled_from([("u8", 8, False), ("i8", 8, True), ("u16", 16, False), ("i32", 32, True), ("u64", 64, False)]),
    st.data(),
)
def test_a_number_comes_back_from_its_bytes(kind: tuple[str, int, bool], data: st.DataObject) -> None:
    name, bits, signed = kind
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    number = data.draw(st.integers(low, high))
    assert decode(encode(str(number), name), name) == number


@pytest.mark.parametrize(
    ("text", "kind"), [("256", "u8"), ("-1", "u8"), ("128", "i8"), ("-129", "i8"), ("0x10000", "u16")]
)
def test_one_too_many_does_not_fit(text: str, kind: str) -> None:
    with pytest.raises(ValueError, match="does not fit"):
        encode(text, kind)


@pytest.mark.parametrize("text", ["50h", "0x50", "80", "0X50", "8_0"])
def test_a_number_in_three_ways(text: str) -> None:
    assert encode(text, "u16") == b"\x50\x00"


def test_words_and_floats_are_values_too() -> None:
    assert encode("save", "str") == b"save"
    assert encode("1.5", "f32") == bytes.fromhex("0000C03F")
    assert decode(bytes.fromhex("0000C03F"), "f32") == 1.5
    assert encode("01 FF", "hex") == b"\x01\xff"
    with pytest.raises(ValueError, match="is no number"):
        encode("fast", "u16")


@pytest.mark.parametrize(
    ("data", "kind", "shown"),
    [
        ("50 02", "u16", "0x0250 = 592 (u16)"),
        ("EC FF FF FF", "i32", "0xFFFFFFEC = -20 (i32)"),
        ("EC FF", "i32", "0xFFEC = -20 (i16)"),
        ("05", "", "0x05 = 5 (u8)"),
        ("41 42 00", "str", '"AB"'),
    ],
)
def test_a_value_is_shown_with_the_width_that_the_drive_has(data: str, kind: str, shown: str) -> None:
    assert show(bytes.fromhex(data), kind) == shown


@pytest.mark.parametrize(
    ("at", "data", "words"),
    [
        ("6041", "37 02", "operation enabled"),
        ("6841", "50 02", "switch on disabled"),
        ("6041", "37 02 50 02", "operation enabled, switch on disabled"),
        ("6061", "03", "mode profile velocity"),
        ("603F", "10 23", "over-current"),
        ("1016:1", "2C 01 7E 00", "watches node 126, 300 ms"),
        ("1016:2", "00 00 00 00", "not used"),
        ("1201:1", "A1 06 00 80", "closed, requests by 6A1h"),
        ("1201:2", "C1 06 00 00", "open, answers by 6C1h"),
        ("1400:1", "01 02 00 C0", "off, COB-ID 201h"),
        ("1600:1", "20 00 FF 60", "60FFh:0, 32 bits"),
        ("6064", "00 00 00 00", ""),
    ],
)
def test_what_a_value_means(at: str, data: str, words: str) -> None:
    assert meaning(parse_address(at), bytes.fromhex(data)) == words
