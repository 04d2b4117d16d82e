"""Who may drive: sources of commands with priority and timeout, and locks. Time comes in as an argument.

Rules:
1. A source is fresh while its last valid command is not older than its timeout, by local receive time.
2. A lock holds while its last word is true, and, where it is required, while it is silent. It holds back every source
   whose priority is lower than its own. A foreign publisher may hold back too (foreign.py).
3. The fresh source of the highest priority that is not held back drives; its last command holds.
4. None is left: the order is zero, said explicitly. A source that was taken over does not come back with an old
   command: it drives again only while it is fresh by itself.
5. A command with NaN or infinity is refused and counted, and does not make its source fresh.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from canbase_config.mux import MuxLock, MuxSource
from canbase_velocity.foreign import Foreign
from canbase_velocity.lock import Lock, LockView
from canbase_velocity.twist import ZERO, Twist


class Standing(enum.Enum):
    """Why a source drives or does not."""

    ACTIVE = "active"
    NEVER_RECEIVED = "never received"
    SILENT = "silent"
    LOCKED = "locked"
    LOWER_PRIORITY = "lower priority"
    SHUTDOWN = "shutdown"


@dataclass(frozen=True, slots=True)
class SourceView:
    """One source at one moment. `age_s` is None before its first valid command; `reason` is empty when it drives."""

    name: str
    topic: str
    priority: int
    standing: Standing
    age_s: float | None
    timeout_s: float
    received: int
    refused: int
    reason: str


@dataclass(frozen=True, slots=True)
class MuxDecision:
    """The order to send now, whose it is (None: nobody's, zero), and every source and lock by falling priority."""

    active: str | None
    twist: Twist
    sources: tuple[SourceView, ...]
    locks: tuple[LockView, ...] = ()
    foreign: tuple[Foreign, ...] = ()
    foreign_lock: bool = False
    """Whether foreign publishers hold sources back."""

    @property
    def essence(self) -> tuple[object, ...]:
        """What has to differ for the decision to count as changed: ages change all the time."""
        standings = tuple(source.standing for source in self.sources)
        return self.active, standings, tuple(lock.holds for lock in self.locks), self.foreign


class _Source:
    """A configured source and what came from it."""

    def __init__(self, name: str, config: MuxSource) -> None:
        self.name = name
        self.config = config
        self.twist = ZERO
        self.at_s: float | None = None
        self.received = 0
        self.refused = 0

    def age_s(self, now: float) -> float | None:
        return None if self.at_s is None else now - self.at_s

    def is_fresh(self, now: float) -> bool:
        age_s = self.age_s(now)
        return age_s is not None and age_s <= self.config.timeout_s

    def view(self, now: float, standing: Standing, reason: str) -> SourceView:
        config = self.config
        return SourceView(
            self.name, config.topic, config.priority, standing, self.age_s(now), config.timeout_s,
            self.received, self.refused, reason,
        )  # fmt: skip


class Mux:
    """Decides whose command holds."""

    def __init__(
        self,
        sources: Mapping[str, MuxSource],
        locks: Mapping[str, MuxLock] | None = None,
        *,
        foreign_lock: bool = False,
    ) -> None:
        """Sources and locks by name, no two sources of one priority (canbase_config refuses that). Raises ValueError
        without any source. `foreign_lock`: foreign publishers hold back what they disturb.
        """
        if not sources:
            raise ValueError("the mux needs at least one source, see mux.sources in robot.yaml")
        made = [_Source(name, config) for name, config in sources.items()]
        self._sources = {source.name: source for source in sorted(made, key=lambda s: -s.config.priority)}
        lock_list = [Lock(name, config) for name, config in (locks or {}).items()]
        self._locks = {lock.name: lock for lock in sorted(lock_list, key=lambda lock: -lock.config.priority)}
        self._foreign: tuple[Foreign, ...] = ()
        self._foreign_lock = foreign_lock

    def on_command(self, name: str, twist: Twist, now: float) -> bool:
        """Takes the command of source `name`; False: refused, for NaN or infinity. Raises KeyError for another name."""
        source = self._sources[name]
        if not twist.is_finite:
            source.refused += 1
            return False
        source.received += 1
        source.twist, source.at_s = twist, now
        return True

    def on_lock(self, name: str, locked: bool, now: float) -> None:
        """Takes the word of lock `name`. Raises KeyError for another name."""
        self._locks[name].hear(locked, now)

    def on_foreign(self, foreign: Sequence[Foreign]) -> None:
        """Takes all foreign publishers that are there now."""
        self._foreign = tuple(foreign)

    def decide(self, now: float) -> MuxDecision:
        """The order at time `now` [s, monotonic]."""
        held = {name: self._held_back(source, now) for name, source in self._sources.items()}
        active = next((s for s in self._sources.values() if s.is_fresh(now) and not held[s.name]), None)
        views = tuple(self._view(source, active, held[source.name], now) for source in self._sources.values())
        name, twist = (active.name, active.twist) if active else (None, ZERO)
        return MuxDecision(name, twist, views, *self._others(now))

    def moving(self, now: float) -> tuple[str, ...]:
        """Fresh sources that do not order zero, whoever drives: a reset is refused while there are any."""
        moving = (source for source in self._sources.values() if source.is_fresh(now) and not source.twist.is_zero)
        return tuple(source.name for source in moving)

    def shutdown(self, now: float) -> MuxDecision:
        """The order while the process ends: zero, whoever wants to drive."""
        views = tuple(source.view(now, Standing.SHUTDOWN, "shutdown") for source in self._sources.values())
        return MuxDecision(None, ZERO, views, *self._others(now))

    def _others(self, now: float) -> tuple[tuple[LockView, ...], tuple[Foreign, ...], bool]:
        return tuple(lock.view(now) for lock in self._locks.values()), self._foreign, self._foreign_lock

    def _held_back(self, source: _Source, now: float) -> str:
        """By what; empty: by nothing."""
        for lock in self._locks.values():
            if lock.config.priority > source.config.priority and (cause := lock.cause(now)):
                return f"locked: {lock.name} {cause}"
        for foreign in self._foreign if self._foreign_lock else ():
            if foreign.disturbs(source.name):
                return f"locked: {foreign.sentence}"
        return ""

    def _view(self, source: _Source, active: _Source | None, held: str, now: float) -> SourceView:
        age_s = source.age_s(now)
        if source is active:
            return source.view(now, Standing.ACTIVE, "")
        if held:
            return source.view(now, Standing.LOCKED, held)
        if age_s is None:
            return source.view(now, Standing.NEVER_RECEIVED, "never received")
        if active is None or not source.is_fresh(now):
            reason = f"silent for {age_s:.2f} s (timeout {source.config.timeout_s:.2f} s)"
            return source.view(now, Standing.SILENT, reason)
        return source.view(now, Standing.LOWER_PRIORITY, f"{active.name} has priority")
