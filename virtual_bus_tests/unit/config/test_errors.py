"""Broken robot.yaml files: what the user reads. Line numbers are those of `robot_files.GOOD`."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from canbase_cli.main import app
from canbase_config.errors import ConfigError, key_path
from canbase_config.load import load_robot
from support.robot_files import LAST_LINE, write

END = LAST_LINE + 1

BROKEN: dict[str, tuple[dict[int, str], str]] = {
    "below the range": (
        {9: "    gear_ratio: -20.0"},
        ":9: drives[0].gear_ratio: got -20.0, expected a number > 0 and <= 10000 "
        "(motor revolutions per wheel revolution)",
    ),
    "zero where a timeout is wanted": (
        {END: "timeouts: {command_s: 0}"},
        ":36: timeouts.command_s: got 0, expected a number >= 0.05 and <= 0.5 (cmd_vel at the driver [s])",
    ),
    "just above the range": (
        {12: "    node_id: 126"},
        ":12: drives[1].node_id: got 126, expected a whole number >= 1 and <= 125 "
        "(CANopen node id; 126 and 127 are used by canbase)",
    ),
    "not a number": (
        {18: "  wheel_radius_m: .nan"},
        ":18: base.wheel_radius_m: got .nan, expected a number > 0.005 and <= 1 [m]",
    ),
    "infinity": (
        {21: "  linear_mps: .inf"},
        ":21: limits.linear_mps: got .inf, expected a number > 0 and <= 5 [m/s]",
    ),
    "a bool is no number": (
        {18: "  wheel_radius_m: true"},
        ":18: base.wheel_radius_m: got true, expected a number > 0.005 and <= 1 [m]",
    ),
    "a number with its unit": (
        {18: "  wheel_radius_m: 10 cm"},
        ':18: base.wheel_radius_m: got "10 cm", expected a number > 0.005 and <= 1 [m]\n'
        "    write the number alone: no quotes, no unit, a point for the decimals",
    ),
    "a whole number with decimals": (
        {7: "    node_id: 1.0"},
        ":7: drives[0].node_id: got 1.0, expected a whole number >= 1 and <= 125 "
        "(CANopen node id; 126 and 127 are used by canbase)\n    write 1",
    ),
    "a word of YAML 1.1": (
        {31: "    required: no"},
        ':31: safety.scan.required: got "no", expected true or false (true: without a fresh scan nothing moves; '
        "false: blind_mps where it looked)\n"
        "    YAML 1.2 knows no other words for it, and no quotes around them",
    ),
    "a number where text is wanted": (
        {3: "  channel: 0"},
        ":3: bus.channel: got 0, expected text, not empty (can0, or the multicast group of a virtual bus)\n"
        '    write it in quotes: "0"',
    ),
    "a choice with a slip": (
        {16: "    velocity_unit: 0.1 rpm"},
        ':16: drives[1].velocity_unit: got "0.1 rpm", expected one of rpm, 0.1rpm, 0.001rpm, rev/s, 0.001rev/s, '
        "counts/s, 0.1counts/s, counts/ms/16384, counts/ms/65536 (one bit of 60FFh and 606Ch, at the motor shaft; "
        "default: the profile's)\n    did you mean 0.1rpm?",
    ),
    "a name with a blank": (
        {6: "  - joint: left wheel"},
        ':6: drives[0].joint: got "left wheel", expected text of letters, digits and _, first a letter, '
        "at most 64 characters (name in joint_states)",
    ),
    "a key with a slip": (
        {END: "rates: {contol_hz: 100}"},
        ":36: rates.contol_hz: unknown key\n    did you mean control_hz?",
    ),
    "a key of another section": (
        {19: "  track_m: 0.5\n  jerk_mps3: 5.0"},
        ":20: base.jerk_mps3: unknown key\n    jerk_mps3 belongs in limits",
    ),
    "a key of the drives": (
        {19: "  track_m: 0.5\n  direction: -1"},
        ":20: base.direction: unknown key\n    direction belongs in drives[…]",
    ),
    "a section indented by mistake": (
        {19: "  track_m: 0.5\n  rates: {control_hz: 50}"},
        ":20: base.rates: unknown key\n    rates belongs in the top level (not indented)",
    ),
    "a slip in a key of another section": (
        {19: "  track_m: 0.5\n  jerk_mps: 5.0"},
        ":20: base.jerk_mps: unknown key\n    did you mean jerk_mps3, which belongs in limits?",
    ),
    "a key from nowhere": (
        {35: "  socket: /tmp/lease.sock\n  colour: red"},
        ":36: lease.colour: unknown key\n    the keys here are socket, uid",
    ),
    "a key of a free section inside": (
        {3: "  channel: can0\n  port: 43113"},
        ":4: bus.port: unknown key\n    did you mean bus.extra.port? the keys here are interface, channel, bitrate, "
        "sync_counter, extra",
    ),
    "a missing key": (
        {19: ""},
        ":17: base.track_m: missing, expected a number > 0.02 and <= 5 "
        "(distance between the wheels' contact points [m])",
    ),
    "a missing section": (
        {34: "", 35: ""},
        ": lease: missing, expected a section with socket",
    ),
    "an empty section": (
        {35: ""},
        ":34: lease: got nothing, expected a section with socket",
    ),
    "a value instead of a section": (
        {END: "rates: 50"},
        ":36: rates: got 50, expected a section with some of profile, control_hz, odometry_hz, status_hz, command_hz",
    ),
    "one drive": (
        dict.fromkeys(range(11, 17), ""),
        ":5: drives: got a list of 1 entry, expected a list of 2 to 8 entries (one for each driven wheel)",
    ),
    "two drives on one node and axis": (
        {12: "    node_id: 1"},
        ":12: drives[1].node_id: two drives are on node 1, axis 0; each needs its own",
    ),
    "two drives with one joint": (
        {11: "  - joint: left_wheel"},
        ":11: drives[1].joint: two drives have the joint left_wheel; each needs its own",
    ),
    "all drives on one side": (
        {13: "    side: left"},
        ":13: drives[1].side: all drives are on the left; a base needs at least one on each side",
    ),
    "two sources of one priority": (
        {
            END: "mux:\n  sources:\n    a: {topic: x, priority: 1, timeout_s: 0.1}\n"
            "    b: {topic: y, priority: 1, timeout_s: 0.1}"
        },
        ":39: mux.sources.b.priority: sources a and b have the same priority; each needs its own, or set "
        "equal_priorities: by_name",
    ),
    "two sources on one topic": (
        {
            END: "mux:\n  sources:\n    a: {topic: x, priority: 1, timeout_s: 0.1}\n"
            "    b: {topic: x, priority: 2, timeout_s: 0.1}"
        },
        ":39: mux.sources.b.topic: sources a and b have the same topic; each needs its own",
    ),
    "two sources on one topic, once with a slash": (
        {
            END: "mux:\n  sources:\n    a: {topic: x, priority: 1, timeout_s: 0.1}\n"
            "    b: {topic: /x, priority: 2, timeout_s: 0.1}"
        },
        ":39: mux.sources.b.topic: sources a and b have the same topic; each needs its own",
    ),
    "a lock on the topic of a source, once with a slash": (
        {
            END: "mux:\n  sources:\n    a: {topic: /x, priority: 1, timeout_s: 0.1}\n"
            "  locks:\n    b: {topic: x, priority: 2}"
        },
        ":40: mux.locks.b.topic: x is the topic of a source too; a lock needs one of its own",
    ),
    "wheel speeds without a header": (
        {END: "mux:\n  sources:\n    a: {topic: x, type: joint_command, priority: 1, timeout_s: 0.1, stamped: false}"},
        ":38: mux.sources.a.stamped: a JointState always has a header; leave stamped out",
    ),
    "wheel speeds that need no zero": (
        {
            END: "mux:\n  sources:\n    a: {topic: x, type: joint_command, priority: 1, timeout_s: 0.1, "
            "neutral_after_s: 2.0}"
        },
        ":38: mux.sources.a.neutral_after_s: a joint_command publishes zero while nothing is ordered; only that may "
        "arm it: leave it out",
    ),
    "a source that is absent while it is active": (
        {END: "mux:\n  sources:\n    a: {topic: x, priority: 1, timeout_s: 2.0, neutral_after_s: 1.0}"},
        ":38: mux.sources.a.neutral_after_s: without a message the source is active for timeout_s (2); only then is "
        "it absent: neutral_after_s (1) must not be less",
    ),
    "the measured wheel speeds as a source": (
        {END: "mux:\n  sources:\n    a: {topic: /joint_states, type: joint_command, priority: 1, timeout_s: 0.1}"},
        ":38: mux.sources.a.topic: /joint_states is an output of this robot; a source needs another topic "
        "(mux.twist_mux_rename renames that of a twist_mux file)",
    ),
    "a source of an unknown type": (
        {END: "mux:\n  sources:\n    a: {topic: x, type: joints, priority: 1, timeout_s: 0.1}"},
        ':38: mux.sources.a.type: got "joints", expected one of twist, joint_command (twist: velocities of '
        "the base; joint_command: JointState, wheel speeds of ros2_control)",
    ),
    "a source with a strange name": (
        {END: "mux:\n  sources:\n    my joystick: {topic: x, priority: 1, timeout_s: 0.1}"},
        ':38: mux.sources.my joystick: got the name "my joystick", expected letters, digits and _, first a letter, '
        "at most 64 characters",
    ),
    "no source": (
        {END: "mux:\n  sources: {}"},
        ":37: mux.sources: got an empty section, expected a section with at least one entry",
    ),
    "an emergency stop that is the gentler one": (
        {25: "  emergency_deceleration_mps2: 0.9"},
        ":25: limits.emergency_deceleration_mps2: 0.9 must not be below deceleration_mps2, 1.0",
    ),
    "stopping before slowing, the one given and the other a default": (
        {33: "    required: false\n  stop_distance_m: 0.6"},
        ":34: safety.stop_distance_m: slow_distance_m (0.6) must be greater than stop_distance_m (0.6)",
    ),
    "a maximum that is not above its minimum": (
        {END: "action: {min_speed_mps: 0.5}"},
        ":36: action.min_speed_mps: max_speed_mps (0.5) must be greater than min_speed_mps (0.5)",
    ),
    "an argument of the bus given twice": (
        {4: "  extra: {channel: can1}"},
        ":4: bus.extra.channel: channel is a key of bus itself; extra only adds arguments",
    ),
    "feedback that is shorter than a few cycles": (
        {END: "timeouts: {feedback_s: 0.039}"},
        ":36: timeouts.feedback_s: timeouts.feedback_s (0.039) is too little for a status TPDO after each SYNC: "
        "at least 0.05 (4 / rates.control_hz + 0.01), or change rates.control_hz",
    ),
    "cycles that are longer than a few heartbeats": (
        {END: "rates: {control_hz: 20.0}\ntimeouts: {feedback_s: 0.21, drive_heartbeat_s: 0.19}"},
        ":37: timeouts.drive_heartbeat_s: timeouts.drive_heartbeat_s (0.19) is too little for heartbeats at the "
        "drives, 3 in this time, each sent in a control cycle: at least 0.21 (4 / rates.control_hz + 0.01), or change "
        "rates.control_hz",
    ),
    "a key that is a number": (
        {4: "  extra: {1: 2}"},
        ':4: bus.extra: the key 1 is no text\n    put it in quotes: "1"',
    ),
    "a key given twice": (
        {21: "  linear_mps: 0.8\n  linear_mps: 0.9"},
        ":22: linear_mps: this key is already given above in the same section\n    keep one",
    ),
    "a tab": (
        {2: "\tinterface: virtual"},
        ":2: not YAML: while scanning for the next token, found character '\\t' that cannot start any token\n"
        "    the line has a tab; YAML is indented with spaces",
    ),
    "two colons in a line": (
        {3: "  channel: a: b"},
        ":3: not YAML: mapping values are not allowed here\n    in or before the line: channel: a: b",
    ),
    "an open bracket": (
        {END: "rates: {"},
        ":37: not YAML: while parsing a flow node, expected the node content, but found '<stream end>'\n"
        "    a bracket or a quote may not be closed",
    ),
    "two documents": (
        {END: "---\nname: other"},
        ":36: not YAML: expected a single document in the stream, but found another document\n"
        "    in or before the line: ---",
    ),
    "an object of another language": (
        {3: "  channel: !!python/name:os.system"},
        ":3: not YAML: could not determine a constructor for the tag 'tag:yaml.org,2002:python/name:os.system'\n"
        "    in or before the line: channel: !!python/name:os.system",
    ),
    "a set, which JSON does not have": (
        {4: "  extra: !!set {a, b}"},
        ":4: not YAML: could not determine a constructor for the tag 'tag:yaml.org,2002:set'\n"
        "    in or before the line: extra: !!set {a, b}",
    ),
    "an alias that contains itself": (
        {4: "  extra: &x {again: *x}"},
        ":4: an alias (*name) contains itself",
    ),
    "a control character": (
        {3: "  channel: a\x07"},
        ":3: not YAML: the character U+0007 is not allowed",
    ),
}


@pytest.mark.parametrize(("changes", "expected"), BROKEN.values(), ids=BROKEN)
def test_one_mistake_gives_one_helpful_error_and_exit_code_2(
    tmp_path: Path, changes: dict[int, str], expected: str
) -> None:
    file = write(tmp_path, changes)

    result = CliRunner().invoke(app, ["config", "check", str(file)])

    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr == f"{file}{expected}\ncanbase: {file} cannot be used: 1 problem\n"


WHOLE_FILES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", ": is empty\n    begin with a copy of a sample, such as example_can0.yaml"),
    "comments alone": (b"# soon\n", ": is empty\n    begin with a copy of a sample, such as example_can0.yaml"),
    "a list": (b"- 1\n", ":1: found a list, expected keys with values, as in `name: robot` with its space"),
    "no space after the colon": (
        b"name:robot\n",
        ":1: found only the value 'name:robot', expected keys with values, as in `name: robot` with its space",
    ),
    "Latin-1": (b"name: robot\n# \xe4\n", ":2: byte E4h is no UTF-8\n    save the file in the encoding UTF-8"),
    "deep": (b"[" * 5000, ":1: nested too deeply: more than 32 levels"),
}


@pytest.mark.parametrize(("content", "expected"), WHOLE_FILES.values(), ids=WHOLE_FILES)
def test_a_file_that_is_no_robot_at_all(tmp_path: Path, content: bytes, expected: str) -> None:
    file = tmp_path / "robot.yaml"
    file.write_bytes(content)

    with pytest.raises(ConfigError) as caught:
        load_robot(file)

    assert str(caught.value) == f"{file}{expected}"


def test_all_mistakes_are_told_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    file = write(
        tmp_path, {9: "    gear_ration: 20.0", 19: "", 25: "  emergency_deceleration_mps2: 0.9", 34: "", 35: ""}
    )

    with pytest.raises(ConfigError) as caught:
        load_robot(file)

    assert [(problem.line, problem.key, problem.what) for problem in caught.value.problems] == [
        (None, "lease", "missing"),
        (6, "drives[0].gear_ratio", "missing"),
        (9, "drives[0].gear_ration", "unknown key"),
        (17, "base.track_m", "missing"),
        (24, "limits.emergency_deceleration_mps2", "0.9 must not be below deceleration_mps2, 1.0"),
    ]
    assert str(caught.value).count("\n") == 5  # a line each, and the hint of the unknown key


def test_the_parts_of_an_error_are_there_for_programs(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        load_robot(write(tmp_path, {END: "rates: {contol_hz: 100}"}))

    (problem,) = caught.value.problems
    assert (problem.file, problem.line, problem.key) == (str(tmp_path / "robot.yaml"), 36, "rates.contol_hz")
    assert (problem.what, problem.expected, problem.hint) == ("unknown key", "", "did you mean control_hz?")


def test_a_missing_file_with_a_neighbour_of_nearly_its_name(tmp_path: Path) -> None:
    write(tmp_path, {})

    with pytest.raises(ConfigError) as caught:
        load_robot(tmp_path / "robto.yaml")

    assert str(caught.value) == f"{tmp_path}/robto.yaml: no such file\n    did you mean {tmp_path}/robot.yaml?"


def test_a_missing_file_without_a_neighbour(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file\n    looked for it at /"):
        load_robot(tmp_path / "robot.yaml")


def test_a_missing_folder(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no such file\n    the folder .*/gone does not exist either"):
        load_robot(tmp_path / "gone" / "robot.yaml")


def test_a_folder_instead_of_a_file(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is a folder, expected a YAML file"):
        load_robot(tmp_path)


def test_a_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: Path, _flags: int) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("canbase_config.bounded_file.os.open", refuse)

    with pytest.raises(ConfigError, match="cannot be read: Permission denied"):
        load_robot(tmp_path / "robot.yaml")


def test_key_paths_are_written_as_people_write_them() -> None:
    assert key_path(("drives", 1, "gear_ratio")) == "drives[1].gear_ratio"
    assert key_path(()) == ""
