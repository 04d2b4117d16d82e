"""Lines that others cause: a burst is written, a flood is counted, and every line has a bound or a reason."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from canbase_runtime.log_budget import BURST, PER_S, LogBudget

ROOT = Path(__file__).parents[3]
SEVERITIES = {"debug", "info", "warning", "warn", "error", "fatal"}
WITHOUT_THROTTLE = {
    "action_server/canbase_action_server/fibonacci_node.py": "the exercise; it moves nothing",
    "driver/canbase_driver/ros/managed_node.py _end": "a transition that was carried out takes its time",
    "driver/canbase_driver/ros/node.py __init__": "at the start",
    "driver/canbase_driver/ros/services.py _tell": "has a budget",
    "driver/canbase_driver/ros/source_orders.py": "at the start, for each source",
    "velocity_mux/canbase_velocity/mux_node.py _listen": "at the start, for each lock",
    "velocity_mux/canbase_velocity/qos.py": "once for each incompatible subscriber, by an event of DDS",
}
"""Calls of a ROS logger without a throttle: the file, with the function where only that one is meant."""


def test_a_burst_is_written_and_a_flood_is_counted() -> None:
    budget = LogBudget()
    written = [budget.take(10.0 + 1e-3 * number) for number in range(10_000)]
    assert written[: int(BURST)] == [0] * int(BURST)
    lines = [omitted for omitted in written if omitted is not None]
    assert len(lines) == pytest.approx(BURST + PER_S * 10.0, abs=1)
    assert sum(lines) + budget.omitted + len(lines) == 10_000


def test_after_a_pause_the_next_line_has_how_many_were_omitted() -> None:
    budget = LogBudget()
    for _ in range(int(BURST) + 5):
        budget.take(1.0)
    assert budget.take(1.0 + 0.999 / PER_S) is None
    assert budget.take(1.0 + 1.0 / PER_S) == 6
    assert budget.take(1.0 + 2.0 / PER_S) == 0
    assert [budget.take(1e6) for _ in range(int(BURST) + 1)] == [0] * int(BURST) + [None]


def unthrottled(tree: ast.AST, path: str) -> set[str]:
    """Calls of a ROS logger without a throttle, as `WITHOUT_THROTTLE` names them."""
    return {
        f"{path} {function.name}"
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for call in ast.walk(function)
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr in SEVERITIES
        and ast.unparse(call.func.value).endswith("get_logger()")
        and not any(keyword.arg in ("throttle_duration_sec", "once") for keyword in call.keywords)
    }


def test_each_line_that_a_message_can_cause_is_throttled_or_has_its_reason() -> None:
    files = [file for folder in ("driver", "velocity_mux", "action_server") for file in (ROOT / folder).rglob("*.py")]
    found = {
        name for file in files for name in unthrottled(ast.parse(file.read_text("utf-8")), str(file.relative_to(ROOT)))
    }
    used = {name if name in WITHOUT_THROTTLE else name.split()[0] for name in found}
    assert used == set(WITHOUT_THROTTLE)


def test_a_new_line_without_a_throttle_is_found() -> None:
    source = "def on_new(self, message):\n    self.get_logger().warning(message.data)\n"
    assert unthrottled(ast.parse(source), "driver/a.py") == {"driver/a.py on_new"}
    assert unthrottled(ast.parse(source.replace("data)", "data, throttle_duration_sec=1.0)")), "driver/a.py") == set()
