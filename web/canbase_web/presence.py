"""Whether somebody looks at a page: a number goes to its browser, which sends it back while it shows the page. Pure.

A connection that is open proves nothing: a browser that hangs, and a cable that is out, leave it open.
"""

from __future__ import annotations

from typing import Final

PROOF_S: Final = 0.8
"""A number that comes back later proves nothing."""
LOST_S: Final = 3.0
"""Without a proof for so long nobody looks: a browser that goes from one page to another needs two seconds at most."""
PERIOD_S: Final = 0.25
SEEN: Final = "if (!document.hidden) emitEvent({event!r}, {number})"
"""What a browser runs for a number."""


class Presence:
    """Numbers out, numbers in. Times are those of time.monotonic."""

    def __init__(self) -> None:
        self._sent: dict[int, float] = {}
        self._number = 0
        self._seen_s = 0.0

    def begin(self, now_s: float) -> None:
        """Somebody was there just now."""
        self._seen_s = now_s

    def number(self, now_s: float) -> int:
        """A number for a browser."""
        self._number += 1
        self._sent = {each: at_s for each, at_s in self._sent.items() if at_s > now_s - PROOF_S} | {self._number: now_s}
        return self._number

    def on_number(self, number: object, now_s: float) -> bool:
        """It came back: whether that is a proof, which it is once and soon."""
        sent_s = self._sent.pop(number, None) if isinstance(number, int) else None
        proves = sent_s is not None and now_s - sent_s <= PROOF_S
        if proves:
            self._seen_s = now_s
        return proves

    def is_lost(self, now_s: float) -> bool:
        """Nobody looks any more."""
        return now_s - self._seen_s > LOST_S
