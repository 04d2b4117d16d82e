"""Counts what should happen in every cycle and does not, so that single losses are forgotten and a habit is not."""

from __future__ import annotations

FORGIVEN = 0.5
"""A good cycle takes back so much of a bad one: one bad cycle in two adds up, one in three does not."""


class BadCycles:
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

    def balance(self, came: int) -> None:
        """One more cycle, in which `came` frames came where one is due: a second one is bad, and makes up for none.

        A drive that sends by its own timer drifts along the SYNCs: a cycle with two of its frames goes with one
        without. Two drives send two in each.
        """
        if came == 0:
            self.value = max(0.0, self.value - 1.0)
        else:
            self.count(came > 1)

    def clear(self) -> None:
        """Start again."""
        self.value = 0.0
