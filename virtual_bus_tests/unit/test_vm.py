"""The virtual robot without a guest: what is said of its results, its serial adapter, how a standstill is measured."""

from __future__ import annotations

import json
from pathlib import Path

import can
import pytest

from vm import table
from vm.guest.slcan_adapter import frame_of, line_of
from vm.guest.standstill import standstill
from vm.overlay import robot_yaml

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


def left(job: Path, failure: str = "", *, ended: bool = True) -> list[table.Result]:
    job.mkdir()
    told = {"name": "driver SIGKILL", "failure": failure, "took_s": 10.4, "row": None if failure else ROW}
    (job / "rows.jsonl").write_text(json.dumps(told) + "\n")
    if ended:
        (job / "code").write_text("0")
    return table.results(job)


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "stop_times.md"
    path.write_text(PAGE)
    monkeypatch.setattr(table, "PAGE", path)
    return path


def test_all_as_promised_is_a_table(tmp_path: Path, page: Path) -> None:
    assert table.report(left(tmp_path / "job"), 60.0, complete=True) == 0

    line = "| canbase-driver | SIGKILL | drives: heartbeat lost | 0.45 s | 103 mm | 0.75 s | – | no power until reset |"
    assert line in page.read_text().splitlines()


def test_some_scenarios_alone_change_no_page(tmp_path: Path, page: Path) -> None:
    assert table.report(left(tmp_path / "job"), 60.0, complete=False) == 0

    assert page.read_text() == PAGE


@pytest.mark.parametrize(("failure", "ended"), [("stood after 0.8 s", True), ("", False)])
def test_a_scenario_that_failed_and_a_guest_that_died_change_no_page(
    tmp_path: Path, page: Path, capsys: pytest.CaptureFixture[str], failure: str, ended: bool
) -> None:
    assert table.report(left(tmp_path / "job", failure, ended=ended), 60.0, complete=True) == 1

    assert page.read_text() == PAGE
    assert (failure or "the guest died") in capsys.readouterr().out


def test_no_result_is_no_success(page: Path) -> None:
    assert table.report([], 60.0, complete=True) == 1


def test_robot_and_drives_are_on_two_controllers() -> None:
    robot, drives = robot_yaml("can0", "/run/canbase/robot/lease.sock"), robot_yaml("can1", "/run/lease.sock")

    assert "channel: can0" in robot
    assert "channel: can1" in drives
    assert "required: true" not in robot
