"""The exit matrix without a robot: its rows are complete, its limits follow from robot.yaml, and a row can fail."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_campaign.twins import MEASURED
from canbase_config.load import load_robot, sample
from canbase_config.robot import Robot
from exit_matrix import stop_limits
from exit_matrix.failures import ROWS
from exit_matrix.report import merged
from exit_matrix.runner import Result, judge
from exit_matrix.stop_limits import Layer
from exit_matrix.stop_table import COMMANDS, TABLE
from support.marked_page import rewritten
from support.running_robot import Standstill

PROCESSES = ("motor_driver", "velocity process", "watchdog", "drive_distance_server", "client")
HOW = ("SIGINT", "SIGTERM", "SIGKILL", "SIGSTOP", "exception", "busy loop")
ROW = next(row for row in ROWS if row.name == "motor_driver: SIGKILL")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot(sample("bench")).robot


def test_every_process_has_a_row_for_every_way_out() -> None:
    names = [row.name for row in ROWS]
    assert {f"{process}: {how}" for process in PROCESSES for how in HOW} <= set(names)
    assert len(set(names)) == len(names)


def test_orders_on_cmd_vel_meet_the_latches_of_driver_watchdog_and_drives_and_no_others() -> None:
    latched = {row.name for row in ROWS if row.latched_behind_filter}
    assert {"motor_driver: SIGKILL", "watchdog: SIGSTOP", "velocity process: SIGKILL", "drive: in fault"} <= latched
    assert not latched & {"velocity process: SIGTERM", "scan: stale", "emergency stop: pressed", "joystick: dies"}


@pytest.mark.parametrize(
    ("layer", "limit_s"),
    [
        (stop_limits.DRIVES, 0.25 + 0.3 + 0.2),  # 0.4 m/s at 2 m/s²
        (stop_limits.WATCHDOG_LEASE, 0.25 + 0.25 + 0.2),
        (stop_limits.DRIVER_STALE, 0.25 + 0.2 + 0.4 + 0.1),  # 0.4 m/s at 1 m/s², 10 m/s³
        (stop_limits.MUX_JOYSTICK, 0.25 + 0.3 + 0.5),
        (stop_limits.FILTER_ESTOP, 0.25 + 0.5),
        (stop_limits.WATCHDOG_KEPT, 0.25 + 0.37 + 0.042 + 0.2),
        (stop_limits.WATCHDOG_FOREIGN, 0.25 + 0.03 + 0.2),
    ],
    ids=lambda value: value.cause if isinstance(value, Layer) else "",
)
def test_a_limit_is_allowance_and_timeout_and_braking(robot: Robot, layer: Layer, limit_s: float) -> None:
    assert layer.limit_s(robot, 0.4) == pytest.approx(limit_s)


def test_a_shorter_timeout_makes_a_shorter_limit(robot: Robot) -> None:
    shorter = robot.model_copy(update={"timeouts": robot.timeouts.model_copy(update={"drive_heartbeat_s": 0.1})})
    assert stop_limits.DRIVES.limit_s(shorter, 0.4) == pytest.approx(stop_limits.DRIVES.limit_s(robot, 0.4) - 0.2)


def test_a_row_passes_that_stood_in_time_and_was_caught() -> None:
    assert judge(ROW, Standstill(0.75, 0.2), [stop_limits.DRIVES], set(), 0.75) == ""


def test_a_row_fails_that_stood_too_late() -> None:
    assert judge(ROW, Standstill(0.751, 0.2), [stop_limits.DRIVES], set(), 0.75) == "stood after 0.751 s, limit 0.750 s"


def test_a_row_fails_that_somebody_else_has_caught() -> None:
    problem = judge(ROW, Standstill(0.1, 0.0), [], {("motor_driver", "shutdown")}, 0.75)
    assert problem == (
        "expected that watchdog: driver silent or drives: heartbeat lost catches it; motor_driver: shutdown did"
    )


def test_the_table_has_a_line_for_each_row() -> None:
    result = Result(ROW, (("drives", "heartbeat lost"),), Standstill(0.421, 0.1264), 0.75)
    line = "| motor_driver | SIGKILL | drives: heartbeat lost | 0.75 s | 0.42 s, 126 mm |" + " – |" * 6
    assert line in merged("", [result]).splitlines()


def test_real_rows_come_in_their_order_before_those_of_virtual_time_alone() -> None:
    before = TABLE.merged("", {("encoder", "lost"): {"runs": "100"}})
    lines = merged(before, [Result(row) for row in reversed(ROWS)]).splitlines()[2:]
    assert [line.split(" | ")[:2] for line in lines[:-1]] == [[f"| {row.what}", row.how] for row in ROWS]
    assert lines[-1] == "| encoder | lost | – | – | – | 100 | – | – | – | – | – |"


def test_what_a_twin_in_virtual_time_is_called_is_a_row_of_the_matrix_or_of_none_of_its_names() -> None:
    """A name that is spelt in two ways would make two rows."""
    names, twins = {(row.what, row.how) for row in ROWS}, {twin.key for twin in MEASURED}
    alone = sorted(how for _, how in twins - names)
    assert len(names & twins) >= 35
    assert not [how for how in alone if any(how.lower() == real.lower() for _, real in names)]


PAGE = """text
<!-- make a: begin -->
old
<!-- make a: end -->
more
<!-- make b: begin -->
<!-- make b: end -->
"""


def test_each_command_writes_its_own_part_of_a_page() -> None:
    assert rewritten(PAGE, "make a", "new\n") == PAGE.replace("old", "new")
    assert rewritten(PAGE, "make b", "new") == PAGE.replace("begin -->\n<!-- make b", "begin -->\nnew\n<!-- make b")


@pytest.mark.parametrize("page", ["", PAGE.replace("make a: end", "make a"), PAGE * 2])
def test_a_page_without_both_marks_once_is_not_touched(page: str) -> None:
    with pytest.raises(ValueError, match="make a: begin"):
        rewritten(page, "make a", "new")


def test_the_page_of_stop_times_has_the_marks() -> None:
    page = (Path(__file__).parents[3] / "docs" / "stop_times.md").read_text(encoding="utf-8")

    for command in (COMMANDS, "make vm-test"):
        assert "new" in rewritten(page, command, "new")
