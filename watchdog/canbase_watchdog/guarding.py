"""Node guarding of the drives that send no heartbeat: when each request is due, and which answers count. CiA 301.

The watchdog sends the requests itself, so that a guarded drive stops when this process ends or hangs. An answer counts
when its toggle bit differs from that of the one before: a CAN controller may answer by itself, with an old byte, for a
drive whose firmware hangs.
"""

from __future__ import annotations

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog import frames
from canbase_watchdog.frames import Frame


class GuardRequests:
    """The requests to all guarded drives, one period apart."""

    def __init__(self, config: WatchdogConfig, now_s: float) -> None:
        """The first ones are due at once."""
        nodes = dict.fromkeys(drive.node_id for drive in config.drives if drive.guarded)
        self._requests = [frames.guard_request(node_id) for node_id in nodes]
        self._period_s, self._due = config.guard_period_s, now_s

    def tick(self, now_s: float) -> list[Frame]:
        """Those that are due; what is late is not made up for."""
        if not self._requests or now_s < self._due:
            return []
        on_time = now_s < self._due + self._period_s
        self._due = (self._due if on_time else now_s) + self._period_s
        return self._requests


class GuardAnswers:
    """The answers of one node."""

    def __init__(self) -> None:
        """The first answer counts, whatever its toggle bit: it may have answered a watchdog before this one."""
        self._toggle: int | None = None

    def take_answer(self, data: bytes) -> bytes | None:
        """The heartbeat that the answer stands for; None: it counts as not received."""
        answer = frames.decode_guard_answer(data)
        if answer is None:
            return None
        state, toggle = answer
        if state == frames.BOOT_UP:
            self._toggle = None
            return state
        if toggle == self._toggle:
            return None
        self._toggle = toggle
        return state
