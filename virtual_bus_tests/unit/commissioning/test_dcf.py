"""DCF files: what was read of a drive comes back byte by byte, whatever the manufacturer's EDS is like."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random

import pytest
from canopen import import_od
from hypothesis import given
from hypothesis import strategies as st

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.parameters.dcf_reader import holds_values, read_parameters
from canbase_commissioning.parameters.dcf_writer import Heading, dcf_text
from canbase_commissioning.parameters.saved import DriveIdentity, Parameters
from canbase_commissioning.parameters.value_text import INTEGER_BYTES, LONG, REALS, octets, to_bytes, to_text
from canbase_config.eds_file import Eds, EdsError, read_eds, read_text

REAL = Path(os.environ.get("CANBASE_EDS_FOLDER", "eds"))
"""Files of real drives; they belong to their manufacturers and are not part of canbase."""
REAL_FILES = sorted(file for file in REAL.glob("*") if file.suffix in (".eds", ".dcf"))
HEADING = Heading("drive.dcf", "11-25-2026", "03:58AM", 1_000_000)


def write(file: Path, eds: Eds, parameters: Parameters) -> Path:
    text, encoding = read_text(eds.path)
    file.write_bytes(dcf_text(text, eds, parameters, HEADING).encode(encoding))
    return file


def made_up(eds: Eds, chance: Random) -> Parameters:
    """A value for nine objects of ten, of the width that the EDS gives or, now and then, another one."""
    values, refused = {}, {}
    for (index, sub), entry in eds.objects.items():
        at = Address(index, sub)
        if chance.random() < 0.1:
            refused[at] = "0602 0000h the object does not exist"
            continue
        size = INTEGER_BYTES.get(entry.data_type or 0, 8 if entry.data_type == 0x11 else 4)
        size = chance.randrange(1, 60) if entry.data_type in LONG else size
        values[at] = chance.randbytes(chance.randrange(1, 9) if chance.random() < 0.05 else size)
    return Parameters(5, values, refused, DriveIdentity(0x42, 7, None, 9, "Drive", "", "2.1a"))


@pytest.mark.skipif(not REAL_FILES, reason="set CANBASE_EDS_FOLDER to a folder with EDS files of real drives")
@pytest.mark.parametrize("file", REAL_FILES, ids=lambda file: file.stem)
def test_the_eds_of_a_real_drive_becomes_a_dcf_and_is_read_back(file: Path, tmp_path: Path) -> None:
    eds = read_eds(file)
    parameters = made_up(eds, Random(file.name))
    dcf = write(tmp_path / "drive.dcf", eds, parameters)
    again, found = read_parameters(dcf)
    assert (again.node_id, again.values, again.refused) == (5, parameters.values, parameters.refused)
    assert again.identity == parameters.identity
    assert found.objects.keys() == eds.objects.keys()
    assert {at: (e.name, e.access, e.low, e.high, e.data_type) for at, e in found.objects.items()} == {
        at: (e.name, e.access, e.low, e.high, e.data_type) for at, e in eds.objects.items()
    }
    kept = write(tmp_path / "again.dcf", found, again)
    assert kept.read_text(found.encoding).splitlines() == [
        line.replace(f"LastEDS={file.name}", "LastEDS=drive.dcf") for line in dcf.read_text(found.encoding).splitlines()
    ]


@pytest.mark.skipif(not REAL_FILES, reason="set CANBASE_EDS_FOLDER to a folder with EDS files of real drives")
@pytest.mark.parametrize("file", REAL_FILES, ids=lambda file: file.stem)
def test_the_package_canopen_reads_each_dcf_whose_eds_it_reads(file: Path, tmp_path: Path) -> None:
    try:
        theirs = import_od(str(file), 5)
    except (ValueError, KeyError) as error:
        pytest.skip(f"canopen does not read the EDS: {error}")
    eds = read_eds(file)
    parameters = made_up(eds, Random(file.name))
    od = import_od(str(write(tmp_path / "drive.dcf", eds, parameters)))
    assert set(od) == set(theirs)
    assert od.node_id == 5


EDS = """\
[FileInfo]\r
FileName=drive.eds\r
[DeviceComissioning]\r
NodeID=99\r
[1000]\r
ParameterName=Device type\r
DataType=0x0007\r
ParameterValue=5\r
; a comment of the vendor\r
\r
[2000]
ParameterName=Text
DataType=0x0009
[1000]
ParameterName=A second one, which does not count
[1003]
ParameterName=Errors
DataType=0x0007
CompactSubObj=3
"""


def small(tmp_path: Path) -> Eds:
    file = tmp_path / "drive.eds"
    file.write_bytes(EDS.encode())
    return read_eds(file)


def test_the_maker_s_lines_stay_and_values_stand_where_they_belong(tmp_path: Path) -> None:
    values = {Address(0x1000): b"\x92\x01\x02\0", Address(0x1003, 2): b"\x30\x81\0\0", Address(0x1003): b"\x02"}
    file = write(tmp_path / "drive.dcf", small(tmp_path), Parameters(1, values))
    lines = file.read_bytes().decode().split("\r\n")
    begin = lines.index("[1000]")
    assert lines[begin + 1 : begin + 6] == [
        "ParameterName=Device type", "DataType=0x0007", "ParameterValue=0x00020192", "; a comment of the vendor", "",
    ]  # fmt: skip
    assert lines[lines.index("[1003Value]") + 1 :][:2] == ["NrOfEntries=1", "2=0x00008130"]
    assert lines[lines.index("[DeviceComissioning]") + 1] == "NodeID=1"
    assert "NodeID=99" not in lines
    assert lines[1:3] == ["FileName=drive.dcf", "LastEDS=drive.eds"]
    assert read_parameters(file)[0].values == values


def test_a_value_that_does_not_fit_its_type_is_an_error_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "drive.dcf"
    file.write_text("[6040]\nParameterName=Controlword\nDataType=0x0006\nParameterValue=0x-14\n")
    with pytest.raises(EdsError, match=r"drive.dcf:1: the value '0x-14' of 6040h:0 does not fit its data type 0006h"):
        read_parameters(file)


def test_an_eds_is_no_dcf(tmp_path: Path) -> None:
    file = tmp_path / "drive.eds"
    file.write_text("[6040]\nDataType=0x0006\nDefaultValue=$NODEID+6\n")
    parameters, eds = read_parameters(file)
    assert not holds_values(eds)
    assert parameters.values == {Address(0x6040): b"\x06\0"}


@pytest.mark.parametrize(
    ("text", "data_type", "data"),
    [
        ("-20", 0x04, "EC FF FF FF"),
        ("0xFFFFFFEC", 0x04, "EC FF FF FF"),
        ("$NODEID+0x180", 0x07, "85 01 00 00"),
        ("0x1FF", 0x05, None),
        ("-1", 0x05, None),
        ("1.5", 0x08, "00 00 C0 3F"),
        ("0x3FC00000", 0x08, "00 00 C0 3F"),
        ("soon", 0x08, None),
        ("12 34", 0x0A, "12 34"),
        ("0x1234", 0x0F, "12 34"),
        ("Hello", 0x09, "48 65 6C 6C 6F"),
        ("", 0x09, None),
    ],
)
def test_values_of_other_programs(text: str, data_type: int, data: str | None) -> None:
    assert to_bytes(text, data_type, 5) == (None if data is None else bytes.fromhex(data))


@given(st.binary(min_size=1, max_size=20), st.sampled_from([*INTEGER_BYTES, *REALS, *LONG, 0x40, None]))
def test_any_bytes_have_a_text_of_one_line(data: bytes, data_type: int | None) -> None:
    text = to_text(data, data_type)
    assert text.isprintable()
    if data_type in INTEGER_BYTES and len(data) == INTEGER_BYTES[data_type]:
        assert to_bytes(text, data_type, 5) == data


def test_octets() -> None:
    assert octets("0x0A 0b") == b"\n\x0b"
    assert octets("0xZ") is None
    assert octets("") is None
