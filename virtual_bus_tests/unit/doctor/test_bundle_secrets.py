"""A support bundle holds only what is listed: secrets that were planted everywhere are not in it, what helps is."""

from __future__ import annotations

import json
import os
import sys
import tarfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from canbase_base.latch_file import LatchFile, create_first
from canbase_base.latch_record import Mark, Record
from canbase_config.load import load_robot, sample
from canbase_doctor.bundle_contents import Command, commands
from canbase_doctor.bundle_filter import (
    LINES,
    UNIT_PROPERTIES,
    VARIABLES,
    Filter,
    environment,
    interfaces,
    matching,
    unit_status,
)
from canbase_doctor.bundle_frames import Frames, asc_line
from canbase_doctor.bundle_words import LEFT_OUT, Words, own_words
from canbase_doctor.support_bundle import collect

SECRETS = {
    "a comment of robot.yaml": "hunter2",
    "an unknown key of robot.yaml": "Tr0ub4dor",
    "the name of a key of robot.yaml": "sk_live_51H",
    "bus.extra of robot.yaml": "xoxb-19284",
    "a file that robot.yaml names": "correcthorse",
    "the name of that file": "batterystaple",
    "a variable of canbase": "ghp_aaaa1111",
    "a variable of others": "AKIAIOSFODNN7",
    "an .env file": "glpat-77xyz",
    "a comment of an .env file": "swordfish",
    "the journal, a message of canbase": "letmein99",
    "the journal, a message of others": "qwertzuiop",
    "the journal, an unknown field": "zaq12wsx",
    "the journal, a field of canbase": "pa55w0rd",
    "the journal, many lines": "MHcCAQEEIB",
    "a personal number in the journal": "48213379",
    "Environment= of a unit": "opensesame",
    "ExecStart= of a unit": "dragonfly7",
    "the alias of an interface": "monkey1234",
    "the name of a drive, in segments": "SeGmEnT",
    "the name of a drive, in a block": "BlOcKtX",
    "four bytes of a vendor's object": "PIN4",
    "a note of a recording": "iloveyou3",
    "the .json of a recording": "princess8",
    "the name of a recording": "sunshine5",
    "the detail of a stop": "football6",
    "a USB device": "trustno1x",
    "the kernel's log": "whatever77",
}


def frame(at_s: float, cob_id: int, data: bytes) -> str:
    return f" {at_s:.6f} 1  {cob_id:X}             Rx   d {len(data)} {data.hex(' ').upper()}\n"


def recording() -> str:
    """Frames of a drive that is asked for its name in each way, and a note."""
    s = {name: secret.encode() for name, secret in SECRETS.items()}
    sdo = [
        (0x581, bytes([0x0A]) + s["the name of a drive, in segments"]),  # begun before the recording
        (0x581, bytes([0x05]) + s["the name of a drive, in a block"]),
        (0x601, bytes.fromhex("4041600000000000")),
        (0x581, bytes.fromhex("4B41600037160000")),
        (0x601, bytes.fromhex("4008100000000000")),
        (0x581, bytes.fromhex("4108100007000000")),
        (0x601, bytes.fromhex("6000000000000000")),
        (0x581, bytes([0x01]) + s["the name of a drive, in segments"]),
        (0x601, bytes.fromhex("A021100000050000")),
        (0x581, bytes.fromhex("C221100007000000")),
        (0x601, bytes.fromhex("A300000000000000")),
        (0x581, bytes([0x43]) + s["the name of a drive, in a block"]),
        (0x581, b"\x43\x40\x60" + s["the name of a drive, in a block"][:5]),  # segment 67, like an answer
        (0x601, bytes.fromhex("4041600000000000")),
        (0x601, bytes.fromhex("23032001") + s["four bytes of a vendor's object"]),
        (0x181, bytes.fromhex("37160F270000")),
        (0x7E5, s["the name of a drive, in a block"] + b"\0"),
    ]
    head = "date Tue Nov 24 21:03:55.879 2026\nbase hex  timestamps absolute\ninternal events logged\n"
    note = f"// 0.5 cmd_vel 0.1000 m/s {SECRETS['a note of a recording']}\n"
    return head + "".join(frame(0.1 * n, *each) for n, each in enumerate(sdo)) + note + "// 0.6 cmd_vel 0.2000 m/s\n"


JOURNAL = [
    {"MESSAGE": "LATCHED: watchdog missing; ends with: reset", "CANBASE_STATE": "ENABLED"},
    {"MESSAGE": f"ready: no lease yet, bus can0 at 500000 bit/s {SECRETS['the journal, a message of canbase']}"},
    {"MESSAGE": f"user said {SECRETS['the journal, a message of others']}"},
    {"MESSAGE": "x", "HOME_COMMENT": SECRETS["the journal, an unknown field"]},
    {"MESSAGE": "x", "CANBASE_CAUSE": SECRETS["the journal, a field of canbase"]},
    {"MESSAGE": f"-----BEGIN KEY-----\n{SECRETS['the journal, many lines']}\n-----END KEY-----"},
    {"MESSAGE": f"wifi pin is {SECRETS['a personal number in the journal']}"},
]
UNITS = f"""Id=canbase-driver@robot.service
ActiveState=active
SubState=running
NRestarts=3
Environment=TOKEN={SECRETS["Environment= of a unit"]}
ExecStart=/opt/x --password {SECRETS["ExecStart= of a unit"]}
"""
INTERFACES = [{
    "ifname": "can0", "operstate": "UP", "ifalias": SECRETS["the alias of an interface"],
    "linkinfo": {"info_kind": "can", "info_data": {"state": "ERROR-ACTIVE", "restart_ms": 100}},
}]  # fmt: skip
OUTPUTS = {
    "journal/canbase.json": "".join(
        json.dumps({"__REALTIME_TIMESTAMP": "1763800000000000", "_SYSTEMD_UNIT": "canbase-driver@robot.service"} | each)
        + "\n"
        for each in JOURNAL
    ),
    "journal/kernel.txt": "Nov 22 10:00:01.123456 robot kernel: can0: bus-off\n"
    f"Nov 22 10:00:02.123456 robot kernel: {SECRETS['the kernel' + chr(39) + 's log']}\n",
    "units/status.txt": UNITS,
    "can/interfaces.json": json.dumps(INTERFACES),
    "system/usb.txt": f"Bus 001 Device 002: ID 1d50:606f {SECRETS['a USB device']}\n",
}


@pytest.fixture
def archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Mapping[str, str]:
    """A bundle of a robot with a secret in each place: the names of its files, and their contents."""
    etc, state = tmp_path / "etc", tmp_path / "state"
    (etc / "installed").mkdir(parents=True)
    named = tmp_path / f"{SECRETS['the name of that file']}.yaml"
    named.write_text(f"velocity_unit: {SECRETS['a file that robot.yaml names']}\n")
    config = tmp_path / "robot.yaml"
    good = sample("bench").read_text()
    config.write_text(
        good.replace("hop_limit: 0", f"hop_limit: 0\n    apikey: {SECRETS['bus.extra of robot.yaml']}")
        + f"# {SECRETS['a comment of robot.yaml']}\nwifi: {SECRETS['an unknown key of robot.yaml']}\n"
        + f"{SECRETS['the name of a key of robot.yaml']}: 1\n"
    )
    (etc / "installed" / "robot.txt").write_text("/etc/systemd/system/canbase-driver@.service\n")
    (etc / "robot.yaml").write_text(config.read_text())
    (etc / "robot.env").write_text(
        f"ROS_DOMAIN_ID=7\nMQTT={SECRETS['an .env file']}\n# {SECRETS['a comment of an .env file']}\n"
    )
    create_first(state / "bench", "bench")
    record = LatchFile(state / "bench", "driver", "bench")
    record.open()
    detail = f"node 1: no status for 0.11 s {SECRETS['the detail of a stop']}"
    record.write(Record(Mark.LATCHED, 3, "drive silent", detail))
    record.close()
    box = state / f"stop_bench_{SECRETS['the name of a recording']}.asc"
    box.write_text(recording())
    robot_yaml = {"name": "bench", "wifi": SECRETS["the .json of a recording"]}
    profiles = {"x.yaml": f"# {SECRETS['the .json of a recording']}\nvelocity_unit: 0.1rpm\n"}
    box.with_suffix(".json").write_text(
        json.dumps({"cause": "drive silent", "robot_yaml": robot_yaml, "profiles": profiles, "at_s": 1.5})
    )
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "nowhere"))
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    monkeypatch.setenv("CANBASE_ROS_ARGS", SECRETS["a variable of canbase"])
    monkeypatch.setenv("AWS_KEY", SECRETS["a variable of others"])
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    told = tuple(
        Command(file, (sys.executable, "-c", "import sys; sys.stdout.write(sys.argv[1])", text))
        for file, text in OUTPUTS.items()
    )
    monkeypatch.setattr("canbase_doctor.bundle_contents.commands", lambda *_: told)
    problems = f"{config}:70: {SECRETS['the name of a key of robot.yaml']}: unknown key\n"
    bundle = collect(load_robot(sample("bench")).robot, config, "-1h", etc, state, {named.name: named}, problems)
    bundle.write(tmp_path / "b.tar.gz")
    with tarfile.open(tmp_path / "b.tar.gz") as opened:
        found = {member.name: opened.extractfile(member) for member in opened.getmembers()}
        return {name.removeprefix("b/"): file.read().decode() for name, file in found.items() if file is not None}


def test_no_secret_that_was_planted_is_in_the_archive(archive: Mapping[str, str]) -> None:
    """By its text, by its bytes in frames, and in names."""
    everything = "\n".join([*archive, *archive.values()])
    joined = "".join(everything.split()).upper()
    found = {
        place
        for place, secret in SECRETS.items()
        if secret in everything or secret.encode().hex().upper()[:8] in joined or secret[-6:] in everything
    }
    assert not found
    assert len(SECRETS) >= 25


def test_what_helps_is_still_in_it(archive: Mapping[str, str]) -> None:
    """What docs/troubleshooting.md promises."""
    assert "counts_per_motor_rev: 4096" in archive["config/robot.yaml"]
    assert "joint: left_wheel" in archive["config/robot.yaml"]
    assert "unknown key" in archive["config/problems.txt"]
    assert archive["config/installed/robot.env"] == "ROS_DOMAIN_ID=7\n"
    assert "canbase-driver@.service" in archive["config/installed/robot.txt"]
    assert "ROS_DOMAIN_ID=7\n" in archive["environment.txt"]
    assert f"CANBASE_ROS_ARGS={LEFT_OUT}\n" in archive["environment.txt"]
    assert "LATCHED: watchdog missing; ends with: reset" in archive["journal/canbase.txt"]
    assert f"no lease yet, bus can0 at 500000 bit/s {LEFT_OUT}" in archive["journal/canbase.txt"]
    assert '"CANBASE_STATE": "ENABLED"' in archive["journal/canbase.json"]
    assert "kernel: can0: bus-off" in archive["journal/kernel.txt"]
    assert archive["units/status.txt"].startswith("canbase-driver@robot.service: active (running)\n    NRestarts=3\n")
    assert '"restart_ms": 100' in archive["can/interfaces.json"]
    assert archive["system/usb.txt"] == "Bus 001 Device 002: ID 1d50:606f\n"
    assert "cause: drive silent" in archive["stops/installed/driver.txt"]
    assert f"detail: node 1: no status for 0.11 s {LEFT_OUT}" in archive["stops/installed/driver.txt"]
    assert "needs a reset: yes" in archive["stops/installed/driver.txt"]
    asc, kept = archive["black_box/recording_1.asc"], json.loads(archive["black_box/recording_1.json"])
    assert "601             Rx   d 8 40 41 60 00 00 00 00 00" in asc
    assert "581             Rx   d 8 4B 41 60 00 37 16 00 00" in asc
    assert "601             Rx   d 8 23 03 20 01 00 00 00 00" in asc
    assert "181             Rx   d 6 37 16 0F 27 00 00" in asc
    assert "// 0.6 cmd_vel 0.2000 m/s" in asc
    assert (kept["cause"], kept["at_s"]) == ("drive silent", 1.5)
    assert "velocity_unit: 0.1rpm" in kept["profiles"]["profile 1"]


def test_no_frame_without_sdo_changes(tmp_path: Path) -> None:
    """The recordings that the repository has, line by line: explain and replay read them as before."""
    frames, data = Frames(), Path(__file__).parents[1] / "recording" / "data"
    words = own_words().also(["left_wheel", "right_wheel"])
    for path in sorted(data.glob("*.asc")):
        for line in path.read_text().splitlines():
            shown, note = asc_line(line, frames)
            assert (shown + note).split() == line.split() or " 6" in shown or " 58" in shown, line
            assert not note or words.line(note) == note


@pytest.mark.parametrize("name", ["bench", "example_can0"])
def test_a_configuration_keeps_all_its_values(name: str) -> None:
    from ruamel.yaml import YAML

    yaml = YAML(typ="safe", pure=True)
    text = sample(name).read_text()
    assert yaml.load(Filter(own_words()).configuration(text)) == yaml.load(text)


def test_files_that_are_no_yaml_or_json_are_left_out() -> None:
    shown = Filter(Words(["a"]))
    assert shown.configuration("a: [") == f"{LEFT_OUT} no YAML\n"
    assert shown.json_file("{") == f"{LEFT_OUT} no JSON\n"
    assert shown.json_lines("{\n1\n") == "1\n"
    assert shown.journal("{\n[]\n") == ""
    assert interfaces("{") == ""
    deep = json.loads("[" * 60 + "]" * 60)
    assert LEFT_OUT in json.dumps(shown.plain(deep), ensure_ascii=False)
    assert shown.plain({"a": 2**64, "secret1": 1, "b": None}) == {"a": LEFT_OUT, LEFT_OUT: LEFT_OUT}


def test_inputs_of_the_watchdog_keep_their_frames_but_not_texts() -> None:
    lines = [["tick", 1.0], ["frame", 1.0, 0x181, "3716"], ["frame", 1.0, 0x581, b"\x01secret1".hex()]]
    shown = Filter(Words(["tick", "frame"])).json_lines("".join(json.dumps(each) + "\n" for each in lines))
    assert [json.loads(each) for each in shown.splitlines()] == [*lines[:2], ["frame", 1.0, 0x581, "01" + "00" * 7]]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("drive silent", "drive silent"),
        ("drive silent (node 1): 0.11 s", "drive silent (node 1): 0.11 s"),
        ("drive node silent Xy7", f"drive node silent {LEFT_OUT}"),
        ("drive Xy7 silent Xy8", LEFT_OUT),
        ("drive node silent token Xy7", LEFT_OUT),
        ("4711", LEFT_OUT),
        ("drive 123456789012345678", f"drive {LEFT_OUT}"),
        ("drive node silent p@ssw0rd", f"drive node silent {LEFT_OUT}"),
        ("6041h 0x1F can0 2026-11-28T01:02:03.5Z drive", "6041h 0x1F can0 2026-11-28T01:02:03.5Z drive"),
        ("drive node silent passwört", LEFT_OUT),
        ("", ""),
    ],
)
def test_a_line_of_known_words(text: str, shown: str) -> None:
    assert Words(["drive", "silent", "node", "s"]).line(text) == shown


def test_lines_that_are_left_out_in_a_row_are_one() -> None:
    assert Words(["drive"]).lines("drive\nX1\nX2\ndrive\n") == f"drive\n{LEFT_OUT}\ndrive\n"


def test_what_programs_print_is_shown_by_its_form_alone() -> None:
    assert matching(LINES["system/disks.txt"], "/dev/sda1 98G 11G 83G 12% /\n//nas/x 1G 1G 1G 1% /mnt\n") == (
        "/dev/sda1 98G 11G 83G 12% /\n"
    )
    assert matching(LINES["system/kernel.txt"], "Linux 6.1.0-28-rt x86_64\n") == "Linux 6.1.0-28-rt x86_64\n"
    assert unit_status("Id=sshd.service\nActiveState=active\n") == ""
    assert environment({"ROS_DOMAIN_ID": "x", "HOME": "y"}) == f"ROS_DOMAIN_ID={LEFT_OUT}\n"
    asked = {command.file: command.argv for command in commands(Path("r.yaml"), "-1h")}
    assert {f"--property={name}" for name in UNIT_PROPERTIES} < set(asked["units/status.txt"])
    assert "Environment" not in UNIT_PROPERTIES
    assert not {"--lines", "status"} & set(asked["units/status.txt"])
    assert set(asked) <= {*LINES, "journal/canbase.json", "can/interfaces.json", "units/status.txt", "config/check.txt",
                          "doctor.txt"}  # fmt: skip
    assert "PATH" not in VARIABLES
    assert os.environ.get("PATH")
