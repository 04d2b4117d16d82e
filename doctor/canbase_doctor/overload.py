"""Whether this computer is too busy for `canbase doctor` to judge times: then a late message proves nothing.

Reading the system is a few lines at the end; the judgement is pure.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

LATE_S = 0.1
"""Doctor's own turns came so late: whatever it measured may be late by as much, and more."""
LOAD_PER_CORE = 4.0
"""Processes that wait for or use each core, over the last minute (getloadavg(3)); 1 is a busy computer."""


@dataclass(frozen=True, slots=True)
class Overload:
    """What doctor saw of its own computer while it listened. `late_s`: its own latest turn; `load`: per core."""

    late_s: float = 0.0
    load: float = 0.0

    @property
    def sentence(self) -> str:
        """The evidence that times mean nothing now; empty: there is none."""
        if self.late_s <= LATE_S and self.load <= LOAD_PER_CORE:
            return ""
        return (
            f"doctor's own turns were up to {self.late_s:.2f} s late, {self.load:.1f} runnable processes for each core"
        )


def load_per_core() -> float:
    """Of this computer, over the last minute."""
    return os.getloadavg()[0] / (os.cpu_count() or 1)
