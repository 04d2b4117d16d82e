"""Node guarding as a slave has it: answers with a toggle bit, and life guarding 100Ch, 100Dh (CiA 301, 7.2.8.2.2).

Times: s here, ms in the objects. Where 1017h is not 0 the node produces heartbeats, and guarding is off.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from canbase_sim.cia301.dictionary import Dictionary, key

GUARD_TIME, LIFE_TIME_FACTOR, HEARTBEAT_PERIOD = key(0x100C), key(0x100D), key(0x1017)
TOGGLE = 0x80


class Life(Enum):
    """What a node knows of the master that guards it. Life guarding begins with the first request."""

    UNGUARDED = "no request since the last reset"
    GUARDED = "requests come in time"
    LOST = "no request for the node life time"


class LifeGuarding:
    """Answers requests, and calls `on_lost` once when none has come for 100Ch × 100Dh; `on_alive` when one comes."""

    def __init__(self, dictionary: Dictionary, on_lost: Callable[[], None], on_alive: Callable[[], None]) -> None:
        self._values = dictionary.values
        self._on_lost, self._on_alive = on_lost, on_alive
        self.life = Life.UNGUARDED
        self._toggle = 0
        self._requested_at = 0.0
        self.stuck = False
        """Its CAN controller answers by itself with an old byte: the toggle bit stays."""

    @property
    def life_s(self) -> float:
        """Node life time [s]; 0: no life guarding."""
        return self._values[GUARD_TIME] * self._values[LIFE_TIME_FACTOR] / 1000.0

    def reset(self) -> None:
        """NMT reset communication: the first answer after it has the toggle bit 0, and no master is known."""
        self.life, self._toggle = Life.UNGUARDED, 0

    def answer(self, state: int, now_s: float) -> bytes | None:
        """What a request gets in NMT state `state`; None: nothing, the node produces heartbeats."""
        if self._values[HEARTBEAT_PERIOD]:
            return None
        before, self.life, self._requested_at = self.life, Life.GUARDED, now_s
        if before is Life.LOST:
            self._on_alive()
        answer = bytes([self._toggle | state])
        self._toggle ^= 0 if self.stuck else TOGGLE
        return answer

    def tick(self, now_s: float) -> None:
        """Find a master that is silent for longer than the node life time."""
        if self.life is not Life.GUARDED or self._values[HEARTBEAT_PERIOD]:
            return
        if 0.0 < self.life_s < now_s - self._requested_at:
            self.life = Life.LOST
            self._on_lost()
