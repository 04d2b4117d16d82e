"""The person at the machine: answers from the terminal while the bus goes on, or from a file."""

from __future__ import annotations

import select
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Final, Protocol

import typer

from canbase_commissioning.guide import Ask, CommissionError, Tell, confirm
from canbase_config.errors import ConfigError
from canbase_config.yaml_file import read_yaml
from canbase_runtime.terminal import WRONG_INPUT, colour, fail

BACK: Final = "back"
"""The answer of a person who wants to give the one before again (`canbase setup init`)."""
ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopped(BaseException):
    """A signal requested the end."""

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.number = number


@contextmanager
def stopping_signals() -> Iterator[None]:
    """SIGINT, SIGTERM and SIGHUP raise `Stopped` inside, once: what runs on the way out is not broken off."""

    def stop(number: int, _frame: FrameType | None) -> None:
        for each in ENDING:
            signal.signal(each, signal.SIG_IGN)
        raise Stopped(number)

    before = {number: signal.signal(number, stop) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def unbroken() -> Iterator[None]:
    """What runs inside comes to its end: a signal of these takes effect behind it."""
    came: list[int] = []
    before = {number: signal.signal(number, lambda number, _frame: came.append(number)) for number in ENDING}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


class Person(Protocol):
    """Who is asked, and what they are told: at a terminal, or at another program (remote_operator.py)."""

    def tell(self, line: Tell) -> None:
        """A line of the procedure."""

    def ask(self, question: Ask, turn: Callable[[], None]) -> str:
        """The words of the answer; `turn` keeps the bus going meanwhile. Raises CommissionError without a person."""

    def again(self, question: Ask, error: ValueError) -> None:
        """The words made no sense. Raises CommissionError where they stay the same."""

    def interrupts(self) -> bool:
        """Whether the person wants everything to stop. Raises CommissionError when nobody is there any more."""


def answered(person: Person, question: Ask, turn: Callable[[], None]) -> object:
    """What the answer means, by the question's `check`; asked again until it makes sense.

    Raises CommissionError without a person, and where a confirmation is refused.
    """
    while True:
        try:
            text = person.ask(question, turn)
            if question.confirms:
                confirm(text)
            return question.check(text)
        except ValueError as error:
            person.again(question, error)


class NoAnswerError(CommissionError):
    """These questions have no answer: there is no terminal, and --answers does not have them."""

    def __init__(self, *questions: Ask) -> None:
        keys = [question.key for question in questions]
        rest = [question.key for question in questions if not question.confirms and question.default is None]
        remedy = "run it on a terminal, " + ("" if rest else "with --yes, ") + "or give it in --answers"
        by_yes = f"; --yes answers all but {', '.join(rest)}" if rest and len(rest) < len(keys) else ""
        super().__init__(f"no answer to {', '.join(keys)}: {remedy}{by_yes}")
        self.questions = questions


class Operator:
    """Prompts on the terminal, or takes the answers of a file; `yes` confirms what wants a yes, and takes defaults."""

    def __init__(self, answers: Path | None, *, yes: bool) -> None:
        """Exits with 2 when the file cannot be read."""
        self._yes = yes
        self._has_terminal = sys.stdin.isatty()  # read once: a terminal that has gone reports that it is none
        try:
            values = read_yaml(answers).values if answers else {}
        except ConfigError as error:
            fail(str(error), WRONG_INPUT)
        self._answers = {str(key): str(value) for key, value in values.items()}

    def tell(self, line: Tell) -> None:
        """A line of the procedure."""
        typer.secho(line.text, bold=line.is_loud, fg=typer.colors.RED if line.is_loud else None, color=colour())

    def ask(self, question: Ask, turn: Callable[[], None]) -> str:
        """The words of the answer; `turn` keeps the bus going meanwhile. Raises CommissionError without a person."""
        known = self._known(question)
        if known == BACK:
            raise CommissionError(f"{question.key} in --answers: {BACK} is for a person on a terminal")
        if known is not None:
            typer.echo(f"{_asked(question)} {known}")
            return known
        if not self._has_terminal:
            raise NoAnswerError(question)
        typer.secho(f"{_asked(question)} ", bold=True, nl=False, color=colour())
        while not _has_line():
            turn()
        return _line() or question.default or ""

    def _known(self, question: Ask) -> str | None:
        """The answer that needs no person; None: a person has to give it."""
        if question.confirms and self._yes:
            return "yes"
        return self._answers.get(question.key, question.default if self._yes else None)

    def again(self, question: Ask, error: ValueError) -> None:
        """The words made no sense. Raises CommissionError when they came from a file: they stay the same."""
        if question.key in self._answers:
            raise CommissionError(f"{question.key} in --answers: {error}") from error
        typer.secho(f"{error}; try again", fg=typer.colors.YELLOW, color=colour())

    def interrupts(self) -> bool:
        """Whether Enter was pressed without a question. Raises CommissionError when the terminal was closed."""
        if self._has_terminal and _has_line():
            _line()
            return True
        return False


def _asked(question: Ask) -> str:
    """The question with the answers that it wants, or the one that a bare Enter means."""
    if question.confirms:
        return f"{question.text} [yes/no]"
    return question.text if question.default is None else f"{question.text} [{question.default}]"


def _has_line() -> bool:
    return bool(select.select([sys.stdin], [], [], 0.0)[0])


def _line() -> str:
    try:
        text = sys.stdin.readline()
    except OSError as error:  # EIO, of a terminal that was hung up
        raise CommissionError("the terminal was closed") from error
    if not text:
        raise CommissionError("the terminal was closed")
    return text.strip()
