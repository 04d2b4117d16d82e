"""Steps that ask the bus and keep every answer, as a session: two drives with one node id both count. Pure.

An SDO client takes the first answer that fits. Here a step sends its requests, and gets all answers that came in time.
A conversation ends with an error as soon as anybody else commands the bus.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from canbase_commissioning.bus_monitor import Listener
from canbase_commissioning.lss.protocol import REQUEST
from canbase_driver.cia301.frame import Frame

T = TypeVar("T")
STAGGER_S = 0.002
"""Between two requests of one step: all of them at once would fill every transmit buffer."""


class ConversationError(Exception):
    """The conversation cannot go on. The text has the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Exchange:
    """Send `requests`, and collect the frames that `answers` accepts until `wait_s` after the last request.

    `linger_s`: it ends so long after the first answer; None: it collects for all of `wait_s`. The answer: the frames.
    """

    requests: tuple[Frame, ...]
    answers: Callable[[Frame], bool]
    wait_s: float
    linger_s: float | None = None
    stagger_s: float = STAGGER_S


@dataclass(frozen=True, slots=True)
class Progress:
    """How far it is: `done` of `total`. It brings no answer, and takes no time."""

    text: str
    done: int
    total: int


Talk = Generator[Exchange | Progress, Any, T]


def nothing(_frame: Frame) -> bool:
    """No frame answers this request."""
    return False


def say(*requests: Frame, wait_s: float = 0.0) -> Exchange:
    """Requests without an answer; then `wait_s` [s] for their effect."""
    return Exchange(requests, nothing, wait_s)


class Conversation(Generic[T]):
    """Runs the steps. A session; when it is done, `result` or `error` is set.

    `sent`: requests of this program, of earlier conversations too. A simulated bus gives them back, late on a loaded
    computer, and they are no sign of another master.
    """

    def __init__(
        self,
        steps: Talk[T],
        show: Callable[[Progress], None] = lambda _progress: None,
        sent: set[Frame] | None = None,
    ) -> None:
        self.result: T | None = None
        self.error: ConversationError | None = None
        self.heard = Listener(0.0)
        self._steps, self._show = steps, show
        self._step: Exchange | None = None
        self._to_send: list[Frame] = []
        self._sent: set[Frame] = set() if sent is None else sent
        self._answers: list[Frame] = []
        self._next_at = self._ends_at = 0.0
        self._has_begun = self._has_ended = False

    @property
    def done(self) -> bool:
        """Whether it has ended, well or not."""
        return self._has_ended

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        if self._has_ended or frame in self._sent:
            return
        self.heard.on_frame(frame, now_s)
        if frame.cob_id == REQUEST:
            self._refuse("LSS requests of another master are on this bus")
        step = self._step
        if step is not None and step.answers(frame):
            self._answers.append(frame)
            if step.linger_s is not None and not self._to_send:
                self._ends_at = min(self._ends_at, now_s + step.linger_s)

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass; what to send."""
        if not self._has_begun:
            self._has_begun, self.heard = True, Listener(now_s)
            self._go_on(None, now_s)
        masters = [] if self._has_ended else self.heard.masters(now_s)
        if masters:
            self._refuse(f"another master is on this bus ({'; '.join(masters)}). End it, and try again")
        elif not self._to_send and self._step is not None and now_s >= self._ends_at:
            self._go_on(tuple(self._answers), now_s)
        return self._due(now_s)

    def _due(self, now_s: float) -> list[Frame]:
        step = self._step
        if self._has_ended or step is None or not self._to_send or now_s < self._next_at:
            return []
        frame = self._to_send.pop(0)
        self._sent.add(frame)
        self._next_at = now_s + step.stagger_s
        self._ends_at = now_s + step.wait_s
        return [frame]

    def _go_on(self, answer: tuple[Frame, ...] | None, now_s: float) -> None:
        while True:
            try:
                step = self._steps.send(answer)
            except StopIteration as end:
                self.result, self._has_ended = end.value, True
                return
            except ConversationError as error:
                self.error, self._has_ended = error, True
                return
            if isinstance(step, Progress):
                self._show(step)
                answer = None
                continue
            self._step, self._to_send, self._answers = step, list(step.requests), []
            self._next_at, self._ends_at = now_s, now_s + step.wait_s
            return

    def _refuse(self, why: str) -> None:
        self.error, self._has_ended = ConversationError(why), True
