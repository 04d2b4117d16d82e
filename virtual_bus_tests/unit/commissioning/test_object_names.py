"""Objects by name, and what an EDS allows."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_commissioning.object_dictionary import Address
from canbase_commissioning.object_names import find_object, limits, why_not_read, why_not_write
from canbase_config.eds_file import Eds, read_eds

EDS = """\
[1018]
ParameterName=Identity Object
[1018sub1]
ParameterName=Vendor_ID
DataType=0x0007
AccessType=ro
[1600]
ParameterName=RPDO 1
[1600sub1]
ParameterName=Entry 1
DataType=0x0007
[1601]
ParameterName=RPDO 2
[1601sub1]
ParameterName=Entry 1
DataType=0x0007
[60FF]
ParameterName=Target Velocity
DataType=0x0004
LowLimit=-3000
HighLimit=3000
[6040]
ParameterName=Controlword
DataType=0x0006
AccessType=wo
[2000]
ParameterName=Gain
DataType=0x0008
LowLimit=0
[FEED]
ParameterName=Feed
DataType=0x0006
"""


@pytest.fixture
def eds(tmp_path: Path) -> Eds:
    file = tmp_path / "maker.eds"
    file.write_text(EDS)
    return read_eds(file)


@pytest.mark.parametrize(
    ("text", "at"),
    [
        ("6041", Address(0x6041)),
        ("1018h:4", Address(0x1018, 4)),
        ("Target velocity", Address(0x60FF)),
        ("target_velocity", Address(0x60FF)),
        ("  TARGET   VELOCITY ", Address(0x60FF)),
        ("vendor-id", Address(0x1018, 1)),
        ("Identity Object.Vendor_ID", Address(0x1018, 1)),
        ("identity object:4", Address(0x1018, 4)),  # the drive may have what the file leaves out
        ("RPDO 2.Entry 1", Address(0x1601, 1)),
        ("feed", Address(0xFEED)),  # an address goes before a name
    ],
)
def test_an_object_by_address_or_name(text: str, at: Address, eds: Eds) -> None:
    assert find_object(text, [eds]) == at


def test_a_name_of_several_objects_lists_them(eds: Eds) -> None:
    with pytest.raises(ValueError, match=r"several objects: 1600h:1 RPDO 1\.Entry 1, 1601h:1 RPDO 2\.Entry 1"):
        find_object("Entry 1", [eds])


def test_a_miss_names_the_nearest(eds: Eds) -> None:
    with pytest.raises(
        ValueError, match=r"no object 'Traget velocity' in maker.eds; near: Target Velocity \(60FFh:0\)"
    ):
        find_object("Traget velocity", [eds])
    with pytest.raises(ValueError, match=r"no object 'wholly else' in maker\.eds\. An address is INDEX"):
        find_object("wholly else", [eds])
    with pytest.raises(ValueError, match="is no object"):
        find_object("12345", [eds])


@pytest.mark.parametrize(
    ("at", "text", "kind", "why"),
    [
        ((0x60FF, 0), "3000", "i32", ""),
        ((0x60FF, 0), "3001", "i32", "3001 is outside the range of the EDS, -3000 to 3000"),
        ((0x60FF, 0), "-0xBB9", "i32", "-0xBB9 is outside the range of the EDS, -3000 to 3000"),
        ((0x2000, 0), "-0.5", "f32", "-0.5 is outside the range of the EDS, 0 to …"),
        ((0x1018, 1), "1", "u32", "it is read-only by the EDS"),
        ((0x6040, 0), "6", "u16", ""),
        ((0x9999, 0), "6", "u16", ""),
    ],
)
def test_what_may_be_written(at: tuple[int, int], text: str, kind: str, why: str, eds: Eds) -> None:
    assert why_not_write(eds.objects.get(at), text, kind) == why


def test_what_may_be_read(eds: Eds) -> None:
    assert why_not_read(eds.objects[0x6040, 0]) == "it is write-only by the EDS"
    assert why_not_read(eds.objects[0x60FF, 0]) == why_not_read(None) == ""
    assert limits(eds.objects[0x6040, 0]) == ""
