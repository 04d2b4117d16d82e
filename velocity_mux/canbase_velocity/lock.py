"""One lock of the mux: a Bool that holds sources back, and whose timeout does too where it is required."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from canbase_config.mux import MuxLock
from canbase_runtime.received import NEVER, Received
from canbase_runtime.source_standing import LockStanding


def crowd(topic: str, nodes: Sequence[str]) -> str:
    """What more than one publisher on a topic means for its source or lock; empty: there is one, or none."""
    if len(nodes) < 2:
        return ""
    return (
        f"{len(nodes)} publishers on {topic} ({', '.join(sorted(nodes)[:3])}): give each a topic and a key of its own"
    )


@dataclass(frozen=True, slots=True)
class LockView:
    """One lock at one moment. `age_s` is infinite before its first message; `reason` is empty when it does not hold."""

    name: str
    topic: str
    priority: int
    standing: LockStanding
    required: bool
    age_s: float
    timeout_s: float
    reason: str

    @property
    def holds(self) -> bool:
        """It holds back the sources below it."""
        return self.standing is not LockStanding.FREE


class Lock:
    """A configured lock and its last word, which holds until the next one, however old it is."""

    def __init__(self, name: str, config: MuxLock) -> None:
        self.name = name
        self.config = config
        self._word: Received[bool] = NEVER
        self._crowd = ""

    def published_by(self, nodes: Sequence[str]) -> None:
        """Takes the publishers on its topic. It holds while there is more than one: a message's sender is unknown."""
        self._crowd = crowd(self.config.topic, nodes)

    def hear(self, locked: bool, now_s: float) -> None:
        """Takes its word: true = locked."""
        self._word = Received(locked, now_s)

    def standing(self, now_s: float) -> LockStanding:
        """Whether it holds at time `now_s` [s, monotonic], and for what."""
        if self._word.within(math.inf, now_s):
            return LockStanding.LOCKED
        if self._crowd:
            return LockStanding.SHARED
        if not self.config.required:
            return LockStanding.FREE
        if self._word.never:
            return LockStanding.NEVER_RECEIVED
        return LockStanding.SILENT if self._word.within(self.config.timeout_s, now_s) is None else LockStanding.FREE

    def holds(self, now_s: float) -> bool:
        """It holds back the sources below it at time `now_s` [s, monotonic]."""
        return self.standing(now_s) is not LockStanding.FREE

    def reason(self, now_s: float) -> str:
        """Why it holds, with the values; empty: it does not."""
        standing = self.standing(now_s)
        if standing is LockStanding.FREE:
            return ""
        age_s, timeout_s = self._word.age_s(now_s), self.config.timeout_s
        return {
            LockStanding.LOCKED: "holds",
            LockStanding.SHARED: f"has {self._crowd}",
            LockStanding.NEVER_RECEIVED: f"has published nothing yet on {self.config.topic}",
            LockStanding.SILENT: f"has published nothing for {age_s:.2f} s (timeout {timeout_s:.2f} s)",
        }[standing]

    def view(self, now_s: float) -> LockView:
        """Its entry in the report."""
        return LockView(
            name=self.name,
            topic=self.config.topic,
            priority=self.config.priority,
            standing=self.standing(now_s),
            required=self.config.required,
            age_s=self._word.age_s(now_s),
            timeout_s=self.config.timeout_s,
            reason=self.reason(now_s),
        )
