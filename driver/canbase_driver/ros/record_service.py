"""Service motor_driver/record: has the black box write its last seconds. It commands nothing and resets nothing.

The answer comes when both files are on disk, from the thread that spins the service; no thread waits for it.
"""

from __future__ import annotations

import queue
from collections.abc import Callable

from rclpy.node import Node
from std_srvs.srv import Trigger

from canbase_driver.ros.late_answer import Asked, answer_later
from canbase_driver.runtime.black_box_writer import Written
from canbase_runtime.journal import EventLog
from canbase_runtime.log_priority import Priority

NAME = "motor_driver/record"


class RecordService:
    """`record`: takes who is to be told the path and the problem; returns why not now."""

    def __init__(self, node: Node, event_log: EventLog, record: Callable[[Written], str]) -> None:
        self._record = record
        self._event_log = event_log
        self._outcomes: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        answer_later(node.create_service(Trigger, NAME, _answered_later), self._on_request)

    def deliver(self) -> None:
        """Send the answers that are there. From the thread that spins the node, now and then."""
        while not self._outcomes.empty():
            self._outcomes.get_nowait()()

    def _on_request(self, asked: Asked) -> None:
        def done(path: str, problem: str) -> None:
            self._outcomes.put(lambda: self._end(asked, path, problem))

        if refused := self._record(done):
            _answer(asked, done=False, sentence=refused)

    def _end(self, asked: Asked, path: str, problem: str) -> None:
        self._event_log.write(f"recording requested: {problem or path}", Priority.NOTICE)
        _answer(asked, done=not problem, sentence=problem or path)


def _answer(asked: Asked, *, done: bool, sentence: str) -> None:
    asked.response.success, asked.response.message = done, sentence
    asked.answer()


def _answered_later(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    """In place of a callback: `answer_later` takes the requests over."""
    return response
