"""One lock of the mux: a Bool that holds sources back, and whose silence does too where it is required."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.mux import MuxLock


def crowd(topic: str, nodes: Sequence[str]) -> str:
    """What more than one publisher on a topic means for its source or lock; empty: there is one, or none."""
    if len(nodes) < 2:
        return ""
    return (
        f"{len(nodes)} publishers on {topic} ({', '.join(sorted(nodes)[:3])}): give each a topic and a key of its own"
    )


@dataclass(frozen=True, slots=True)
class LockView:
    """One lock at one moment. `age_s` is None before its first message; `reason` is empty when it does not hold."""

    name: str
    topic: str
    priority: int
    holds: bool
    required: bool
    age_s: float | None
    timeout_s: float
    reason: str


class Lock:
    """A configured lock and its last word, which holds until the next one, however old it is."""

    def __init__(self, name: str, config: MuxLock) -> None:
        self.name = name
        self.config = config
        self._locked = False
        self._at_s: float | None = None
        self._crowd = ""

    def published_by(self, nodes: Sequence[str]) -> None:
        """Takes who publishes on its topic. It holds while there is more than one: which of them spoke is not known."""
        self._crowd = crowd(self.config.topic, nodes)

    def hear(self, locked: bool, now_s: float) -> None:
        """Takes its word: true = locked."""
        self._locked, self._at_s = locked, now_s

    def cause(self, now_s: float) -> str:
        """Why it holds at time `now_s` [s, monotonic]; empty: it does not."""
        if self._locked:
            return "holds"
        if self._crowd:
            return f"has {self._crowd}"
        if not self.config.required:
            return ""
        if self._at_s is None:
            return f"has published nothing yet on {self.config.topic}"
        age_s = now_s - self._at_s
        if age_s <= self.config.timeout_s:
            return ""
        return f"is silent for {age_s:.2f} s (timeout {self.config.timeout_s:.2f} s)"

    def view(self, now_s: float) -> LockView:
        """What is told of it."""
        config, cause = self.config, self.cause(now_s)
        age_s = None if self._at_s is None else now_s - self._at_s
        return LockView(
            self.name, config.topic, config.priority, bool(cause), config.required, age_s, config.timeout_s, cause
        )
