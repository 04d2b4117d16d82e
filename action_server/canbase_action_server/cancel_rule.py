"""Which goals a cancel request means: the rule of action_msgs/srv/CancelGoal, over the goals of every action. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

NO_UUID: Final = "0" * 32


def meant(accepted_ns: Mapping[str, int], uuid: str, stamp_ns: int) -> tuple[str, ...]:
    """UUIDs (hex) of the meant goals. `accepted_ns`: when each open goal was accepted.

    uuid 0 and stamp 0: all. uuid 0 and a stamp: those accepted at or before it. A uuid and stamp 0: that goal. Both:
    that goal, and those accepted at or before the stamp.
    """
    if uuid == NO_UUID and stamp_ns == 0:
        return tuple(accepted_ns)
    return tuple(key for key, at_ns in accepted_ns.items() if key == uuid or at_ns <= stamp_ns)
