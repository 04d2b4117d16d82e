"""Whether exactly one scanner publishes on a topic of scans.

Two with one frame_id take turns: each shows as free what only the other sees, and one that dies is hidden by the other.
A message does not contain its publisher, so the ROS graph is what is left.

Rules:
1. While more than one publisher is in the graph, no scan of the topic counts. A killed driver stays there until
   DDS gives it up, about 20 s: its successor waits that long.
2. More than one for LATCHED_S: they are two scanners. From then on no scan counts until the next start: one that is
   left alone does not see what the other one saw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

LATCHED_S: Final = 30.0
"""Longer than DDS keeps a publisher that is gone [s]."""


class SolePublisher:
    """Follows the publishers of one topic."""

    def __init__(self) -> None:
        self._several_from = math.inf
        self._latched = False
        self.problem = ""
        """Why no scan counts; empty: there is no reason."""

    def look(self, nodes: Sequence[str], now_s: float) -> None:
        """Takes the names of the nodes that publish there at `now_s` [s, monotonic], one for each publisher."""
        if self._latched:
            return
        if len(nodes) < 2:
            self._several_from, self.problem = math.inf, ""
            return
        self._several_from = min(self._several_from, now_s)
        self._latched = now_s - self._several_from >= LATCHED_S
        until = "until the next start of canbase velocity" if self._latched else "until one is left"
        named = ", ".join(sorted(nodes)[:3])
        self.problem = f"{len(nodes)} publishers ({named}): give each scanner a topic and a key of its own; {until}"
