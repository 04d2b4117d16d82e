"""Every row of the table in docs/exercises.md, run with docs/examples/executors.py: the page has what happens here."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from canbase.action import Fibonacci
from rclpy.action import ActionClient
from std_msgs.msg import Empty

from canbase_action_server.outcome import Status
from ros.conftest import Spawn
from support.marked_page import section
from support.ros_harness import TestNode

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

DOCS = Path(__file__).parents[2] / "docs"
STEPS = 80
"""Of 0.1 s each."""
LOOK_S = 4.0
"""So long is looked for the other callbacks, which run ten times a second."""
SOME = 5


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    executor: str
    group: str
    work: str
    goals: int
    feedback: str
    others: str
    cancel: str
    end: str

    @property
    def arguments(self) -> list[str]:
        work, _, slow = self.work.partition(", ")
        options = ["--executor", self.executor, "--group", self.group, "--work", work]
        return [*options, "--slow-timer"] if slow else options

    def __str__(self) -> str:
        return f"{self.executor} {self.group} {self.work} {self.goals}"


def rows() -> list[Row]:
    lines = section((DOCS / "exercises.md").read_text(encoding="utf-8"), "test_exercises").strip().splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [Row(row[0], row[1], row[2], int(row[3]), row[4], row[5], row[6], row[7]) for row in cells]


class Lesson:
    """The server of one row, and a client that looks at it."""

    def __init__(self, node: TestNode, spawn: Spawn, row: Row) -> None:
        self.node = node
        self.server = spawn([sys.executable, str(DOCS / "examples" / "executors.py"), *row.arguments])
        self.beats = node.record(Empty, "heartbeat")
        self.feedback: list[float] = []
        self._client = ActionClient(node.node, Fibonacci, "fibonacci")
        node.wait_for(self._client.server_is_ready, 30.0, "the server")
        node.wait_for(lambda: self.beats.last, 30.0, "a heartbeat")
        node.spin_for(0.5)
        self.handles = [self._sent() for _ in range(row.goals)]
        self.result = self.handles[0].get_result_async()

    def _sent(self) -> Any:
        goal = Fibonacci.Goal(order=STEPS)
        future = self._client.send_goal_async(goal, feedback_callback=lambda _: self.feedback.append(time.monotonic()))
        self.node.wait_for(future.done, 30.0, "the acceptance")
        return future.result()

    @property
    def status(self) -> str:
        self.node.wait_for(self.result.done, 30.0, "the result")
        return Status(self.result.result().status).name

    @property
    def steps(self) -> list[int]:
        """How many were done."""
        return list(self.result.result().result.sequence)

    def others(self) -> str:
        """Whether the other callbacks run, from now on."""
        began_s = time.monotonic()
        until_s = began_s + LOOK_S

        def seen() -> bool:
            return len(self.beats.since(began_s)) >= SOME or time.monotonic() > until_s

        self.node.wait_for(seen, 30.0, "heartbeats")
        return "run" if len(self.beats.since(began_s)) >= SOME else "stand still"

    def canceled(self) -> tuple[str, str]:
        """When the cancel is answered, and how the goal ends."""
        answer = self.handles[0].cancel_goal_async()
        self.node.wait_for(lambda: answer.done() and self.result.done(), 30.0, "answer and result")
        at_once = bool(answer.result().goals_canceling) and self.steps[0] < STEPS
        return ("at once" if at_once else "after the work"), self.status


@pytest.mark.parametrize("row", rows(), ids=str)
def test_what_the_page_says_happens(row: Row, test_node: TestNode, spawn: Spawn) -> None:
    lesson = Lesson(test_node, spawn, row)
    if row.feedback == "none":
        assert (lesson.status, lesson.feedback) == (row.end, [])
        assert "no running event loop" in lesson.server.log()
        assert lesson.others() == row.others
        return
    test_node.wait_for(lambda: lesson.feedback, 30.0, "feedback")
    assert lesson.others() == row.others
    test_node.wait_for(lambda: len(lesson.feedback) >= SOME, 30.0, "more feedback")
    if row.cancel == "–":
        return
    cancel, end = lesson.canceled()
    assert cancel == row.cancel
    assert end in row.end.split(" or ")


def test_the_table_has_every_executor_group_and_work() -> None:
    seen = rows()
    assert {row.executor for row in seen} == {"single", "multi", "events"}
    assert {row.group for row in seen} == {"exclusive", "reentrant"}
    assert {row.work for row in seen} == {"blocking", "pausing", "asyncio", "blocking, slow timer"}
