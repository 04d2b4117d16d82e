"""The person at another program: questions and answers as lines of JSON on stdout and stdin.

Out: {"tell": TEXT, "loud": BOOL}, {"ask": KEY, "text": TEXT, "confirms": BOOL, "default": TEXT or null},
{"again": KEY, "reason": TEXT}. In: {"answer": TEXT, "key": KEY}, {"stop": true}, {"alive": true}.
A program that says nothing for SILENCE_S has gone, or hangs: then the wheels stop, as when its end of the pipe closes.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from canbase_commissioning.guide import Ask, CommissionError, Tell

SILENCE_S = 1.0
LONGEST_LINE = 4096
"""Bytes: an answer is a number or a word."""


@dataclass(frozen=True, slots=True)
class Answer:
    """To the question `key`."""

    key: str
    text: str


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop everything."""


@dataclass(frozen=True, slots=True)
class Alive:
    """The person is still there."""


Line = Answer | Stop | Alive


def parse(line: bytes) -> Line:
    """One line of the other program. Raises ValueError for anything but the three that there are."""
    said = json.loads(line)
    if said == {"stop": True}:
        return Stop()
    if said == {"alive": True}:
        return Alive()
    if isinstance(said, dict) and said.keys() == {"answer", "key"} and all(isinstance(v, str) for v in said.values()):
        return Answer(said["key"], said["answer"])
    raise ValueError("expected an answer with its key, stop or alive")


class RemoteOperator:
    """Asks on stdout and hears on stdin, which nothing else may read."""

    def __init__(self) -> None:
        self._rest = b""
        self._answers: deque[Answer] = deque()
        self._stops = False
        self._heard_at_s = time.monotonic()
        os.set_blocking(sys.stdout.fileno(), False)  # a program that does not read holds up no wheel's stop

    def tell(self, line: Tell) -> None:
        """A line of the procedure."""
        _say({"tell": line.text, "loud": line.is_loud})

    def ask(self, question: Ask, turn: Callable[[], None]) -> str:
        """The words of the answer; `turn` keeps the bus going meanwhile. Raises CommissionError: stopped, or gone."""
        self._answers.clear()  # to questions before this one
        _say({"ask": question.key, "text": question.text, "confirms": question.confirms, "default": question.default})
        while True:
            if self.interrupts():
                raise CommissionError("stopped")
            while self._answers:
                answer = self._answers.popleft()
                if answer.key == question.key:
                    return answer.text.strip() or question.default or ""
            turn()

    def again(self, question: Ask, error: ValueError) -> None:
        """The words made no sense."""
        _say({"again": question.key, "reason": str(error)})

    def interrupts(self) -> bool:
        """Whether the person wants everything to stop. Raises CommissionError when the other program has gone."""
        now_s = time.monotonic()
        if select.select([sys.stdin], [], [], 0.0)[0]:
            self._heard_at_s = now_s
            self._take_in(os.read(sys.stdin.fileno(), LONGEST_LINE))
        elif now_s - self._heard_at_s > SILENCE_S:
            raise CommissionError(f"the page or program that asked for this was silent for {SILENCE_S:g} s")
        return self._stops

    def _take_in(self, data: bytes) -> None:
        if not data:
            raise CommissionError("the page or program that asked for this has gone")
        *lines, self._rest = (self._rest + data).split(b"\n")
        try:
            said = [parse(line) for line in lines]
        except ValueError as error:
            raise CommissionError(f"a line was not understood: {error}") from error
        if len(self._rest) > LONGEST_LINE:
            raise CommissionError(f"a line is longer than {LONGEST_LINE} bytes")
        self._stops |= Stop() in said
        self._answers.extend(each for each in said if isinstance(each, Answer))


def _say(values: dict[str, object]) -> None:
    """Never waits and never raises: `interrupts` finds out who is gone. A pipe takes such a line whole."""
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), json.dumps(values).encode() + b"\n")
