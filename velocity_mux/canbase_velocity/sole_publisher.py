"""Whether exactly one scanner publishes on a topic of scans.

Two with one frame_id take turns: each shows as free what only the other sees, and one that dies is hidden by the other.
A message does not contain its publisher, so the ROS graph is what is left.

Rules:
1. While more than one publisher is in the graph, no scan of the topic counts. A killed driver stays there until
   DDS gives it up, about 20 s: its successor waits that long.
2. The same two for LATCHED_S: they are two scanners. From then on no scan counts until the next start: one that is
   left alone does not see what the other one saw. A driver that is started again and again is none of that: each of its
   publishers is there together with another one for as long as DDS keeps the dead one, and no longer.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

LATCHED_S: Final = 30.0
"""Longer than DDS keeps a publisher that is gone [s]."""


class SolePublisher:
    """Follows the publishers of one topic."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._latched = False
        self.problem = ""
        """Why no scan counts; empty: there is no reason."""

    def check_publishers(self, nodes: Sequence[str], keys: Sequence[str], now_s: float) -> None:
        """Takes the publishers there at `now_s` [s, monotonic]: of each one its node's name, and what distinguishes it
        from a later one of the same name."""
        if self._latched:
            return
        self._since = {key: self._since.get(key, now_s) for key in keys}
        if len(keys) < 2:
            self.problem = ""
            return
        self._latched = now_s - sorted(self._since[key] for key in keys)[1] >= LATCHED_S
        until = "until the next start of canbase serve velocity" if self._latched else "until one is left"
        named = ", ".join(sorted(nodes)[:3])
        self.problem = f"{len(keys)} publishers ({named}): give each scanner a topic and a key of its own; {until}"
