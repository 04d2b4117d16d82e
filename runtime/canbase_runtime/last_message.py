"""The last message of a topic and its age: what a listener may show as the state, and what it may not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

SILENT_S: Final = 1.5
"""A node is shown without a state when its last message is older [s]: its slowest state comes every 0.5 s."""


@dataclass(frozen=True, slots=True)
class LastMessage:
    """The last message of one topic and its age [s] by local receive time. None: nothing was received yet."""

    message: Any = None
    age_s: float | None = None

    @property
    def fresh(self) -> bool:
        """Whether its last message is recent enough to be shown as the state."""
        return self.age_s is not None and self.age_s <= SILENT_S

    @property
    def silence(self) -> str:
        """Why there is no state to show."""
        return "no message yet" if self.age_s is None else f"no message for {self.age_s:.0f} s"


NOT_RECEIVED: Final = LastMessage()
"""No message came yet."""
