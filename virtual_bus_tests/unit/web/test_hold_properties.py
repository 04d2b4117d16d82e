"""Hold-to-drive, whatever pages do: any interleaving of numbers, delays, presses, releases and lies, beside a model.

The model knows nothing of `hold.py`: it keeps what was sent, when, and which fingers were lifted, and says when the
base may be driven.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from canbase_web.hold import VALID_S, ZERO, Hold, Speed

PAGES = ("a", "b")
STEP_S = st.sampled_from([0.0, 0.0, 0.001, 0.01, 0.05, 0.0501, 0.1, 0.199, 0.2, 0.25])
SHARE = st.sampled_from([0.5, 0.5, 0.0, -1.0, 1.0, 1.0001, math.nan, math.inf])
AGE = st.sampled_from([0, 0, 0, 1, 2, 4, 6, -1])
"""Of the number, in numbers: 0 is the newest, -1 was never sent."""
ORDER = st.tuples(st.just("order"), st.sampled_from(PAGES), st.integers(1, 3), AGE, SHARE, st.just(0.0))
OTHER = st.tuples(st.sampled_from(["release", "forget"]), st.sampled_from(PAGES))
NUMBER, LOOK = st.just(("number",)), st.just(("look",))
EVENTS = st.lists(st.tuples(STEP_S, st.one_of(ORDER, ORDER, OTHER, NUMBER, LOOK, LOOK)), min_size=10, max_size=30)


@dataclass
class Model:
    """What is known from outside."""

    hold: Hold = field(default_factory=lambda: Hold(0.8, 2.0))
    sent: dict[int, float] = field(default_factory=dict)
    number: int = 0
    pressed: dict[str, int] = field(default_factory=dict)
    """By page, its press that drives or drove last."""
    over: dict[str, int] = field(default_factory=dict)
    """By page, the newest press that is over: it may not drive again."""
    driver: str = ""
    until_s: float = -math.inf
    order: Speed = ZERO
    before: Speed | None = None

    def end(self, page: str) -> None:
        if self.driver and self.driver == page:
            self.over[page] = max(self.over.get(page, 0), self.pressed[page])
            self.driver = ""

    def on_number(self, now_s: float) -> None:
        self.number = self.hold.number(now_s)
        self.sent[self.number] = now_s

    def on_release(self, now_s: float, page: str) -> None:
        self.hold.release(page)
        self.end(page)

    def on_forget(self, now_s: float, page: str) -> None:
        self.hold.forget(page)
        self.end(page)
        self.over.pop(page, None)

    def on_order(self, now_s: float, page: str, press: int, age: int, forward: float, turn: float) -> None:
        number = self.number - age
        if not self.hold.on_order(page, press, number, forward, turn, now_s):
            if self.driver != page:  # a finger is on it that has to be lifted first
                self.over[page] = max(self.over.get(page, 0), press)
            return
        assert now_s < self.sent.get(number, -math.inf) + VALID_S, "an old number, or one that was never sent"
        assert max(abs(forward), abs(turn)) <= 1.0, "no order beyond the limits"
        assert self.driver in ("", page), "another page drives"
        assert press > self.over.get(page, 0), "this finger was lifted, or its press has ended"
        self.driver, self.until_s, self.pressed[page] = page, self.sent[number] + VALID_S, press
        self.order = Speed(forward * 0.8, turn * 2.0)

    def on_look(self, now_s: float) -> None:
        speed = self.hold.speed(now_s)
        assert self.hold.holder(now_s) == self.driver
        if speed not in (None, ZERO):
            assert (speed, bool(self.driver)) == (self.order, True)
            assert self.before is not None, "a press begins with a zero"
        if not self.driver:
            assert speed is None or (speed == ZERO and self.before is not None), "one zero, then nothing"
        self.before = speed if self.driver else None


@settings(max_examples=1000)
@given(EVENTS)
def test_the_base_is_driven_by_one_finger_that_is_down_now_and_by_nothing_else(
    events: list[tuple[float, tuple[Any, ...]]],
) -> None:
    model, now_s = Model(), 100.0
    for step_s, (kind, *arguments) in events:
        now_s += step_s
        if now_s >= model.until_s:
            model.end(model.driver)
        getattr(model, f"on_{kind}")(now_s, *arguments)
