"""Which reason belongs to a rejected goal: by its numbers, bit by bit. ROS gives no reason with a rejection.

On the wire (topic <action>/rejection) it is a diagnostic_msgs/DiagnosticStatus: `message` is the reason, `values` are
the fields of the goal.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Mapping

Fields = Mapping[str, float]
"""The numbers of a goal by the names of its fields."""


def as_texts(goal: Fields) -> list[tuple[str, str]]:
    """For `values`: what `Reasons.take` reads again without loss."""
    return [(name, repr(value)) for name, value in goal.items()]


class Reasons:
    """Finds the reason that the server published for the goal that was sent last, by the goal's numbers.

    Another client's goal with the same numbers, rejected at the same moment, may lend its reason to this one.
    """

    def __init__(self) -> None:
        self._goal: dict[str, bytes] | None = None
        self._found: str | None = None

    def expect(self, goal: Fields) -> None:
        """A goal with these numbers is sent now: what was received before is about others."""
        self._goal, self._found = _bits(goal.items()), None

    def take_rejection(self, texts: Iterable[tuple[str, str]], reason: str) -> None:
        """The server has rejected a goal with these numbers. The first that fits counts; no unreadable one."""
        if self._found is not None or not reason:
            return
        try:
            goal = _bits((name, float(text)) for name, text in texts)
        except ValueError:
            return
        if goal == self._goal:
            self._found = reason

    @property
    def found(self) -> str | None:
        """Why the goal was rejected; None: no reason received yet."""
        return self._found


def _bits(goal: Iterable[tuple[str, float]]) -> dict[str, bytes]:
    """As float32, which the interface carries: 0.3 comes back as 0.30000001192…, and NaN equals itself."""
    return {name: _float32(value) for name, value in goal}


def _float32(value: float) -> bytes:
    try:
        return struct.pack("<f", value)
    except OverflowError:
        return struct.pack("<f", math.copysign(math.inf, value))  # as rclpy sends it
