"""A guided procedure as a script to be read from top to bottom: it moves, waits, prompts, reports. The runner is pure.

A script is a generator: it yields `Until`, `Ask` or `Tell`, and is sent the answer. While it waits, the rig goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from canbase_commissioning.powered_drives import PoweredDrives
from canbase_driver.cia301.frame import Frame

T = TypeVar("T")
E = TypeVar("E", bound=Enum)


class CommissionError(Exception):
    """The procedure cannot go on. The text has the reason and the remedy."""


@dataclass(frozen=True, slots=True)
class Until:
    """Wait until `holds(now)`, or `timeout_s`. The answer: whether it held."""

    holds: Callable[[float], bool]
    timeout_s: float


@dataclass(frozen=True, slots=True)
class Ask:
    """A question to the person at the machine. `key` names it in an answers file. The answer: their words.

    `check` raises ValueError for an invalid answer: then the question is repeated. `confirms`: it wants a yes.
    `default`: the answer that a bare Enter means; None: there is none.
    """

    key: str
    text: str
    check: Callable[[str], object] = str
    confirms: bool = False
    default: str | None = None


@dataclass(frozen=True, slots=True)
class Tell:
    """A line for the person at the machine; `is_loud`: one that must not be overlooked. It brings no answer."""

    text: str
    is_loud: bool = False


Script = Generator[Until | Ask | Tell, Any, T]


def wait(seconds: float) -> Until:
    """Wait for a time, whatever happens."""
    return Until(lambda _now: False, seconds)


def number(low: float, high: float) -> Callable[[str], float]:
    """A check for a number in a range."""

    def check(text: str) -> float:
        try:
            value = float(text.replace(",", "."))
        except ValueError as error:
            raise ValueError(f"{text!r} is no number") from error
        if not low <= value <= high:
            raise ValueError(f"{value:g} is outside {low:g} to {high:g}")
        return value

    return check


def one_of(kind: type[E]) -> Callable[[str], E]:
    """A check for the value of one member of `kind`, a word; its first letter is enough."""

    def check(text: str) -> E:
        found = next((member for member in kind if text.strip().lower() in (member.value, member.value[0])), None)
        if found is None:
            raise ValueError(f"expected one of {', '.join(member.value for member in kind)}")
        return found

    return check


def confirm(text: str) -> None:
    """Raises CommissionError for a no or a bare Enter, ValueError for what is neither yes nor no."""
    word = text.strip().lower()
    if word in ("", "n", "no"):
        raise CommissionError("not confirmed; stopped here")
    if word not in ("y", "yes"):
        raise ValueError(f"{text.strip()!r} is neither yes nor no")


class Guide(Generic[T]):
    """Runs one script on one rig. A session; when it waits for a person, `question` has the question.

    Ends with `result`, or raises what the script or the rig raised: its caller must then run safe_stop.
    """

    def __init__(self, rig: PoweredDrives, script: Script[T], tell: Callable[[Tell], None]) -> None:
        self.rig = rig
        self.result: T | None = None
        self.done = False
        self.question: Ask | None = None
        self._script, self._tell = script, tell
        self._until: Until | None = None
        self._give_up_at = 0.0
        self._has_begun = False

    def on_frame(self, frame: Frame, now_s: float) -> None:
        """Take a frame."""
        self.rig.on_frame(frame, now_s)

    def tick(self, now_s: float) -> list[Frame]:
        """Let time pass. Raises RigError, CommissionError."""
        frames = self.rig.tick(now_s)
        if not self._has_begun:
            self._has_begun = True
            self._go_on(None, now_s)
        elif self._until is not None:
            held = self._until.holds(now_s)
            if held or now_s >= self._give_up_at:
                self._go_on(held, now_s)
        return frames

    def answer(self, text: str) -> None:
        """The person's answer. Raises ValueError for an invalid one, and keeps the question open.

        Raises CommissionError when they did not confirm.
        """
        if self.question is None:
            raise RuntimeError("nothing was asked")
        if self.question.confirms:
            confirm(text)
        value = self.question.check(text)
        self._go_on(value, self.rig.now_s)

    def _go_on(self, answer: object, now_s: float) -> None:
        self._until = self.question = None
        while True:
            try:
                step = self._script.send(answer)
            except StopIteration as end:
                self.result, self.done = end.value, True
                return
            if isinstance(step, Tell):
                self._tell(step)
                answer = None
                continue
            if isinstance(step, Until):
                self._until, self._give_up_at = step, now_s + step.timeout_s
            else:
                self.question = step
            return
