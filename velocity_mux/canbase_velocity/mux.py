"""Who may drive: sources of commands with priority and timeout. Time comes in as an argument; ROS is in mux_node.py.

Rules:
1. A source is fresh while its last valid command is not older than its timeout, by local receive time.
2. The fresh source of the highest priority drives; its last command holds.
3. No source is fresh: the order is zero, said explicitly. A source that was taken over does not come back with an old
   command: it drives again only while it is fresh by itself.
4. A command with NaN or infinity is refused and counted, and does not make its source fresh.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

from canbase_config.mux import MuxSource
from canbase_velocity.twist import ZERO, Twist


class Standing(enum.Enum):
    """Why a source drives or does not."""

    ACTIVE = "active"
    NEVER_RECEIVED = "never received"
    SILENT = "silent"
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
    """The order to send now, whose it is (None: nobody's, zero), and every source by falling priority."""

    active: str | None
    twist: Twist
    sources: tuple[SourceView, ...]

    @property
    def standings(self) -> tuple[Standing, ...]:
        """What has to differ for the decision to count as changed (besides `active`): ages change all the time."""
        return tuple(source.standing for source in self.sources)


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

    def __init__(self, sources: Mapping[str, MuxSource]) -> None:
        """Sources by name, no two of one priority (canbase_config refuses that). Raises ValueError without any."""
        if not sources:
            raise ValueError("the mux needs at least one source, see mux.sources in robot.yaml")
        made = [_Source(name, config) for name, config in sources.items()]
        self._sources = {source.name: source for source in sorted(made, key=lambda s: -s.config.priority)}

    def on_command(self, name: str, twist: Twist, now: float) -> bool:
        """Takes the command of source `name`; False: refused, for NaN or infinity. Raises KeyError for another name."""
        source = self._sources[name]
        if not twist.is_finite:
            source.refused += 1
            return False
        source.received += 1
        source.twist, source.at_s = twist, now
        return True

    def decide(self, now: float) -> MuxDecision:
        """The order at time `now` [s, monotonic]."""
        active = next((source for source in self._sources.values() if source.is_fresh(now)), None)
        views = tuple(self._view(source, active, now) for source in self._sources.values())
        if active is None:
            return MuxDecision(None, ZERO, views)
        return MuxDecision(active.name, active.twist, views)

    def shutdown(self, now: float) -> MuxDecision:
        """The order while the process ends: zero, whoever wants to drive."""
        views = tuple(source.view(now, Standing.SHUTDOWN, "shutdown") for source in self._sources.values())
        return MuxDecision(None, ZERO, views)

    def _view(self, source: _Source, active: _Source | None, now: float) -> SourceView:
        age_s = source.age_s(now)
        if source is active:
            return source.view(now, Standing.ACTIVE, "")
        if age_s is None:
            return source.view(now, Standing.NEVER_RECEIVED, "never received")
        if active is None or not source.is_fresh(now):
            reason = f"silent for {age_s:.2f} s (timeout {source.config.timeout_s:.2f} s)"
            return source.view(now, Standing.SILENT, reason)
        return source.view(now, Standing.LOWER_PRIORITY, f"{active.name} has priority")
