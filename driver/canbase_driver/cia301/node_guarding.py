"""CiA 301, node guarding: the request to a node that sends no heartbeat, and which of its answers count."""

from __future__ import annotations

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import HEARTBEAT, NmtState, parse_heartbeat

TOGGLE = 0x80
"""Bit of an answer: it alternates from one answer to the next."""


def guard_request(node_id: int) -> Frame:
    """The remote frame that requests the NMT state of a node, 1…127."""
    return Frame(HEARTBEAT + node_id, remote=True)


def without_toggle(frame: Frame) -> Frame:
    """The heartbeat that an answer to node guarding stands for; any other frame 700h + id as it is."""
    if len(frame.data) != 1 or frame.data[0] == TOGGLE:
        return frame
    return Frame(frame.cob_id, bytes((frame.data[0] & ~TOGGLE,)))


class GuardAnswers:
    """The answers of one node, of whoever sent the requests: in operation that is the watchdog."""

    def __init__(self) -> None:
        """The first answer counts, whatever its toggle bit."""
        self._toggle = -1
        self.alternates = False
        """Two answers in a row had different toggle bits: they are answers, and no heartbeats."""

    def take_answer(self, frame: Frame) -> Frame | None:
        """The heartbeat that an answer stands for, or the boot-up message as it is; None: it counts as not received.

        An answer with the toggle bit of the one before is none: a CAN controller may answer by itself, with an old
        byte, for a drive whose firmware hangs.
        """
        heartbeat = without_toggle(frame)
        parsed = parse_heartbeat(heartbeat)
        if parsed is None or parsed[1] is None:
            return None
        if parsed[1] is NmtState.INITIALISING:
            self._toggle = -1
            return heartbeat
        toggle = frame.data[0] & TOGGLE
        if toggle == self._toggle:
            return None
        self.alternates = self.alternates or self._toggle >= 0
        self._toggle = toggle
        return heartbeat
