"""How long a guest is waited for on this computer, whatever it does inside. Pure: time comes in."""

from __future__ import annotations

import os
from typing import Final

LIMIT_S: Final = float(os.environ.get("VM_LIMIT_S", "1800"))
"""From its start to its end."""
SILENT_LIMIT_S: Final = 420.0
"""Without a word. A guest boots in about 80 s, and tells where each scenario begins and ends; one second of its time
takes at most about 5 s where it has a processor for itself."""


class Patience:
    """With one guest, by how much it has said."""

    def __init__(self, now_s: float) -> None:
        """`now_s`: monotonic, as all times here; the guest starts."""
        self._begun_s = self._spoke_s = now_s
        self._said = 0

    def over(self, said: int, now_s: float) -> str:
        """Why it is not waited for any longer; empty: it is. `said`: bytes so far."""
        if said != self._said:
            self._said, self._spoke_s = said, now_s
        if now_s - self._begun_s > LIMIT_S:
            return f"not through after {LIMIT_S:.0f} s on this computer"
        if now_s - self._spoke_s > SILENT_LIMIT_S:
            return f"silent for {SILENT_LIMIT_S:.0f} s on this computer"
        return ""
