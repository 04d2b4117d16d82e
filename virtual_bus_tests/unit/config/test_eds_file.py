"""EDS files as manufacturers really write them, and the profiles that are drafted from them."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.eds_file import EdsError, EdsObject, number, read_eds
from canbase_config.from_eds import draft, why_no_drive
from canbase_config.load import sample
from canbase_config.profile_file import load_profile

REAL = Path(os.environ.get("CANBASE_EDS_FOLDER", "eds"))
"""Files of real drives; they belong to their manufacturers and are not part of canbase."""
REAL_FILES = sorted(file for file in REAL.glob("*") if file.suffix in (".eds", ".dcf"))

GOOD = """\
[DeviceInfo]
VendorName=Maker
ProductName=Drive "one"
VendorNumber=0x42
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x6505
[1000]
ParameterName=Device type
ObjectType=7
DataType=0x0007
AccessType=ro
DefaultValue=0x20192
[1400sub1]
ParameterName=COB-ID
DataType=0x0007
AccessType=RW
DefaultValue=$NodeID + 0x40000200
"""


def written(folder: Path, text: str | bytes, name: str = "drive.eds") -> Path:
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_what_an_eds_says(tmp_path: Path) -> None:
    eds = read_eds(written(tmp_path, GOOD))
    assert eds.info["vendorname"] == "Maker"
    assert eds.default(0x1000) == 0x20192
    text = "$NodeID + 0x40000200"
    assert eds.objects[0x1400, 1] == EdsObject(
        0x1400, 1, "COB-ID", 15, 7, "rw", 0x40000200, text=text, has_node_id=True
    )
    assert not eds.objects[0x1000, 0].has_node_id
    assert eds.has(0x1400)
    assert not eds.has(0x1400, 2)
    assert eds.default(0x6040) is None
    assert eds.notes == (
        "line 8: 6505h is listed, but no section describes it",
        "1 objects are described, but not listed",
    )


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0x1F4", 500),
        ("500", 500),
        ("-3", -3),
        ("0402", 0o402),
        ("0", 0),
        ("20192h", 0x20192),
        ("$NODEID+0x200", 0x200),
        ("0x200 + $NodeID", 0x200),
        ("NODEID+0x200", 0x200),
        ("$NODEID", 0),
        ("0x10;comment", 16),
        ("0xFFFFFFFF", 0xFFFFFFFF),
        ("", None),
        ("500k", None),
        ("1.5", None),
    ],
)
def test_numbers(text: str, value: int | None) -> None:
    assert number(text) == value


@pytest.mark.parametrize(
    ("before", "after", "note"),
    [
        (b"[DeviceInfo]", b"\xef\xbb\xbf[DeviceInfo]", ""),
        (b"Maker", b"Maker \x93fast\x94", "read as cp1252: it is no UTF-8"),
        (b"Maker", b"Maker \x81", "read as latin-1: it is no UTF-8"),
        (b"\n", b"\r\n", ""),
        (
            b"AccessType=ro\n",
            b"AccessType=ro\nACCESSTYPE=rw\n",
            "line 14: ACCESSTYPE is there twice in [1000]; the first counts",
        ),
        (b"[1400sub1]", b"[1400SUB1]", ""),
        (b"[1400sub1]", b"[1000]\n[1400sub1]", "line 15: section [1000] is there already, in line 9; the first counts"),
        (b"ObjectType=7\n", b"", ""),
        (b"ParameterName=Device type\n", b"", ""),
        (b"ObjectType=7", b"junk", "line 11: neither a section nor a key: 'junk'"),
        (b"[1000]", b"[1000", "line 9: the bracket of [1000 is not closed"),
        (b"AccessType=RW", b"AccessType=yes", "line 15: [1400sub1] has the access type 'yes'; rw is assumed"),
        (b"0x20192\n", b"0x20192\nParameterValue=0x20192\n", ""),
        (b"$NodeID + 0x40000200", b"sometimes", "line 19: 'sometimes' is no number"),
    ],
)
def test_what_real_files_have_is_read_and_told(tmp_path: Path, before: bytes, after: bytes, note: str) -> None:
    eds = read_eds(written(tmp_path, GOOD.encode().replace(before, after)))
    assert eds.default(0x1000) == 0x20192
    assert eds.has(0x1400, 1)
    assert [line for line in eds.notes if "listed" not in line] == [note] * bool(note)


def test_a_file_without_device_info_is_still_read(tmp_path: Path) -> None:
    eds = read_eds(written(tmp_path, GOOD[GOOD.index("[1000]") :]))
    assert "it has no section [DeviceInfo]" in eds.notes
    assert eds.default(0x1000) == 0x20192


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"<?xml version='1.0'?>", ":1: this is XML (XDD or XDC, CiA 311), which is not read: take the drive's EDS"),
        (b"", ":1: no section describes an object"),
        (b"PK\0\0", "has zero bytes: no EDS file"),
        (b"[1000]\n" * 1_200_000, "is larger than 8000000 bytes"),
    ],
)
def test_what_is_no_eds_says_why(tmp_path: Path, data: bytes, reason: str) -> None:
    with pytest.raises(EdsError) as error:
        read_eds(written(tmp_path, data))
    assert str(error.value).startswith(str(tmp_path / "drive.eds"))
    assert reason in str(error.value)


def test_a_missing_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(EdsError, match="cannot be read: No such file"):
        read_eds(tmp_path / "none.eds")


@settings(max_examples=100, deadline=None)
@given(st.lists(st.sampled_from([*GOOD.splitlines(), "[", "]", "=", "[6040", "DataType=", "\x85"]), max_size=30))
def test_any_order_of_lines_is_read_or_refused(lines: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        refused = refusal(written(Path(folder), "\n".join(lines)))
    assert refused == "" or "no section describes an object" in refused


def refusal(file: Path) -> str:
    try:
        read_eds(file)
    except EdsError as error:
        return str(error)
    return ""


# -- drafts


WHOLE = GOOD + "".join(
    f"[{index:04X}]\nParameterName=x\nDataType=0x0004\nAccessType=rw\n"
    for index in (0x1005, 0x6040, 0x6041, 0x6060, 0x6064, 0x606C, 0x60FF, 0x1400, 0x1600, 0x1800, 0x1A00)
)


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ("[1016sub0]\n[1016sub1]\n[6007]\n", "It can stop by itself when the computer dies: it watches heartbeats"),
        ("[1016sub1]\n", "Do not count on it to stop by itself"),
        (
            "[100C]\n[100D]\n[6007]\n",
            "It can stop by itself when the computer dies: it knows node guarding (100Ch, 100Dh)",
        ),
        ("[100C]\n[100D]\n", "It will NOT stop by itself when the computer dies"),
        ("[1400sub5]\n", "It may stop by itself when the computer dies: it has a deadline for setpoints"),
        ("", "It will NOT stop by itself when the computer dies"),
    ],
)
def test_whether_the_drive_stops_by_itself_is_said(tmp_path: Path, sections: str, sentence: str) -> None:
    found = draft(read_eds(written(tmp_path, WHOLE + sections)))
    assert found.self_stop.startswith(sentence)
    assert found.missing == ()


def test_a_draft_is_a_profile_that_knows_what_it_does_not_know(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["config", "from-eds", str(written(tmp_path, WHOLE))])
    assert result.exit_code == 0
    assert "It will NOT stop by itself" in result.stderr
    assert "not in an EDS: what one bit of 60FFh" in result.stderr
    profile = load_profile(str(written(tmp_path, result.stdout, "drafted.yaml")))
    assert profile.title == 'Maker Drive "one"'
    assert profile.identity.vendor_id == 0x42
    assert (profile.layout.axes, profile.units.target_velocity, profile.modes) == (1, None, (3,))
    assert profile.self_stop.heartbeat_entries == 0
    assert (profile.options.quick_stop, profile.self_stop.abort_connection) == ("no", "no")
    assert {"units.target_velocity", "units.acceleration", "modes", "pdo.synchronous"} <= set(profile.unproven)


@pytest.mark.parametrize(
    ("sections", "guarded"),
    [("[100C]\n[100D]\n[6007]\n", True), ("[100C]\n[100D]\n[1016sub1]\n[6007]\n", False), ("", False)],
)
def test_a_drive_that_monitors_no_heartbeat_is_drafted_with_node_guarding(
    tmp_path: Path, sections: str, guarded: bool
) -> None:
    text = draft(read_eds(written(tmp_path, WHOLE + sections))).text
    assert load_profile(str(written(tmp_path, text, "drafted.yaml"))).self_stop.node_guarding is guarded


def test_an_inverter_without_60ffh_is_drafted_in_mode_2(tmp_path: Path) -> None:
    text = WHOLE.replace("[60FF]", "[6042]").replace("[606C]", "[6044]")
    found = draft(read_eds(written(tmp_path, text)))
    kind = load_profile(str(written(tmp_path, found.text, "drafted.yaml")))
    assert found.missing == ()
    assert (kind.modes, kind.layout.target_bits, kind.layout.velocity_bits) == ((2,), 16, 16)
    assert {"units.target_velocity", "units.actual_velocity"} <= set(kind.unproven)


def test_a_drive_that_lacks_too_much_is_refused_in_words(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["config", "from-eds", str(written(tmp_path, GOOD))])
    assert result.exit_code == 1
    assert "canbase cannot use this drive: it lacks 6040h, 6041h" in result.stderr


def test_what_is_no_eds_has_exit_code_2(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["config", "from-eds", str(written(tmp_path, "nothing"))])
    assert result.exit_code == 2
    assert "drive.eds:1: no section describes an object" in result.stderr


@pytest.mark.parametrize(
    ("before", "after", "doubt"),
    [
        ("", "", ""),
        ("[1600]\nParameterName=x\nDataType=0x0004\nAccessType=rw", "[1600]\nAccessType=const", "1600h cannot be wri"),
        ("[6064]\n", "[6064]\nPDOMapping=0\n", "6064h cannot be in a PDO (PDOMapping=0)"),
        ("[6060]\n", "[6060]\nPDOMapping=0\n", ""),
        ("[6064]\n", "[6064]\nPDOMapping=1\n", ""),
        (
            "[1017]\n",
            "",
            "it has no 1017h and sends no heartbeat: canbase needs one, or node guarding with 6007h, which by",
        ),
        ("[1017]\n", "[100C]\n[100D]\n[6007]\n", "node guarding with 6007h, which it has (self_stop.node_guarding)"),
        ("[1017]\n", "[1017]\n[68FF]\n", ""),
        ("[1017]\n", "[1017]\n[68FF]\n[70FF]\n[78FF]\n", "it has 4 axes, and the first 2 of a node can be used"),
    ],
)
def test_what_an_eds_has_otherwise_than_it_is_needed_is_told_and_stays_in_the_draft(
    before: str, after: str, doubt: str, tmp_path: Path
) -> None:
    text = (WHOLE + "[1017]\n").replace(before, after, 1)
    result = CliRunner().invoke(app, ["config", "from-eds", str(written(tmp_path, text))])
    assert result.exit_code == 0
    assert [line for line in result.stderr.splitlines() if "doubt:" in line and doubt in line] or not doubt
    assert ("doubt:" in result.stderr) is bool(doubt)
    assert doubt in result.stdout.partition("title:")[0]
    assert load_profile(str(written(tmp_path, result.stdout, "drafted.yaml"))).layout.axes <= 2


RANGES = """\
[6007]
ParameterName=Abort connection option
DataType=0x0003
LowLimit=0x8000
HighLimit=0x7FFF
[605B]
ParameterName=Shutdown option
DataType=0x0003
LowLimit=-1
HighLimit=01
[1003]
ParameterName=Errors
ObjectType=0x8
DataType=0x0007
AccessType=ro
CompactSubObj=3
[1003Value]
NrOfEntries=1
2=0x8130
[1018]
ParameterName=Identity
[1018sub0]
ParameterName=Highest sub-index
DataType=0x0005
"""


def test_ranges_arrays_that_are_not_spelled_out_and_the_names_of_whole_objects(tmp_path: Path) -> None:
    eds = read_eds(written(tmp_path, RANGES))
    assert (eds.objects[0x6007, 0].low, eds.objects[0x6007, 0].high) == (-32768, 32767)  # the bit pattern of -32768
    assert (eds.objects[0x605B, 0].low, eds.objects[0x605B, 0].high) == (-1, 1)
    assert eds.compact == {0x1003: 3}
    assert [eds.objects[0x1003, sub].default for sub in range(4)] == [3, None, 0x8130, None]
    assert [eds.objects[0x1003, sub].is_set for sub in range(4)] == [False, False, True, False]
    assert eds.objects[0x1003, 3].name == "Errors 3"
    assert eds.names[0x1018] == "Identity"
    assert "1003value" in eds.sections


@pytest.mark.parametrize(
    ("device_type", "says"),
    [
        ("DefaultValue=0x30191", "1000h has the device profile 401, not 402"),  # inputs and outputs
        ("DefaultValue=0x10196", "1000h has the device profile 406, not 402"),  # an encoder
        ("DefaultValue=0x0", "1000h has the device profile 0, not 402"),  # an example without a profile
        ("", "1000h has no value"),
    ],
)
def test_a_device_that_is_no_drive_is_named_and_gives_no_profile(tmp_path: Path, device_type: str, says: str) -> None:
    file = written(tmp_path, GOOD.replace("DefaultValue=0x20192", device_type))
    result = CliRunner().invoke(app, ["config", "from-eds", str(file)])
    assert (result.exit_code, result.stdout) == (1, "")
    assert "this is no CiA 402 drive: it has neither 6040h nor 6041h" in result.stderr
    assert says in result.stderr


@pytest.mark.parametrize("text", [GOOD, WHOLE, WHOLE.replace("DefaultValue=0x20192", "DefaultValue=0x0")])
def test_a_drive_is_known_by_its_controlword_or_by_1000h(tmp_path: Path, text: str) -> None:
    assert why_no_drive(read_eds(written(tmp_path, text))) == ""


@pytest.mark.skipif(not REAL_FILES, reason="set CANBASE_EDS_FOLDER to a folder with EDS files of real drives")
@pytest.mark.parametrize("file", REAL_FILES, ids=lambda file: file.name)
def test_files_of_real_drives_are_read_and_give_a_profile(file: Path, tmp_path: Path) -> None:
    eds = read_eds(file)
    assert eds.has(0x1000)
    if why := why_no_drive(
        eds
    ):  # an encoder, inputs and outputs, an example: the command names it and gives no profile
        result = CliRunner().invoke(app, ["config", "from-eds", str(file)])
        assert (result.exit_code, result.stdout) == (1, "")
        assert why in result.stderr
        return
    found = draft(eds)
    profile = load_profile(str(written(tmp_path, found.text, f"{file.stem}.yaml")))
    assert profile.layout.axes in (1, 2)
    assert found.self_stop
    assert found.missing == ()


def test_the_eds_of_the_simulated_drive_gives_what_it_has(tmp_path: Path) -> None:
    file = sample("bench").parents[1] / "eds" / "canbase_cia402.eds"
    found = draft(read_eds(file))
    profile = load_profile(str(written(tmp_path, found.text, "sim.yaml")))
    assert found.missing == ()
    assert found.self_stop.startswith("It can stop by itself")
    assert profile.options.quick_stop == "yes"
