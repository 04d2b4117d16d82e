"""Counts what should happen in every cycle and does not, so that single losses are forgotten and a habit is not."""

from __future__ import annotations

FORGIVEN = 0.5
"""A good cycle takes back so much of a bad one: one bad cycle in two adds up, one in three does not."""


class Tally:
    """Bad cycles, less half of the good ones; never below 0."""

    def __init__(self) -> None:
        """Nothing was bad yet."""
        self.value = 0.0

    def count(self, bad: bool) -> None:
        """One more cycle."""
        if bad:
            self.value += 1.0
        elif self.value:
            self.value = max(0.0, self.value - FORGIVEN)

    def clear(self) -> None:
        """Start again."""
        self.value = 0.0
