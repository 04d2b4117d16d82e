"""Good robot.yaml files: what is read from them, and what the effective configuration says of given and default."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import ValidationError

from canbase_config.effective import effective
from canbase_config.errors import ConfigError, key_path
from canbase_config.load import Loaded, leaf_keys, load_robot, sample
from canbase_config.robot import DRIVER_NODE_ID, REMOTE, WATCHDOG_NODE_ID, Robot
from support.robot_files import GOOD, LAST_LINE, write

END = LAST_LINE + 1


def load(folder: Path, changes: dict[int, str]) -> Loaded:
    return load_robot(write(folder, changes))


def marked_as_default(loaded: Loaded) -> list[str]:
    """The stripped lines of the effective configuration that bear the mark."""
    lines = [line.partition("#") for line in effective(loaded).splitlines()]
    return [line.strip() for line, _, comment in lines if comment == " default"]


def test_the_bench_sample_is_the_bench() -> None:
    robot = load_robot(sample("bench")).robot

    assert robot.bus.arguments() == {
        "interface": "udp_multicast",
        "channel": "239.74.163.2",
        "port": 43113,
        "hop_limit": 0,
    }
    assert [(d.node_id, d.side, d.direction, d.gear_ratio, d.counts_per_motor_rev) for d in robot.drives] == [
        (1, "left", 1, 20.0, 4096),
        (2, "right", -1, 20.0, 4096),
    ]
    assert (robot.base.wheel_radius_m, robot.base.track_m) == (0.1, 0.5)
    assert (robot.limits.linear_mps, robot.limits.angular_radps) == (0.8, 2.0)
    assert (robot.safety.scan.required, robot.safety.estop.required) == (False, False)


def test_the_example_for_a_real_bus_demands_scanner_and_stop_button() -> None:
    robot = load_robot(sample("example_can0")).robot

    assert robot.bus.arguments() == {"interface": "socketcan", "channel": "can0"}
    assert (robot.safety.scan.required, robot.safety.estop.required) == (True, True)
    assert robot.lease.socket == "/run/canbase/lease.sock"


def test_object_indexes_and_identities_are_shown_in_hexadecimal_as_in_a_manual(tmp_path: Path) -> None:
    text = sample("bench").read_text(encoding="utf-8")
    added = "    expects: [{index: 24721, sub: 1, value: 20}]\n    identity: {vendor_id: 251}\n"
    file = tmp_path / "robot.yaml"
    file.write_text(re.sub(r"(  - joint: left_wheel.*\n)", rf"\1{added}", text), encoding="utf-8")
    loaded = load_robot(file)
    shown = effective(loaded)
    assert "- index: 0x6091" in shown
    assert "vendor_id: 0xFB" in shown
    assert "value: 20" in shown
    file.write_text(shown, encoding="utf-8")
    assert load_robot(file).robot == loaded.robot


def passes(filters: list[dict[str, int]], cob_id: int) -> bool:
    """Whether the kernel hands on a frame with this 11-bit identifier (linux/can/raw.h, CAN_RAW_FILTER)."""
    return any(cob_id & one["can_mask"] == one["can_id"] & one["can_mask"] for one in filters)


def test_on_socketcan_the_kernel_passes_what_this_robot_sends_and_what_reaches_its_drives_alone() -> None:
    robot = load_robot(sample("example_can0")).robot
    filters = robot.bus_arguments()["can_filters"]

    assert {one["extended"] for one in filters} == {False}
    for node_id in {drive.node_id for drive in robot.drives} | {DRIVER_NODE_ID, WATCHDOG_NODE_ID}:
        assert all(passes(filters, function << 7 | node_id) for function in range(16))
    for broadcast in (0x000, 0x080, 0x100):  # NMT, SYNC, TIME
        assert passes(filters, broadcast)
    assert passes(filters, 0x7E5)  # LSS requests
    assert sum(passes(filters, cob_id) for cob_id in range(0x800)) == 16 * (len(robot.drives) + 3) + 1
    assert not any(passes(filters, REMOTE | cob_id) for cob_id in range(0x800))  # node guarding requests


def test_a_bus_without_filters_in_the_kernel_has_none_and_the_integrators_own_go_before() -> None:
    assert "can_filters" not in load_robot(sample("bench")).robot.bus_arguments()
    robot = load_robot(sample("example_can0")).robot
    own = robot.model_copy(update={"bus": robot.bus.model_copy(update={"extra": {"can_filters": []}})})
    assert own.bus_arguments()["can_filters"] == []


@pytest.mark.parametrize(
    ("rates", "control_hz", "odometry_hz"),
    [
        ("{}", 100.0, 50.0),
        ("{profile: standard}", 100.0, 50.0),
        ("{profile: small_computer}", 50.0, 25.0),
        ("{profile: small_computer, odometry_hz: 20.0}", 50.0, 20.0),
        ("{control_hz: 80.0, profile: small_computer}", 80.0, 25.0),
    ],
)
def test_a_profile_of_rates_gives_the_defaults_and_keys_beside_it_go_before(
    rates: str, control_hz: float, odometry_hz: float, tmp_path: Path
) -> None:
    seen = load(tmp_path, {END: f"rates: {rates}"}).robot.rates

    assert (seen.control_hz, seen.odometry_hz, seen.command_hz) == (control_hz, odometry_hz, 50.0)


def test_the_effective_configuration_says_which_rates_the_profile_gave(tmp_path: Path) -> None:
    lines = marked_as_default(load(tmp_path, {END: "rates: {profile: small_computer}"}))

    assert {"control_hz: 50.0", "odometry_hz: 25.0"} <= set(lines)


COMMENTED_KEY = re.compile(r"^( *)# ( *[a-z_]+:( .*)?)$", re.MULTILINE)


@pytest.mark.parametrize("name", ["bench", "example_can0"])
def test_the_keys_that_a_sample_shows_in_comments_exist(name: str, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    text, count = COMMENTED_KEY.subn(r"\1\2", sample(name).read_text(encoding="utf-8"))
    file.write_text(text, encoding="utf-8")

    assert count >= 4
    assert len(load_robot(file).given) >= len(load_robot(sample(name)).given) + count


def test_an_unknown_sample_is_refused_with_those_that_exist() -> None:
    with pytest.raises(ValueError, match="there is no sample 'roomba', expected one of bench, example_can0"):
        sample("roomba")


def test_what_is_left_out_is_default_and_what_is_written_is_given(tmp_path: Path) -> None:
    loaded = load(tmp_path, {END: "timeouts: {lease_s: 0.25, sdo_s: 0.5}"})

    given = {key_path(loc) for loc in loaded.given}
    defaults = {key_path(loc) for loc in loaded.defaults}
    assert {
        "timeouts.lease_s",
        "timeouts.sdo_s",
        "drives[1].velocity_unit",
        "bus.extra",
    } <= given  # 0.25 is the default too
    assert {"name", "timeouts.command_s", "drives[0].velocity_unit", "drives[1].direction", "bus.bitrate"} <= defaults
    assert given | defaults == {key_path(loc) for loc in leaf_keys(loaded.robot.model_dump())}
    assert not given & defaults


def test_the_effective_configuration_marks_the_defaults_alone(tmp_path: Path) -> None:
    loaded = load(tmp_path, {END: "rates: {control_hz: 100.0}\nlease: {socket: s}", 34: "", 35: ""})
    text = effective(loaded)

    assert "  bitrate: 500000                           # default\n" in text
    assert "  control_hz: 100.0\n" in text
    assert "  odometry_hz: 50.0                         # default\n" in text
    assert "      vendor_id: null                       # default\n" in text
    assert len(marked_as_default(loaded)) == len(loaded.defaults)


def test_an_empty_default_is_marked_too(tmp_path: Path) -> None:
    assert "extra: {}" in marked_as_default(load(tmp_path, {4: ""}))
    assert "extra: {}" not in marked_as_default(load(tmp_path, {}))


@pytest.mark.parametrize("name", ["bench", "example_can0"])
def test_the_effective_configuration_is_a_robot_yaml_in_which_all_is_given(name: str, tmp_path: Path) -> None:
    loaded = load_robot(sample(name))
    file = tmp_path / "effective.yaml"
    file.write_text(effective(loaded), encoding="utf-8")

    again = load_robot(file)

    assert again.robot == loaded.robot
    assert again.defaults == frozenset()
    assert again.given == loaded.given | loaded.defaults


def test_line_ends_in_a_text_survive_the_effective_configuration(tmp_path: Path) -> None:
    loaded = load(tmp_path, {2: r'  interface: "a\nb \t"', 3: r'  channel: "\N"'})  # \N: the next-line character
    file = tmp_path / "effective.yaml"
    file.write_text(effective(loaded), encoding="utf-8")

    assert (loaded.robot.bus.interface, loaded.robot.bus.channel) == ("a\nb \t", "\x85")
    assert load_robot(file).robot == loaded.robot


def test_given_sources_replace_the_default_ones(tmp_path: Path) -> None:
    loaded = load(tmp_path, {END: "mux: {sources: {pad: {topic: pad, priority: 7, timeout_s: 0.1}}}"})

    assert list(loaded.robot.mux.sources) == ["pad"]
    assert {key_path(loc) for loc in loaded.defaults if loc[0] == "mux"} == {
        "mux.sources.pad.type", "mux.sources.pad.stamped", "mux.sources.pad.nodes", "mux.sources.pad.neutral_after_s",
        "mux.sources.pad.same_clock", "mux.locks", "mux.foreign_publishers", "mux.twist_mux",
        "mux.equal_priorities", "mux.twist_mux_timeout_s", "mux.twist_mux_rename",
    }  # fmt: skip


@pytest.mark.parametrize(("source", "after_s"), [
    ("joystick: {topic: a, priority: 7, timeout_s: 0.1}", None),
    ("navigation: {topic: a, priority: 7, timeout_s: 0.1}", 2.0),
    ("action: {topic: a, priority: 7, timeout_s: 0.1}", 2.0),
    ("navigation: {topic: a, priority: 7, timeout_s: 0.1, neutral_after_s: null}", None),
    ("navigation: {topic: a, priority: 7, timeout_s: 0.1, neutral_after_s: 5.0}", 5.0),
    ("joystick: {topic: a, priority: 7, timeout_s: 0.1, neutral_after_s: 1.0}", 1.0),
    ("navigation: {topic: a, type: joint_command, priority: 7, timeout_s: 0.1}", None),
])  # fmt: skip
def test_programs_may_start_without_a_zero_after_a_silence_unless_their_key_says_otherwise(
    tmp_path: Path, source: str, after_s: float | None
) -> None:
    sources = load(tmp_path, {END: f"mux: {{sources: {{{source}}}}}"}).robot.mux.sources
    assert [each.neutral_after_s for each in sources.values()] == [after_s]


@pytest.mark.parametrize("after_s", ["0", "0.45", "61", ".inf"])
def test_no_radio_gap_arms_a_source(tmp_path: Path, after_s: str) -> None:
    text = f"mux: {{sources: {{pad: {{topic: a, priority: 7, timeout_s: 0.1, neutral_after_s: {after_s}}}}}}}"
    with pytest.raises(ConfigError, match="neutral_after_s"):
        load(tmp_path, {END: text})


def test_whole_numbers_do_for_numbers(tmp_path: Path) -> None:
    robot = load(tmp_path, {9: "    gear_ratio: 20", 21: "  linear_mps: 1"}).robot

    assert (robot.drives[0].gear_ratio, robot.limits.linear_mps) == (20.0, 1.0)


def test_hexadecimal_exponents_and_separated_thousands(tmp_path: Path) -> None:
    robot = load(
        tmp_path, {2: "  interface: pcan\n  bitrate: 250_000", 7: "    node_id: 0x7D", 9: "    gear_ratio: 2e1"}
    ).robot

    assert (robot.bus.bitrate, robot.drives[0].node_id, robot.drives[0].gear_ratio) == (250_000, 125, 20.0)


def test_a_drive_that_takes_over_another_one_with_an_anchor(tmp_path: Path) -> None:
    merged = "  - {<<: *left, joint: right_wheel, node_id: 2, side: right}"
    changes = dict.fromkeys(range(12, 17), "") | {6: "  - &left\n    joint: left_wheel", 11: merged}
    loaded = load(tmp_path, changes)

    assert [d.joint for d in loaded.robot.drives] == ["left_wheel", "right_wheel"]
    assert ("drives", 1, "gear_ratio") in loaded.given
    assert ("drives", 1, "velocity_unit") in loaded.defaults


def test_a_date_in_the_extra_arguments_stays_text(tmp_path: Path) -> None:
    assert load(tmp_path, {4: "  extra: {since: 2001-01-01}"}).robot.bus.extra == {"since": "2001-01-01"}


def test_a_byte_order_mark_and_the_line_ends_of_windows_do_no_harm(tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    file.write_bytes(b"\xef\xbb\xbf" + GOOD.replace("\n", "\r\n").encode())

    assert load_robot(file).robot == load(tmp_path, {}).robot


def test_a_robot_cannot_be_changed_after_loading(tmp_path: Path) -> None:
    robot: Robot = load(tmp_path, {}).robot

    with pytest.raises(ValidationError, match="frozen"):
        robot.limits.linear_mps = 9.0
