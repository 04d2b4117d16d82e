"""A node's end of the bus: what leaves it, and what can be wrong with its CAN controller and its cable. Pure."""

from __future__ import annotations

from collections import deque

from canbase_sim.frame import Frame

ALIAS = 1 << 11
"""Lowest bit of a 29-bit identifier that an eleven-bit one does not have."""
SHORT_EMCY = 3
"""Bytes of an emergency message from a drive that leaves the manufacturer's out: code and 1001h."""


class Line:
    """Frames wait here until the node's `tick`. Faults are plain switches."""

    def __init__(self, answer_delay_s: float) -> None:
        """`answer_delay_s`: from an SDO request to its answer."""
        self.silent = False
        """Sends nothing."""
        self.deaf = False
        """Receives nothing."""
        self.cut = False
        """Both."""
        self.mute_boot = False
        """Its boot-up messages are lost."""
        self.short_emcy = False
        """Its emergency messages have three bytes."""
        self.answers_requests = True
        """False: neither its controller nor its adapter passes remote frames."""
        self.aliases = False
        """Beside each frame there is one of 29 bits whose lower eleven are the same, with all its bytes turned over."""
        self._answer_delay_s = answer_delay_s
        self._out: list[Frame] = []
        self._answers: deque[tuple[float, Frame]] = deque()

    @property
    def hears(self) -> bool:
        """Whether frames reach the node."""
        return not (self.cut or self.deaf)

    def say(self, frame: Frame) -> None:
        """Send it with the next `tick`."""
        if self.silent or self.cut:
            return
        self._out.append(frame)
        if self.aliases:
            turned = bytes(byte ^ 0xFF for byte in frame.data)
            self._out.append(Frame(ALIAS | frame.cob_id, turned, extended=True))

    def say_emcy(self, frame: Frame) -> None:
        """An emergency message."""
        self.say(Frame(frame.cob_id, frame.data[:SHORT_EMCY]) if self.short_emcy else frame)

    def say_boot_up(self, frame: Frame) -> None:
        """A boot-up message."""
        if not self.mute_boot:
            self.say(frame)

    def answer(self, frame: Frame, now_s: float) -> None:
        """An SDO answer, after the time that the drive takes for it."""
        if self._answer_delay_s:
            self._answers.append((now_s + self._answer_delay_s, frame))
        else:
            self.say(frame)

    def say_late_answers(self, now_s: float) -> None:
        """Those whose time has come."""
        while self._answers and now_s >= self._answers[0][0]:
            self.say(self._answers.popleft()[1])

    def take_out(self) -> list[Frame]:
        """Every frame since the last call, in order."""
        if not self._out:
            return []
        sent, self._out = self._out, []
        return sent

    def forget(self) -> None:
        """What waits is never sent."""
        self._out.clear()
        self._answers.clear()

    def heal(self) -> None:
        """Nothing is wrong any more."""
        self.silent = self.deaf = self.cut = self.mute_boot = self.short_emcy = self.aliases = False
        self.answers_requests = True
