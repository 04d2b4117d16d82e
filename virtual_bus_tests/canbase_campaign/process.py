"""What every process of the world has in common: it lives, hangs, dies and comes back; and the topics between them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from random import Random
from typing import Any

from canbase_campaign.can_bus import Receiver
from canbase_campaign.clock import Clock, ComputerClock, call

REMEMBERED = 40
"""Messages of each topic, for a replay."""
FRAMES_HELD = 2000
"""Frames or datagrams that the system keeps for a process that hangs."""


class Process(Receiver):
    """Receives and ticks while it runs. Hung (SIGSTOP), it finds on its return what the system kept for it."""

    name = ""

    def __init__(self, clock: ComputerClock) -> None:
        self.clock = clock
        self.alive = True
        self._hung_by: set[object] = set()
        self._life = 0
        self._kept: dict[str, deque[tuple[Callable[..., object], tuple[Any, ...]]]] = {}
        self._late: list[Callable[[], None]] = []

    @property
    def running(self) -> bool:
        """Neither dead nor hung."""
        return self.alive and not self._hung_by

    def begin(self) -> None:
        """A new life: make the core again and start the timers."""
        raise NotImplementedError

    def receive(self, channel: str, depth: int, do: Callable[..., object], *arguments: Any) -> None:
        """Something arrives now. A hung process keeps the last `depth` things of each channel."""
        if not self.alive:
            return
        if self._hung_by:
            self._kept.setdefault(channel, deque(maxlen=depth)).append((do, arguments))
        else:
            call(do, arguments)

    def every(self, period_s: float, do: Callable[[], None], phase_s: float = 0.0) -> None:
        """Call `do` on a grid of absolute times as long as this life lasts."""
        self._enter(self._life, self.clock.now_s + phase_s, period_s, do)

    def die(self) -> None:
        """SIGKILL: everything that it knew is gone."""
        self.alive = False
        self._life += 1
        self._hung_by.clear()
        self._kept.clear()
        self._late.clear()

    def end(self) -> None:
        """SIGTERM: an orderly end begins; the process goes on until it is through with it."""
        raise NotImplementedError

    def restart(self) -> None:
        """Start again, if it is dead."""
        if not self.alive:
            self.alive = True
            self.begin()
            if self.clock.is_suspended:
                self.hang("suspend")

    def hang(self, by: object) -> None:
        """Stand still until `go_on` was called for everything that stopped it."""
        if self.alive:
            self._hung_by.add(by)

    def go_on(self, by: object) -> None:
        """`by` does not stop it any more."""
        if by not in self._hung_by:
            return
        self._hung_by.remove(by)
        if not self._hung_by:
            self._catch_up()

    def _catch_up(self) -> None:
        """What was kept comes first, channel by channel, then the timers that are overdue."""
        kept, self._kept = self._kept, {}
        for things in kept.values():
            for do, arguments in things:
                call(do, arguments)
        late, self._late = self._late, []
        for turn in late:
            turn()

    def _enter(self, life: int, due: float, period_s: float, do: Callable[[], None]) -> None:
        def turn() -> None:
            if life != self._life:
                return
            if self._hung_by:
                self._late.append(turn)
                return
            do()
            nonlocal due
            due += period_s
            if due <= self.clock.now_s:  # turns that were missed are not made up for
                due = self.clock.now_s + period_s
            self.clock.at(due, turn)

        self.clock.at(due, turn)


class Topics:
    """Publishers and subscribers: each message takes a little while, another one each time, and may get lost."""

    FASTEST_S = 0.0002
    AGAIN_S = 0.03
    """The second copy of a message comes so much later."""

    def __init__(self, clock: Clock, random: Random, jitter_s: float = 0.0005) -> None:
        self._clock, self._random, self._jitter_s = clock, random, jitter_s
        self._subscribers: dict[str, list[tuple[Process, Callable[[Any], None]]]] = {}
        self._last: dict[str, float] = {}
        self.loss: dict[str, float] = {}
        """Chance by topic that a message does not arrive."""
        self.delay_s: dict[str, float] = {}
        """By topic: so much later a message arrives."""
        self.shuffles_s: dict[str, float] = {}
        """By topic: each message arrives up to so much later, and may overtake others."""
        self.twice: set[str] = set()
        """Topics whose messages arrive a second time."""
        self.beside: dict[str, Callable[[Any], Any]] = {}
        """By topic: what another publisher sends beside each message."""
        self.history: dict[str, deque[Any]] = {}
        """By topic: the last messages."""
        self.watch: Callable[[str, Any], None] | None = None
        """Receives every message with its topic, when it is sent."""
        self.arrivals: dict[str, Callable[[str, Any], None]] = {}
        """By topic: receives each message that is not lost, when it arrives."""

    @property
    def subscribed(self) -> set[str]:
        """Every topic that a process receives."""
        return set(self._subscribers)

    def loses(self, topic: str) -> bool:
        """Whether this message on `topic` gets lost."""
        return self._random.random() < self.loss.get(topic, 0.0)

    def subscribe(self, topic: str, process: Process, do: Callable[[Any], None]) -> None:
        """`process` calls `do` with each message; while it hangs, the newest is kept (a queue of depth 1)."""
        self._subscribers.setdefault(topic, []).append((process, do))

    def publish(self, topic: str, message: Any) -> None:
        """Send a message on its way to every subscriber."""
        if self.watch is not None:
            self.watch(topic, message)
        self.history.setdefault(topic, deque(maxlen=REMEMBERED)).append(message)
        if topic in self.beside:
            self._send(topic, self.beside[topic](message))
        self._send(topic, message)

    def _send(self, topic: str, message: Any) -> None:
        for process, do in self._subscribers.get(topic, ()):
            if self.loses(topic):
                continue
            arrival = self._arrival(topic)
            self._deliver(arrival, process, topic, do, message)
            if topic in self.twice:
                self._deliver(arrival + self.AGAIN_S, process, topic, do, message)

    def _deliver(self, at: float, process: Process, topic: str, do: Callable[[Any], None], message: Any) -> None:
        if topic in self.arrivals:
            self._clock.at(at, self.arrivals[topic], topic, message)
        self._clock.at(at, process.receive, topic, 1, do, message)

    def _arrival(self, topic: str) -> float:
        arrival = self._clock.now_s + self.FASTEST_S + self._random.random() * self._jitter_s
        if topic in self.shuffles_s:
            return arrival + self._random.random() * self.shuffles_s[topic]
        arrival += self.delay_s.get(topic, 0.0)
        self._last[topic] = arrival = max(arrival, self._last.get(topic, 0.0))
        return arrival
