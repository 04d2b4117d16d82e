"""An odd drive's end of the bus: answers that are late, lost or doubled, and TPDOs that come a little after SYNC."""

from __future__ import annotations

from collections import deque
from random import Random

from canbase_sim.frame import Frame
from canbase_sim.line import Line
from canbase_sim.odd.manner import Manner

TPDO1, HEARTBEAT, BOOT_UP = 0x180, 0x700, b"\0"
AGAIN_S = 0.02
"""A second answer comes up to so much after the first [s]: the next request may have been sent."""


class OddLine(Line):
    """`random` decides about each frame."""

    def __init__(self, answer_delay_s: float, manner: Manner, random: Random) -> None:
        super().__init__(answer_delay_s)
        self._manner, self._random = manner, random
        self._late_pdos: deque[tuple[float, Frame]] = deque()
        self._late_others: deque[tuple[float, Frame]] = deque()
        self.now_s = self._boot_up_at = 0.0

    def say(self, frame: Frame) -> None:
        """Send it, twice now and then: a CAN controller repeats a frame whose last bit was disturbed (ISO 11898-1)."""
        is_heartbeat = frame.cob_id >= HEARTBEAT and frame.data != BOOT_UP
        if is_heartbeat and self.now_s < self._boot_up_at + self._manner.heartbeat_late_s:
            return
        if is_heartbeat and self._manner.heartbeat_bits:
            frame = Frame(frame.cob_id, bytes([frame.data[0] | self._manner.heartbeat_bits]))
        if is_heartbeat and self._manner.heartbeat_jitter_s:
            late_s = self._manner.heartbeat_jitter_s * self._random.random()
            self._late_others.append((self.now_s + late_s, frame))
            return
        super().say(frame)
        if self._manner.frames_twice and self._random.random() < self._manner.frames_twice:
            super().say(frame)

    def say_boot_up(self, frame: Frame) -> None:
        """A boot-up message, where it has one."""
        self._boot_up_at = self.now_s
        if self._manner.boot_ups:
            super().say_boot_up(frame)

    def say_pdo(self, frame: Frame) -> None:
        """A TPDO, after its time."""
        if self._manner.tpdo_padding and frame.cob_id & ~0x7F == TPDO1:
            frame = Frame(frame.cob_id, frame.data + bytes(self._manner.tpdo_padding))
        late_s = self._manner.pdo_late_s * self._random.random()
        if not late_s:
            self.say(frame)
            return
        last = self._late_pdos[-1][0] if self._late_pdos else 0.0
        self._late_pdos.append((max(last, self.now_s + late_s), frame))

    def answer(self, frame: Frame, now_s: float) -> None:
        """An SDO answer: late, or never."""
        manner = self._manner
        if manner.answers_lost and self._random.random() < manner.answers_lost:
            return
        if manner.answers_again and self._random.random() < manner.answers_again:
            self._late_others.append((now_s + AGAIN_S * self._random.random(), frame))
        late_s = self._answer_delay_s + manner.answer_jitter_s * self._random.random()
        if not late_s:
            self.say(frame)
            return
        last = self._answers[-1][0] if self._answers else 0.0
        self._answers.append((max(last, now_s + late_s), frame))

    def say_late_answers(self, now_s: float) -> None:
        """And late TPDOs."""
        self.now_s = now_s
        super().say_late_answers(now_s)
        while self._late_pdos and now_s >= self._late_pdos[0][0]:
            self.say(self._late_pdos.popleft()[1])
        while self._late_others and now_s >= self._late_others[0][0]:
            super().say(self._late_others.popleft()[1])

    def forget(self) -> None:
        """What waits is never sent."""
        super().forget()
        self._late_pdos.clear()
        self._late_others.clear()
