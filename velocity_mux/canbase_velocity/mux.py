"""Which source drives: sources of commands with priority and timeout, and locks. Time comes in as an argument.

Rules:
1. A source is fresh while its last valid command is not older than its timeout: by local receive time, plus what it
   was late by (delay.py).
2. A lock holds while its last message is true, and, where it is required, after its timeout. It holds back every source
   whose priority is lower than its own. A foreign publisher may hold back too (unexpected_publishers.py).
3. The fresh source of the highest priority that is not held back has the base; its last command holds. Of two with
   one priority (key equal_priorities) it is the first by name.
4. None is left: the order is zero, explicitly. A source that was taken over does not come back with an old
   command: it drives again only while it is fresh by itself.
5. A command with NaN or infinity is refused and counted, and does not make its source fresh.
6. A source that is not armed (neutral.py), or whose commands arrive later than its timeout, is not followed. While it
   publishes it has the base all the same: the order is zero, and no lower source moves the base under the hand of
   the operator of that source.
7. A message does not contain its publisher. Where two publish on the topic of a source that only a zero arms, the zero
   of one would arm the joystick of the other: while the ROS graph has more than one there, it is disarmed. A lock with
   more than one publisher holds: a message of one does not release what another one holds. Nor does the zero of a
   publisher that has ended arm the one that comes after it, such as a joystick node that was started again.
8. The nodes of a planner may share a topic. Those of two namespaces are of two robots, unless `nodes` has their full
   names: their commands would come by turns. While there are such, none is followed, and no absence arms.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from canbase_config.mux import MuxLock, MuxSource
from canbase_runtime.driver_state import DriverState
from canbase_runtime.received import NEVER, Received
from canbase_runtime.source_standing import IGNORED, SourceStanding
from canbase_velocity.base_ready import STATUS_TIMEOUT_S, BaseReady
from canbase_velocity.delay import Delay, Sent
from canbase_velocity.lock import Lock, LockView, crowd
from canbase_velocity.neutral import BLIND_S, Arming
from canbase_velocity.twist import ZERO, Twist
from canbase_velocity.unexpected_publishers import Foreign


@dataclass(frozen=True, slots=True)
class SourceView:
    """One source at one moment.

    `age_s` is infinite before its first valid command, `delay_s` None while nothing is known of it.
    `reason`: why it is not followed; empty when it is. `locked`: a lock holds it back, also without a recent message.
    """

    name: str
    topic: str
    priority: int
    standing: SourceStanding
    age_s: float
    timeout_s: float
    received: int
    refused: int
    reason: str
    armed: bool = False
    locked: bool = False
    delay_s: float | None = None


@dataclass(frozen=True, slots=True)
class MuxDecision:
    """The order to send now, the source that has the base (None: none), and every source and lock by falling priority.

    The source that has the base may not be followed (rule 6): then the order is zero, and its view has the reason.
    """

    active: str | None
    twist: Twist
    sources: tuple[SourceView, ...]
    locks: tuple[LockView, ...] = ()
    foreign: tuple[Foreign, ...] = ()
    foreign_lock: bool = False
    """Whether foreign publishers hold sources back."""
    not_ready: str = ""
    """Why the base cannot move; empty: it can."""

    @property
    def holder(self) -> SourceView | None:
        """The source that has the base."""
        return next((source for source in self.sources if source.name == self.active), None)

    @property
    def sentence(self) -> str:
        """The source that drives, for people."""
        if self.holder is None:
            return "no active source"
        if self.holder.standing in IGNORED:
            return f"{self.active} is not followed: {self.holder.reason}"
        return f"{self.active} drives"

    @property
    def essence(self) -> tuple[object, ...]:
        """What has to differ for the decision to count as changed: ages change all the time."""
        sources = tuple((source.standing, source.armed, source.locked) for source in self.sources)
        return self.active, sources, tuple(lock.holds for lock in self.locks), self.foreign, self.not_ready


NOT_FINITE = "NaN or infinity"
LATE_S = 1.0
"""A source whose commands arrive late for longer needs a zero before it is followed again."""


class _Source:
    """A configured source and what came from it."""

    def __init__(self, name: str, config: MuxSource) -> None:
        self.name = name
        self.config = config
        self.command: Received[Twist] = NEVER
        self.received = 0
        self.refused = 0
        self.refusal = ""
        """Why its newest message was refused, for people; empty: it was not."""
        self.arming = Arming(config.neutral_after_s)
        self.delay_s: float | None = None
        self.crowd = ""
        """Why no zero arms it; empty: one does."""
        self._publishers: frozenset[str] = frozenset()
        self._delay = Delay(config.same_clock)
        self._late_from = math.inf

    def accept_command(self, twist: Twist, received: float, sent: Sent | None, now_s: float) -> None:
        """A finite command."""
        self.received += 1
        self.refusal = ""
        self.command = Received(twist, received)
        self.delay_s = None if sent is None else self._delay.measure(sent)
        if sent is not None and self._delay.set_back:
            self.arming.disarm("a command arrived after a newer one, or the clock of its sender was set back")
        self._late_from = min(self._late_from, now_s) if self.is_late else math.inf
        if now_s - self._late_from > LATE_S:
            self.arming.disarm("its commands arrived late")
        self.arming.command(twist, now_s, on_time=not self.is_late and received == now_s and not self.crowd)

    def published_by(self, nodes: Sequence[str], keys: Sequence[str]) -> None:
        """Takes the publishers on its topic."""
        needs_zero = self.config.neutral_after_s is None
        spaces = {node.rpartition("/")[0] for node in nodes if node and node not in self.config.nodes}
        self.crowd = crowd(self.config.topic, nodes) if needs_zero or len(spaces) > 1 else ""
        before, self._publishers = self._publishers, frozenset(keys)
        if self.crowd:
            self.arming.disarm(self.crowd)
        if needs_zero and before - self._publishers:
            self.arming.disarm(f"a publisher on {self.config.topic} has ended")

    @property
    def why_late(self) -> str:
        """Why its last command came too late to be followed; empty: it did not."""
        return "" if self.delay_s is None else self._delay.why_late(self.delay_s, self.config.timeout_s)

    @property
    def is_late(self) -> bool:
        """Its last command was on the way for longer than it may hold, or is stamped in the future."""
        return bool(self.why_late)

    def fresh(self, now_s: float) -> Twist | None:
        """Its command; None: too old, or none. Also one that was late: somebody publishes there."""
        late_s = 0.0 if self.is_late else max(0.0, self.delay_s or 0.0)
        return self.command.within(self.config.timeout_s - late_s, now_s)

    def is_fresh(self, now_s: float) -> bool:
        return self.fresh(now_s) is not None

    def standing(self) -> tuple[SourceStanding, str]:
        """Of the one that has the base."""
        if self.is_late:
            return SourceStanding.DELAYED, self.why_late
        return (
            (SourceStanding.FOLLOWED, "")
            if self.arming.armed
            else (SourceStanding.UNARMED, self.crowd or self.arming.reason)
        )

    def view(self, now_s: float, standing: SourceStanding, reason: str, locked: bool = False) -> SourceView:
        config = self.config
        return SourceView(
            name=self.name,
            topic=config.topic,
            priority=config.priority,
            standing=standing,
            age_s=self.command.age_s(now_s),
            timeout_s=config.timeout_s,
            received=self.received,
            refused=self.refused,
            reason=reason,
            armed=self.arming.armed,
            locked=locked,
            delay_s=self.delay_s,
        )


class Mux:
    """Decides whose command holds."""

    def __init__(
        self,
        sources: Mapping[str, MuxSource],
        locks: Mapping[str, MuxLock] | None = None,
        *,
        foreign_lock: bool = False,
        status_timeout_s: float = STATUS_TIMEOUT_S,
    ) -> None:
        """Sources and locks by name; of two sources of one priority the first by name comes first. Raises ValueError
        without any source. `foreign_lock`: foreign publishers hold back what they disturb. `status_timeout_s`: how long
        a motor_driver/status counts [s].
        """
        if not sources:
            raise ValueError("the mux needs at least one source, see mux.sources in robot.yaml")
        made = [_Source(name, config) for name, config in sources.items()]
        self._sources = {source.name: source for source in sorted(made, key=lambda s: (-s.config.priority, s.name))}
        lock_list = [Lock(name, config) for name, config in (locks or {}).items()]
        self._locks = {lock.name: lock for lock in sorted(lock_list, key=lambda lock: -lock.config.priority)}
        self._foreign: tuple[Foreign, ...] = ()
        self._foreign_lock = foreign_lock
        self._base = BaseReady(status_timeout_s)
        self._without_scans = ""
        self._looked_at = -math.inf

    def accept_command(
        self, name: str, twist: Twist, received: float, now_s: float | None = None, sent: Sent | None = None
    ) -> bool:
        """Takes the command of source `name`; False: refused, for NaN or infinity. Raises KeyError for another name.

        `received`: when it counts as received, before `now_s` where this process stood still in between
        (receive_time.py); `now_s` None: the same. `sent`: its times; None: it has no stamp.
        """
        now_s = received if now_s is None else now_s
        source = self._sources[name]
        self._advance(now_s)
        if not twist.is_finite:
            self.refuse(name, NOT_FINITE)
            return False
        source.accept_command(twist, received, sent, now_s)
        self._advance(now_s)
        return True

    def refuse(self, name: str, why: str) -> None:
        """Counts a message of source `name` that orders no velocity. `why`: for people. Raises KeyError for another
        name."""
        source = self._sources[name]
        source.refused += 1
        source.refusal = why

    def driver_state(self, now_s: float) -> DriverState:
        """Of the last motor_driver/status; offline at `now_s` [s, monotonic] when that is too old, or never came."""
        return self._base.state(now_s)

    def on_driver(self, state: DriverState, cycles: int, received: float) -> None:
        """Takes a motor_driver/status: its state and its counter of cycles."""
        if self._base.on_driver(state, cycles, received):
            self._arm("motor_driver was restarted", received)

    def on_estop(self, free: bool) -> None:
        """Takes what the safety filter knows of the emergency stop. False: it holds, or waits for a reset or a zero."""
        self._base.on_estop(free)

    def on_scans(self, missing: str) -> None:
        """Takes why the safety filter has been without usable scans for long; empty: it has not."""
        self._without_scans = missing

    def on_lock(self, name: str, locked: bool, now_s: float) -> None:
        """Takes the word of lock `name`. Raises KeyError for another name."""
        self._locks[name].hear(locked, now_s)
        self._advance(now_s)

    def on_publishers(self, topic: str, nodes: Sequence[str], keys: Sequence[str] = ()) -> None:
        """Takes the publishers on this topic of robot.yaml: a node's name for each publisher of the subscribed type,
        and what distinguishes it from a later one of the same name."""
        for source in self._sources.values():
            if source.config.topic == topic:
                source.published_by(nodes, keys or nodes)
        for lock in self._locks.values():
            if lock.config.topic == topic:
                lock.published_by(nodes)

    def on_foreign(self, foreign: Sequence[Foreign]) -> None:
        """Takes all foreign publishers that are there now."""
        self._foreign = tuple(foreign)

    def decide(self, now_s: float) -> MuxDecision:
        """The order at time `now_s` [s, monotonic]."""
        self._advance(now_s)
        held = {name: self._held_back(source, now_s) for name, source in self._sources.items()}
        active = next((s for s in self._sources.values() if s.is_fresh(now_s) and not held[s.name]), None)
        views = tuple(self._view(source, active, held[source.name], now_s) for source in self._sources.values())
        if active is None:
            return MuxDecision(None, ZERO, views, *self._others(now_s))
        followed = active.standing()[0] is SourceStanding.FOLLOWED
        twist = active.fresh(now_s) if followed else None
        return MuxDecision(active.name, twist or ZERO, views, *self._others(now_s))

    def moving(self, now_s: float) -> tuple[str, ...]:
        """Fresh sources that do not order zero, also without the base: a reset is refused while there are any."""
        fresh = ((source.name, source.fresh(now_s)) for source in self._sources.values())
        return tuple(name for name, twist in fresh if twist is not None and not twist.is_zero)

    def shutdown(self, now_s: float) -> MuxDecision:
        """The order while the process ends: zero, whatever the sources order."""
        views = tuple(source.view(now_s, SourceStanding.SHUTDOWN, "shutdown") for source in self._sources.values())
        return MuxDecision(None, ZERO, views, *self._others(now_s))

    def _advance(self, now_s: float) -> None:
        """Time has passed: whom that arms or disarms."""
        if now_s - self._looked_at > BLIND_S:
            for source in self._sources.values():
                source.arming.missed(now_s)
        self._looked_at = now_s
        self._arm(self._base.problem(now_s), now_s)

    def _arm(self, not_ready: str, now_s: float) -> None:
        for source in self._sources.values():
            paused = self._held_back(source, now_s) or self._without_scans
            silent = not source.is_fresh(now_s) and not source.crowd
            source.arming.advance(not_ready, now_s, silent=silent, paused=paused)

    def _others(self, now_s: float) -> tuple[tuple[LockView, ...], tuple[Foreign, ...], bool, str]:
        locks = tuple(lock.view(now_s) for lock in self._locks.values())
        return locks, self._foreign, self._foreign_lock, self._base.problem(now_s)

    def _held_back(self, source: _Source, now_s: float) -> str:
        """By what; empty: by nothing."""
        for lock in self._locks.values():
            if lock.config.priority > source.config.priority and lock.holds(now_s):
                return f"locked: {lock.name} {lock.reason(now_s)}"
        for foreign in self._foreign if self._foreign_lock else ():
            if foreign.disturbs(source.name):
                return f"locked: {foreign.sentence}"
        return ""

    def _view(self, source: _Source, active: _Source | None, held: str, now_s: float) -> SourceView:
        age_s = source.command.age_s(now_s)
        refusal = f"; its newest message was refused: {source.refusal}" if source.refusal else ""
        if source is active:
            return source.view(now_s, *source.standing())
        if held:
            return source.view(now_s, SourceStanding.LOCKED, held, locked=True)
        if source.command.never:
            return source.view(now_s, SourceStanding.NEVER_RECEIVED, f"never received{refusal}")
        if active is None or not source.is_fresh(now_s):
            reason = f"no message for {age_s:.2f} s (timeout {source.config.timeout_s:.2f} s){refusal}"
            return source.view(now_s, SourceStanding.SILENT, reason)
        return source.view(now_s, SourceStanding.LOWER_PRIORITY, f"{active.name} has priority")
