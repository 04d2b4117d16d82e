"""The virtual robot without a guest: what is said of its results, its serial adapter, how a standstill is measured."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Sequence
from pathlib import Path

import can
import pytest

from canbase_config.load import load_robot
from vm import independent_stacks, table
from vm.guest.candump import boot_s, samples, speed
from vm.guest.joystick import order_of
from vm.guest.main import ALL, FIRST, SECOND, SHORT, bounded, names, shared_out
from vm.guest.slcan_adapter import frame_of, line_of
from vm.guest.standstill import standstill
from vm.guest.system import BrokenPromiseError
from vm.overlay import overlay, robot_yaml
from vm.patience import Patience

ROW = {
    "what": "canbase-driver",
    "how": "SIGKILL",
    "caught": "drives: heartbeat lost",
    "stands_s": 0.4476,
    "way_m": 0.1034,
    "limit_s": 0.75,
    "again_s": None,
    "then": "no power until reset",
}
PAGE = "# Title\n<!-- make vm-test: begin -->\n<!-- make vm-test: end -->\n"


def row(number: int, rim_mps: float) -> tuple[float, float, float, float, float, float]:
    """One sample of the trace; 100 of them are a second."""
    return (10.0 + number * 0.01, number * 0.002, 0.0, 0.0, rim_mps, 0.0)


def test_wheels_stand_after_the_last_sample_that_moves() -> None:
    stop = standstill([row(0, 0.3), row(1, 0.006), row(2, 0.004)], 9.99)

    assert stop.after_s == pytest.approx(0.02)
    assert stop.way_m == pytest.approx(0.004)


def test_wheels_that_stood_already_took_no_time() -> None:
    assert standstill([row(0, 0.0), row(1, 0.0)], 10.0).after_s == 0.0


def test_a_wheel_that_turns_backward_moves() -> None:
    assert standstill([row(0, -0.3), row(1, -0.3)], 10.0).after_s == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("line", "identifier", "data"),
    [
        (b"t0000", 0, b""),
        (b"t20181122334455667788", 0x201, bytes.fromhex("1122334455667788")),
        (b"t7FF10A", 0x7FF, b"\n"),
    ],
)
def test_a_line_is_a_frame_and_a_frame_a_line(line: bytes, identifier: int, data: bytes) -> None:
    frame = frame_of(line)

    assert frame is not None
    assert (frame.arbitration_id, bytes(frame.data), frame.is_extended_id) == (identifier, data, False)
    assert line_of(frame) == line + b"\r"


@pytest.mark.parametrize("command", [b"", b"O", b"S6", b"C"])
def test_a_command_is_no_frame(command: bytes) -> None:
    assert frame_of(command) is None


def test_a_frame_of_the_bus_is_written_in_capital_digits() -> None:
    assert line_of(can.Message(arbitration_id=0x18A, is_extended_id=False, data=b"\xab")) == b"t18A1AB\r"


def told(name: str, failure: str = "") -> table.Result:
    return {"name": name, "failure": failure, "took_s": 10.4, "row": None if failure else ROW}


def left(job: Path, *lines: str, wanted: Sequence[str] = (), ended: str = "", alive: bool = True) -> list[table.Result]:
    """`alive`: the guest has come to its end."""
    job.mkdir()
    (job / "out.txt").write_text("".join(f"{line}\n" for line in lines))
    if alive:
        (job / "code").write_text("0")
    return table.results(job, wanted, ended)


def test_results_are_read_from_the_live_output(tmp_path: Path) -> None:
    line = json.dumps(told("driver SIGKILL"))

    assert left(tmp_path / "job", "@host device_del", line, line[:20].replace("name", "nome")) == [
        told("driver SIGKILL")
    ]


def test_all_as_promised_is_success() -> None:
    assert table.report([told("goal"), told("freeze")], 60.0, {}) == 0


@pytest.mark.parametrize(("lines", "alive"), [([told("goal", "stood too late")], True), ([told("goal")], False)])
def test_a_scenario_that_failed_and_a_guest_that_died_are_failures(
    tmp_path: Path, lines: list[table.Result], alive: bool
) -> None:
    assert table.report(left(tmp_path / "job", *map(json.dumps, lines), alive=alive), 60.0, {}) == 1


def test_a_scenario_that_came_to_no_end_is_a_failure_and_so_is_one_that_was_never_reached(tmp_path: Path) -> None:
    lines = ["@begin goal", json.dumps(told("goal")), "@begin freeze"]

    found = left(tmp_path / "job", *lines, wanted=["goal", "freeze", "reboot"], ended="silent for 420 s", alive=False)

    assert [(result["name"], result["failure"]) for result in found] == [
        ("goal", ""),
        ("freeze", "began and came to no end: silent for 420 s"),
        ("reboot", "was not reached: silent for 420 s"),
        ("job", "the guest died: silent for 420 s"),
    ]


def test_the_last_words_of_a_guest_are_the_ends_of_what_it_has_said(tmp_path: Path) -> None:
    left(tmp_path / "job", *(f"line {i}" for i in range(100)))

    words = table.last_words(tmp_path / "job").splitlines()

    assert words[0].endswith("out.txt")
    assert (words[1], words[-1], len(words)) == ("line 75", "line 99", 26)


def test_a_scenario_that_takes_too_long_is_ended_by_the_guest_itself() -> None:
    with pytest.raises(BrokenPromiseError, match="goal was not through in 90 s"), bounded("goal"):
        signal.raise_signal(signal.SIGALRM)


def test_a_guest_that_is_silent_too_long_is_waited_for_no_longer() -> None:
    patience = Patience(1000.0)

    said = [(0, 1420.0), (10, 1420.1), (10, 1840.0), (10, 1840.2)]

    assert [patience.over(length, now_s) for length, now_s in said] == ["", "", "", "silent for 420 s on this computer"]


def test_a_guest_that_talks_for_ever_is_not_waited_for_either() -> None:
    patience = Patience(1000.0)

    assert [patience.over(now_s, 1000.0 + now_s) for now_s in range(0, 1801, 100)] == [""] * 19
    assert patience.over(1801, 2800.1) == "not through after 1800 s on this computer"


def test_no_result_is_no_success() -> None:
    assert table.report([], 60.0, {}) == 1


@pytest.fixture
def page(tmp_path: Path) -> Path:
    path = tmp_path / "stop_times.md"
    path.write_text(PAGE)
    return path


CELLS = "canbase-driver | SIGKILL | drives: heartbeat lost | 0.45 s | 103 mm | 0.75 s | – | no power until reset"
LINE = f"{CELLS} | 2026-11-2"


def written(page: Path, today: str, *found: table.Result) -> list[str]:
    """The rows of the page after a run on that day."""
    table.write(page, found, ["goal", "freeze", "reboot"], f"2026-11-{today}")
    return page.read_text().splitlines()[4:-1]


def test_a_run_of_some_scenarios_leaves_the_other_rows_alone(page: Path) -> None:
    assert written(page, "20", told("reboot"), told("goal")) == [f"| goal | {LINE}0 |", f"| reboot | {LINE}0 |"]

    assert written(page, "21", told("reboot")) == [f"| goal | {LINE}0 |", f"| reboot | {LINE}1 |"]


def test_a_new_scenario_gets_its_place_in_the_order_of_all(page: Path) -> None:
    written(page, "20", told("reboot"), told("goal"))

    assert [line[:10] for line in written(page, "21", told("freeze"))] == ["| goal | c", "| freeze |", "| reboot |"]


def test_what_fails_now_keeps_its_figures_and_says_so_until_it_passes(page: Path) -> None:
    written(page, "20", told("goal"))

    assert written(page, "21", told("goal", "late")) == [f"| goal | {LINE}0; failed 2026-11-21 |"]
    assert written(page, "22", told("goal", "late")) == [f"| goal | {LINE}0; failed 2026-11-22 |"]
    assert written(page, "23", told("goal")) == [f"| goal | {LINE}3 |"]


def test_what_never_passed_is_told_as_well(page: Path) -> None:
    assert written(page, "20", told("goal", "late")) == [f"| goal |{' – |' * 8} –; failed 2026-11-20 |"]


def test_a_guest_that_died_is_no_scenario_and_a_row_of_no_scenario_goes(page: Path) -> None:
    table.write(page, [told("gone")], ["gone"], "2026-11-20")

    assert written(page, "21", told("job-1", "the guest died"), told("goal")) == [f"| goal | {LINE}1 |"]


def test_robot_and_drives_are_on_two_controllers() -> None:
    robot, drives = robot_yaml("can0", "/run/canbase/robot/lease.sock"), robot_yaml("can1", "/run/lease.sock")

    assert "channel: can0" in robot
    assert "channel: can1" in drives
    assert "required: true" not in robot


def test_the_guests_robot_has_the_domain_of_the_scenarios_whatever_the_developer_uses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "63")

    overlay(tmp_path)

    installed = (tmp_path / "overlay/etc/canbase/robot.env").read_text()
    assert "ROS_DOMAIN_ID=0" in installed


def test_the_guests_robot_gets_power_although_nobody_commissions_it(tmp_path: Path) -> None:
    path = tmp_path / "robot.yaml"
    path.write_text(robot_yaml("can0", "/run/canbase/robot/lease.sock"))

    assert not load_robot(path).robot.safety.require_self_stop


def test_words_choose_scenarios_in_the_order_of_the_table() -> None:
    assert names(["freeze", "driver SIG"]) == ["driver SIGKILL", "driver SIGSTOP", "freeze"]


@pytest.mark.parametrize(("line", "order_mps"), [("0.3", 0.3), ("-0.1", -0.1), ("0.0", 0.0), ("none", None)])
def test_the_joystick_is_told_a_velocity_or_to_let_go(line: str, order_mps: float | None) -> None:
    assert order_of(line) == order_mps


def test_a_name_means_itself_alone() -> None:
    assert names(["goal"]) == ["goal"]


def test_no_word_means_all_of_them() -> None:
    assert names([]) == list(ALL)
    assert names(["first"]) + names(["second"]) == list(ALL)


DUMP = """(10.000000) vcan0 080#
(10.000100) vcan0 181#2706E8030000
(10.000200) vcan0 182#27060000FFFF
(10.000300) vcan0 281#10270000
(10.500100) vcan0 181#2706E0070000
(11.000100) vcan0 181#3702E00B0000
(11.000100) vcan0 181#37
(11."""


def test_positions_of_a_drive_are_read_from_what_candump_has_written_so_far() -> None:
    found = samples(DUMP.splitlines(), 1)

    assert [(sample.time_s, sample.status, sample.position) for sample in found] == [
        (10.0001, 0x0627, 1000),
        (10.5001, 0x0627, 2016),
        (11.0001, 0x0237, 3040),
    ]
    assert [sample.position for sample in samples(DUMP.splitlines(), 2)] == [-65536]


def test_the_speed_of_a_drive_is_that_of_the_last_samples() -> None:
    found = samples(DUMP.splitlines(), 1)

    assert speed(found, 1.0) == pytest.approx(2040.0)
    assert speed(found, 0.6) == pytest.approx(2048.0)
    assert speed(found, 0.1) == speed(found[:1], 1.0) == speed([], 1.0) == 0.0


BOOT = """(10.000000) vcan0 181#3706E8030000
(10.100000) vcan0 77F#05
(10.100300) vcan0 601#4041600000000000
(10.150000) vcan0 181#5002E8030000
(10.220000) vcan0 181#3706E8030000
(10.240000) vcan0 182#270600000000
(10.300000) vcan0 182#270600000000"""


def test_a_boot_takes_from_the_drivers_first_heartbeat_until_the_last_drive_is_enabled() -> None:
    assert boot_s(BOOT.splitlines(), [1, 2]) == pytest.approx(0.14)
    assert boot_s(BOOT.splitlines(), [1]) == pytest.approx(0.12)


def test_a_drive_that_is_not_enabled_has_no_boot_and_neither_has_a_bus_without_a_driver() -> None:
    assert boot_s(BOOT.splitlines()[:5], [1, 2]) == math.inf
    assert boot_s([line for line in BOOT.splitlines() if " 77F#" not in line], [1, 2]) == math.inf


def test_scenarios_with_programs_of_other_authors_are_skipped_with_the_remedy_where_nobody_provides_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    skipped = independent_stacks.skipped(names(["CANopenNode", "goal"]), None)

    assert list(skipped) == ["CANopenNode"]
    assert table.report([told("goal")], 60.0, skipped) == 0
    assert capsys.readouterr().out.splitlines()[-1] == (
        "SKIPPED, nothing is known of it: CANopenNode: CANBASE_INDEPENDENT_STACKS names no folder with "
        "canopend: docs/verification.md"
    )


def test_a_folder_without_one_of_the_programs_is_told_which_one(tmp_path: Path) -> None:
    (tmp_path / "cia402_slave").touch()

    skipped = independent_stacks.skipped(ALL, tmp_path)

    assert skipped["drives of ros2_canopen"] == f"{tmp_path} has no cia402_slave.eds: docs/verification.md"


def test_programs_of_other_authors_that_are_there_go_into_the_guest_and_nothing_else_does(tmp_path: Path) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    for name in ("canopend", "a_core_dump"):
        (programs / name).write_text(name)

    independent_stacks.copy_to(programs, tmp_path / "guest")

    assert "CANopenNode" not in independent_stacks.skipped(ALL, programs)
    assert [path.name for path in (tmp_path / "guest").iterdir()] == ["canopend"]


def test_only_skipped_scenarios_boot_no_guest_and_are_no_success() -> None:
    skipped = {"CANopenNode": "nobody provides it"}

    assert shared_out([], 1) == shared_out([], 2) == []
    assert table.report([], 0.0, skipped) == 1


def test_every_scenario_that_needs_such_a_program_is_one() -> None:
    assert set(independent_stacks.FILES) <= set(ALL)


def test_a_word_that_means_none_is_told_what_there_is() -> None:
    with pytest.raises(BrokenPromiseError, match="no scenario is called unpluged; there are: cold boot, goal"):
        names(["unpluged"])


def test_two_guests_share_what_is_wanted_and_one_has_all_of_it() -> None:
    assert shared_out(["goal", "freeze"], 2) == [["goal"], ["freeze"]]
    assert shared_out(["goal", "unplugged"], 2) == [["goal", "unplugged"]]
    assert shared_out(["goal", "freeze"], 1) == [["goal", "freeze"]]


def test_the_short_group_has_scenarios_of_both_guests() -> None:
    assert names(["short"]) == list(SHORT)
    assert len(shared_out(SHORT, 2)) == 2


@pytest.mark.parametrize("part", ["watchdog", "driver", "velocity", "action-server"])
def test_every_unit_is_killed_hung_stopped_and_restarted(part: str) -> None:
    assert {f"{part} SIGKILL", f"{part} SIGSTOP"} <= set(FIRST)
    assert {f"stop {part}", f"restart {part}"} <= set(SECOND)


def test_what_takes_the_guest_down_comes_last() -> None:
    assert list(ALL)[-2:] == ["reboot", "freeze"]
