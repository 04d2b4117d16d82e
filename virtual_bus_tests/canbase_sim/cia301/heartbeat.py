"""Heartbeat producer 1017h and consumer 1016h (CiA 301, objects 1016h and 1017h). Times: s here, ms in the objects."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from canopen import SdoAbortedError

from canbase_sim.cia301 import abort
from canbase_sim.cia301.dictionary import Dictionary, key
from canbase_sim.cia301.nmt import NmtState

COB_ID = 0x700
"""Heartbeat and boot-up: 700h + node id, one byte."""
PERIOD = key(0x1017)
ROUNDING_S = 1e-6
"""More than a sum of two times can be rounded by."""


class HeartbeatProducer:
    """Computes when the next heartbeat is due; the node sends it."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._values = dictionary.values
        self._due: float | None = None
        dictionary.on_write(0x1017, lambda subindex, value: self.restart())

    def restart(self) -> None:
        """The next heartbeat is due at once: after a boot-up, a change of state or of 1017h."""
        self._due = None

    def due(self, now_s: float) -> bool:
        """True once per period of 1017h, late calls do not add up."""
        if self._due is not None and now_s < self._due:
            return False
        period = self._values[PERIOD] / 1000.0
        if period == 0.0:
            return False
        on_time = self._due is not None and now_s < self._due + period
        self._due = (self._due if on_time and self._due is not None else now_s) + period
        return True


class Watch(Enum):
    """What a consumer entry knows of its producer. Monitoring starts with the first heartbeat, not with a boot-up."""

    WAITING = "no heartbeat seen yet"
    ALIVE = "heartbeats come in time"
    LOST = "silent for too long, or restarted"


@dataclass(slots=True)
class Producer:
    """One entry of 1016h."""

    node_id: int
    timeout: float
    watch: Watch = Watch.WAITING
    last: float = 0.0


class HeartbeatConsumer:
    """Watches the producers that 1016h names.

    `on_lost` and `on_alive` are called with the producer's node id on each change.
    """

    def __init__(self, dictionary: Dictionary, on_lost: Callable[[int], None], on_alive: Callable[[int], None]) -> None:
        self._values = dictionary.values
        self._subs = range(1, dictionary.personality.heartbeat_entries + 1)
        self._on_lost, self._on_alive = on_lost, on_alive
        self._producers: dict[int, Producer] = {}
        self._none_before = -math.inf
        """No producer can be missed before: a heartbeat only makes it later."""
        dictionary.guard(0x1016, self._refuse_twins)
        dictionary.on_write(0x1016, lambda subindex, value: self._configure(subindex))

    @property
    def any_lost(self) -> bool:
        """True while a producer is lost."""
        return any(producer.watch is Watch.LOST for producer in self._producers.values())

    def configure(self) -> None:
        """Restart from 1016h."""
        for subindex in self._subs:
            self._configure(subindex)

    def receive(self, node_id: int, data: bytes, now_s: float) -> None:
        """A heartbeat or boot-up of `node_id`; a boot-up of a producer that was alive is a loss: it restarted."""
        producer = next((p for p in self._producers.values() if p.node_id == node_id), None)
        if producer is None or len(data) != 1:
            return
        if data[0] == NmtState.INITIALISING:
            if producer.watch is Watch.ALIVE:
                self._lose(producer)
            return
        producer.last = now_s
        if producer.watch is not Watch.ALIVE:
            self._none_before = -math.inf
        before, producer.watch = producer.watch, Watch.ALIVE
        if before is Watch.LOST:
            self._on_alive(node_id)

    def tick(self, now_s: float) -> None:
        """Find the producers whose last heartbeat is older than their time."""
        if now_s < self._none_before:
            return
        for producer in self._producers.values():
            if producer.watch is Watch.ALIVE and now_s - producer.last > producer.timeout:
                self._lose(producer)
        alive = (p.last + p.timeout for p in self._producers.values() if p.watch is Watch.ALIVE)
        self._none_before = min(alive, default=math.inf) - ROUNDING_S

    def _lose(self, producer: Producer) -> None:
        producer.watch = Watch.LOST
        self._on_lost(producer.node_id)

    def _configure(self, subindex: int) -> None:
        before = self._producers.pop(subindex, None)
        if before is not None and before.watch is Watch.LOST:
            self._on_alive(before.node_id)
        node_id, milliseconds = _split(self._values[key(0x1016, subindex)])
        if node_id:
            self._producers[subindex] = Producer(node_id, milliseconds / 1000.0)

    def _refuse_twins(self, subindex: int, value: int) -> None:
        node_id, _ = _split(value)
        others = (_split(self._values[key(0x1016, s)])[0] for s in self._subs if s != subindex)
        if node_id and node_id in others:
            raise SdoAbortedError(abort.INCOMPATIBLE)


def _split(entry: int) -> tuple[int, int]:
    """Node id and time in ms of one 1016h entry; (0, 0) for an entry that is not used."""
    node_id, milliseconds = entry >> 16 & 0xFF, entry & 0xFFFF
    used = milliseconds > 0 and 1 <= node_id <= 127 and entry >> 24 == 0
    return (node_id, milliseconds) if used else (0, 0)
