"""A CAN bus in memory and virtual time: bit rate, arbitration, and what can go wrong between two of its members.

Each member sends in its own order; among the waiting heads the lowest identifier wins (ISO 11898-1).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

from canbase_campaign.clock import Clock

FRAME_BITS = 50
"""Of a data frame without data and without stuff bits, with the pause after it (11-bit identifier)."""
STUFFED = 1.1
"""Typical growth by stuff bits."""
REMOTE = 0x800
"""Above an identifier: a remote frame, which requests the frame with it. Every data frame goes before it."""
NOTHING = 0x1000
"""No identifier: above all of eleven bits, and above all requests."""
COMPUTER = ("driver", "watchdog")
"""Members that share one adapter."""
UNACKNOWLEDGED = 13
"""Frames that wait in front of a bus without another node: txqueuelen of a CAN interface in Linux (10), and a
controller's three mailboxes (bxCAN). Further ones are refused (ENOBUFS)."""
QUEUE = 100
"""Frames that wait in one member's adapter; further ones are dropped, as a full transmit buffer does."""


def frame_bits(data_bytes: int) -> float:
    """How long a frame occupies the bus, typically [bit times]."""
    return (FRAME_BITS + 8 * data_bytes) * STUFFED


_BITS = tuple(frame_bits(data_bytes) for data_bytes in range(65))


class Receiver:
    """What is connected to the bus. This one ignores all frames."""

    def hear(self, cob_id: int, data: bytes) -> None:
        """A frame of another member."""


@dataclass(slots=True)
class Disturbance:
    """What is wrong on the way of a frame. Chances are per frame and receiver."""

    loss: float = 0.0
    duplication: float = 0.0
    delay_s: float = 0.0
    """Longest delay; each frame draws its own, and none overtakes another on the same way."""
    batch_s: float = 0.0
    """The computer's adapter passes what it has, in both directions, once in this time."""
    blocked: set[tuple[str, str]] = field(default_factory=set)
    """(sender, receiver) that do not reach each other."""

    @property
    def quiet(self) -> bool:
        """Nothing is wrong."""
        return not (self.loss or self.duplication or self.late_s or self.blocked)

    @property
    def late_s(self) -> float:
        """Longest time on the way of a frame, the bus apart."""
        return self.delay_s + self.batch_s

    def arrival(self, sender: str, receiver: str, now_s: float, share: float) -> float:
        """When a frame of now gets there; `share` of the longest delay is its own."""
        at = now_s + share * self.delay_s
        if self.batch_s and (sender in COMPUTER) != (receiver in COMPUTER):
            at = math.ceil(at / self.batch_s) * self.batch_s
        return at


class Member:
    """One node on the bus."""

    def __init__(self, bus: CanBus, name: str, receiver: Receiver) -> None:
        self.name, self.receiver = name, receiver
        self.waiting: deque[tuple[int, bytes]] = deque()
        self.head = NOTHING
        """Identifier of the first one of them."""
        self.others: list[Receiver] = []
        """Where its frames go."""
        self.late_until: dict[str, float] = {}
        self._bus, self._held = bus, False

    def send(self, cob_id: int, data: bytes) -> bool:
        """Put a frame into the transmit buffer. False: it is full."""
        if len(self.waiting) >= (UNACKNOWLEDGED if self._held else QUEUE):
            return False
        if not self.waiting and not self._held:
            self.head = cob_id
        self.waiting.append((cob_id, data))
        self._bus.queued += 1
        self._bus.start()
        return True

    def hold(self, held: bool) -> None:
        """No node acknowledges its frames: its controller repeats the first one, and the others wait behind it."""
        self._held = held
        self.head = NOTHING if held or not self.waiting else self.waiting[0][0]
        self._bus.start()

    def take(self) -> tuple[int, bytes]:
        """The first frame leaves the buffer."""
        frame = self.waiting.popleft()
        self.head = self.waiting[0][0] if self.waiting and not self._held else NOTHING
        return frame


class CanBus:
    """All members receive every frame but their own."""

    def __init__(self, clock: Clock, random: Random, bitrate: int) -> None:
        self.clock, self.random, self.bitrate = clock, random, bitrate
        self.disturbance = Disturbance()
        self.members: list[Member] = []
        self.watch: Callable[[str, int, bytes], None] | None = None
        """Receives every frame with its sender, for a log."""
        self.frames = 0
        self.queued = 0
        """Frames that wait in all members."""
        self._busy = False

    def join(self, name: str, receiver: Receiver) -> Member:
        """A new member."""
        member = Member(self, name, receiver)
        for other in self.members:
            other.others.append(receiver)
        member.others = [other.receiver for other in self.members]
        self.members.append(member)
        return member

    def start(self) -> None:
        """Begin the next frame if the bus is free."""
        if self._busy or not self.queued:
            return
        winner: Member | None = None
        lowest = NOTHING
        for member in self.members:
            if member.head < lowest:
                winner, lowest = member, member.head
        if winner is not None:
            self._busy = True
            self.clock.after(_BITS[len(winner.waiting[0][1])] / self.bitrate, self._end, winner)

    def _end(self, sender: Member) -> None:
        """The last bit is over: everybody has the frame."""
        cob_id, data = sender.take()
        self.queued -= 1
        self.frames += 1
        if self.watch is not None:
            self.watch(sender.name, cob_id, data)
        if self.disturbance.quiet:
            for receiver in sender.others:
                receiver.hear(cob_id, data)
        else:
            for member in self.members:
                if member is not sender:
                    self._disturbed(sender, member, cob_id, data)
        self._busy = False
        self.start()

    def _disturbed(self, sender: Member, member: Member, cob_id: int, data: bytes) -> None:
        trouble, draw = self.disturbance, self.random.random
        if (sender.name, member.name) in trouble.blocked or draw() < trouble.loss:
            return
        if trouble.late_s > 0.0:
            arrival = trouble.arrival(sender.name, member.name, self.clock.now_s, draw())
            arrival = max(arrival, member.late_until.get(sender.name, 0.0))
            member.late_until[sender.name] = arrival
            self.clock.at(arrival, member.receiver.hear, cob_id, data)
        else:
            member.receiver.hear(cob_id, data)
        if draw() < trouble.duplication:
            self.clock.after(FRAME_BITS / self.bitrate, member.receiver.hear, cob_id, data)
