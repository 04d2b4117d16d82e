"""Every row of the table in docs/exercises.md, run with docs/examples/executors.py: the page has what happens here."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from canbase.action import Fibonacci
from rclpy.action import ActionClient
from std_msgs.msg import Empty

from canbase_action_server.outcome import Status
from support.goal_stage import GoalStage, bare_stage
from support.marked_page import section

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]

DOCS = Path(__file__).parents[2] / "docs"
STEPS = 80
"""Of 0.1 s each."""
LOOK_S = 4.0
"""So long is looked for feedback and for the other callbacks, which run ten times a second."""
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
    """The server of one row, in a namespace of its own, and a client that looks at it."""

    def __init__(self, stage: GoalStage, row: Row, space: str) -> None:
        self.row, self.node = row, stage.node
        program = str(DOCS / "examples" / "executors.py")
        self.server = stage.spawn([sys.executable, program, *row.arguments, "--ros-args", "-r", f"__ns:=/{space}"])
        self.beats = self.node.record(Empty, f"{space}/heartbeat")
        self.client = ActionClient(self.node.node, Fibonacci, f"{space}/fibonacci")
        self.feedback: list[float] = []
        self.goals: list[Any] = []
        """The answers to goals, then the handles."""
        self.found: dict[str, str] = {}
        """What the columns of the row show."""

    def send(self) -> None:
        goal = Fibonacci.Goal(order=STEPS)
        heard = lambda _: self.feedback.append(time.monotonic())  # noqa: E731
        self.goals = [self.client.send_goal_async(goal, feedback_callback=heard) for _ in range(self.row.goals)]

    def accepted(self) -> None:
        """Until the goals are; from now on the result of the first one is waited for."""
        self.node.wait_for(lambda: all(each.done() for each in self.goals), 30.0, "the acceptance")
        self.goals = [each.result() for each in self.goals]
        self.result = self.goals[0].get_result_async()

    def end(self) -> None:
        """When the cancel was answered, and how the goal ended."""
        self.node.wait_for(lambda: self.result.done() and (self.cancel is None or self.cancel.done()), 30.0, "the end")
        wrapped = self.result.result()
        self.found["end"] = Status(wrapped.status).name
        if self.cancel is not None:
            at_once = bool(self.cancel.result().goals_canceling) and wrapped.result.sequence[0] < STEPS
            self.found["cancel"] = "at once" if at_once else "after the work"

    def look(self, since_s: float) -> None:
        """Feedback, and whether the other callbacks run."""
        self.found["feedback"] = "yes" if len(self.feedback) >= SOME else "none" if not self.feedback else "once"
        self.found["others"] = "run" if len(self.beats.since(since_s)) >= SOME else "stand still"

    def request_cancel(self) -> None:
        """Of the first goal, where the row has one and it runs."""
        wanted = self.row.cancel != "–"
        self.cancel = self.goals[0].cancel_goal_async() if wanted else None


def run(stage: GoalStage, lessons: list[Lesson]) -> None:
    """Until all goals of these rows show that they run."""
    for each in lessons:
        each.send()
    for each in lessons:
        each.accepted()
    shown = lambda: all(each.feedback or each.row.feedback == "none" for each in lessons)  # noqa: E731
    stage.node.wait_for(shown, 30.0, "feedback")


@pytest.fixture(scope="module")
def lessons() -> Iterator[dict[str, Lesson]]:
    """All rows at once: their servers sleep most of the time."""
    with bare_stage() as stage:
        made = [Lesson(stage, row, f"row{number}") for number, row in enumerate(rows())]
        for each in made:
            stage.node.wait_for(each.client.server_is_ready, 60.0, "the server")
            stage.node.wait_for(lambda beats=each.beats: beats.last, 30.0, "a heartbeat")  # type: ignore[misc]
        stage.node.spin_for(0.5)
        slow = [each for each in made if "slow timer" in each.row.work]  # their timers keep a goal waiting for seconds
        run(stage, slow)
        run(stage, [each for each in made if each not in slow])
        began_s = time.monotonic()
        stage.node.spin_for(LOOK_S)
        for each in made:
            each.look(began_s)
        for each in made:
            each.request_cancel()
        for each in made:
            if each.row.end != "–":
                each.end()
        yield {str(each.row): each for each in made}


@pytest.mark.parametrize("row", rows(), ids=str)
def test_what_the_page_says_happens(row: Row, lessons: dict[str, Lesson]) -> None:
    lesson = lessons[str(row)]
    assert lesson.found["feedback"] == row.feedback
    assert lesson.found["others"] == row.others
    assert lesson.found.get("cancel", "–") == row.cancel
    assert lesson.found.get("end", "–") in row.end.split(" or ")
    assert ("no running event loop" in lesson.server.log()) == (row.feedback == "none")


def test_the_table_has_every_executor_group_and_work() -> None:
    seen = rows()
    assert {row.executor for row in seen} == {"single", "multi", "events"}
    assert {row.group for row in seen} == {"exclusive", "reentrant"}
    assert {row.work for row in seen} == {"blocking", "pausing", "asyncio", "blocking, slow timer"}
