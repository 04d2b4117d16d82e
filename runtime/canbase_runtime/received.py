"""A value that came from outside this process, with its age: the only form in which a decision gets one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Received(Generic[T]):
    """`_value` is private: nobody reads it without stating how old it may be (ruff SLF001, mypy: it may be None)."""

    _value: T | None
    received_at_s: float
    """By the local monotonic clock [s]; minus infinity: never."""

    def within(self, timeout_s: float, now_s: float) -> T | None:
        """The value if it is at most `timeout_s` old at `now_s` [s, monotonic]; None: it is too old, or never came."""
        return self._value if self.age_s(now_s) <= timeout_s else None

    def age_s(self, now_s: float) -> float:
        """Time since it was received [s]; infinite when nothing was received."""
        return now_s - self.received_at_s

    @property
    def never(self) -> bool:
        """Nothing was received yet."""
        return self.received_at_s == -math.inf


NEVER: Final[Received[Any]] = Received(None, -math.inf)
"""Nothing was received yet."""
