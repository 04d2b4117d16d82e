"""What a node that is not ready has sent, and what that says about the cause: its wiring, or a drive that still starts.

A message of a node shows that its power, its cable, its node id and the bit rate are right. From power on, or from an
NMT reset, a drive may need many seconds until it answers SDO requests, or refuse all of them: CiA 301 has no limit.
"""

from __future__ import annotations

import math

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.nmt import NmtState
from canbase_driver.cia301.sdo_client import abort_text

FRESH_S = 5.0
"""A message of so long ago at most speaks for the wiring of now [s]: heartbeats come more often, and so do requests."""
STARTING_S = 30.0
"""For so long after its boot-up message, or after the first message that follows a pause, a drive may still start [s].
As long as the longest NMT reset that the boot learns."""
PAUSE_S = 10.0
"""Without a message for longer, what comes then may be a drive that was switched on [s]."""
_ABORT = 0x80
"""Command byte of an SDO abort (CiA 301)."""


class SignsOfLife:
    """The last message of one node, and since when it sends some."""

    def __init__(self) -> None:
        self._at = self._since = -math.inf
        self._what = ""
        self._comes_once = False
        """A drive sends such a message once, at its start or at an error: the next one is not due."""
        self._abort_code = 0

    def on_heartbeat(self, state: NmtState, now_s: float, *, of_reset: bool) -> None:
        """A heartbeat, an answer to node guarding, or a boot-up message. `of_reset`: the driver has caused it."""
        if state is NmtState.INITIALISING:
            self._since = self._since if of_reset else now_s
            self._note("its boot-up message", now_s, once=True)
        else:
            self._note(f"a heartbeat ({state.text})", now_s)

    def on_emcy(self, now_s: float) -> None:
        """An emergency message."""
        self._note("an emergency message", now_s, once=True)

    def on_sdo(self, frame: Frame, now_s: float) -> None:
        """An SDO answer, whoever has requested it."""
        self._note("an SDO answer", now_s)
        self._abort_code = int.from_bytes(frame.data[4:8], "little") if frame.data[:1] == bytes((_ABORT,)) else 0

    def _note(self, what: str, now_s: float, *, once: bool = False) -> None:
        if now_s - self._at > PAUSE_S:
            self._since = now_s
        self._what, self._at, self._comes_once, self._abort_code = what, now_s, once, 0

    def what_to_check(self, now_s: float) -> str:
        """For a node that has answered no request of its boot: what came from it, and what that leaves to look at."""
        age_s = now_s - self._at
        if age_s == math.inf:
            return "no message has come from it: check its power, its cable, its node id and the bit rate"
        if age_s > (STARTING_S if self._comes_once else FRESH_S):
            return f"its last message came {age_s:.0f} s ago ({self._sent}): check its power and its cable"
        sent = f"it sent {self._sent} {age_s:.1f} s ago, so power and cable are right"
        if now_s - self._since <= STARTING_S:
            return f"{sent}: it may still be starting, and the boot goes on by itself"
        return (
            f"{sent}, but it answers no request of the boot: let no other program use its SDO channel "
            f"(canbase bus sdo, "
            "the manufacturer's tool); then switch the drive off and on again"
        )

    def may_be_starting(self, now_s: float) -> str:
        """A sentence, with a space before it, while that may be why it refuses or answers nothing; empty after it."""
        age_s = now_s - self._since
        if age_s > STARTING_S:
            return ""
        return f" Its first message came {age_s:.1f} s ago: it may still be starting, and the boot goes on by itself."

    @property
    def _sent(self) -> str:
        return f"abort {abort_text(self._abort_code)}" if self._abort_code else self._what
