"""Hold-to-drive: an order counts while a finger is on the page, the browser runs and the network carries. Pure.

Rules
1. The server sends a new number every NUMBER_S. An order echoes the newest one that the page has, and counts from its
   arrival until VALID_S after that number was sent: what TCP delivers late, after a cable was out or a browser hung,
   counts for nothing.
2. An order that echoes an older number than the one before is none: it was overtaken.
3. A press begins with a zero, as the mux wants it of every source (neutral start).
4. When the orders end, one zero is sent, then nothing: as from a joystick that goes silent.
5. One page holds at a time; orders of others are none until it has let go.
6. A press whose orders have ended or were refused, for whatever reason, is over: a browser that hung goes on with a
   finger on it, and a finger may wait on one page while another one drives. Nothing moves before it was lifted.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

NUMBER_S: Final = 0.05
VALID_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class Speed:
    """What the base is ordered to do: forward [m/s], counter-clockwise [rad/s] (REP 103)."""

    linear_mps: float
    angular_radps: float


ZERO: Final = Speed(0.0, 0.0)


class Hold:
    """Orders of pages in, velocities for the mux out. `linear_mps`, `angular_radps`: the greatest speeds."""

    def __init__(self, linear_mps: float, angular_radps: float) -> None:
        self._greatest = Speed(linear_mps, angular_radps)
        self._sent: deque[tuple[int, float]] = deque(maxlen=math.ceil(VALID_S / NUMBER_S) + 1)
        self._number = 0
        self._holder = ""
        self._order = ZERO
        self._echoed = 0
        self._press = 0
        self._spent: dict[str, int] = {}
        """By page, its newest press that gave an order: it counts as long as it goes on, and never again."""
        self._until_s = -math.inf
        self._told: Speed | None = None

    def number(self, now_s: float) -> int:
        """The next number for the pages."""
        self._number += 1
        self._sent.append((self._number, now_s))
        return self._number

    def holder(self, now_s: float) -> str:
        """The page that holds now; empty: none."""
        return self._holder if now_s < self._until_s else ""

    def on_order(self, page: str, press: int, number: int, forward: float, turn: float, now_s: float) -> bool:
        """Shares of the greatest speeds, -1 to 1. `press`: counts the page's presses, from 1. Whether it counts."""
        goes_on = self.holder(now_s) == page and press == self._press
        if not goes_on and press <= self._spent.get(page, 0):
            return False
        self._spent[page] = press
        sent_s = next((at_s for each, at_s in self._sent if each == number), -math.inf)
        if not (abs(forward) <= 1.0 and abs(turn) <= 1.0):  # nor NaN
            return False
        holder = self.holder(now_s)
        if now_s >= sent_s + VALID_S or holder not in ("", page) or (holder and number < self._echoed):
            return False
        self._press = press
        self._holder, self._echoed, self._until_s = page, number, sent_s + VALID_S
        self._order = Speed(forward * self._greatest.linear_mps, turn * self._greatest.angular_radps)
        return True

    def release(self, page: str) -> None:
        """The finger was lifted, or the page has gone."""
        if page == self._holder:
            self._until_s = -math.inf

    def forget(self, page: str) -> None:
        """The page has gone."""
        self.release(page)
        self._spent.pop(page, None)

    def speed(self, now_s: float) -> Speed | None:
        """What to publish now, every NUMBER_S; None: nothing."""
        if now_s < self._until_s:
            self._told = self._order if self._told is not None else ZERO
            return self._told
        ended, self._told = self._told is not None, None
        return ZERO if ended else None
