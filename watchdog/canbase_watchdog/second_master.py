"""Signs of a second master. CAN frames carry no sender: only what one driver alone cannot have sent shows another.

Signs, each while a drive that it concerns is enabled or at any time where that does not matter
1. two different setpoints for one axis in one period, or a SYNC off the beat without any setpoint before it: three
   times in 1 s. Frames that get lost look otherwise: where a SYNC is missing the last one is two periods old, and a
   SYNC whose setpoints are missing keeps the beat;
2. more SYNCs or driver's heartbeats than half as many again as configured; more heartbeats of the watchdog's node, or
   answers to node guarding, than its own: by them somebody else could keep a drive alive when this computer fails.
   Counted over a window that is long against any burst: a loaded machine delivers late, yet not more;
3. once: an NMT command to an enabled drive, a quick stop PDO, or an SDO that writes any of its objects, but "disable
   voltage". No list of the objects by which a drive stops, brakes or measures would be complete.
   The driver does none of them there. The watchdog does, but only after a trip, when signs are not looked for.

A gateway or bridge that sends frames again gives the signs of 2, and of 1 the SYNCs: each Sign has whether copies of
frames came, which `copies.py` finds.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from canbase_config.watchdog import WatchdogConfig
from canbase_watchdog.copies import SentAgain

DISORDER_COUNT, DISORDER_S = 3, 1.0
SYNC_LOST, OFF_BEAT = 1.5, 0.75
"""Periods since the last SYNC: after more, one was lost; a SYNC after less is another one than the driver's."""
EXCESS = 1.5
SYNC_WINDOW_S = 0.5
HEARTBEAT_PERIODS = 10
OWN_HEARTBEATS, OWN_HEARTBEAT_TIMEOUTS = 3, 2.5
"""So many heartbeats of this watchdog's node in so many times that a drive allows without one: where own frames do not
come back, none is its own."""
GUARD_PERIODS, GUARD_EXCESS = 60, 1.15
"""Requests that keep a drive alive add a quarter to its answers. Over this window a burst of late ones is less."""

NOT_OURS = "heartbeats 77Eh that this watchdog has not sent; a device with its node id, 126, needs another one"


@dataclass(frozen=True, slots=True)
class Sign:
    """The last sign of another master: when [s], about which node (0: all), and what it was."""

    at: float
    node_id: int
    detail: str
    copied: bool | None = None
    """Whether frames are likelier to be sent again; None: frames that are sent again give no such sign."""


class Pace:
    """Fires when `count` events have come within `window_s`."""

    def __init__(self, count: int, window_s: float) -> None:
        """`count` is 2 or more."""
        self._times: deque[float] = deque(maxlen=count)
        self._window_s = window_s

    def too_fast(self, now_s: float) -> bool:
        """Note an event at the monotonic time `now_s` [s]. True: it and the last ones were too many."""
        times = self._times
        times.append(now_s)
        return len(times) == times.maxlen and now_s - times[0] < self._window_s


def guard_pace(config: WatchdogConfig) -> Pace:
    """Fires when a drive answers more node guarding requests than this watchdog sends."""
    return Pace(math.ceil(GUARD_EXCESS * GUARD_PERIODS) + 1, GUARD_PERIODS * config.guard_period_s)


class Foreign:
    """Remembers the last sign of another master."""

    def __init__(self, config: WatchdogConfig, *, loopback: bool = True) -> None:
        """Knows from `config` how often the driver sends what. `loopback`: this watchdog receives its own frames."""
        period_s = config.heartbeat_period_s
        too_many = math.ceil(EXCESS * HEARTBEAT_PERIODS) + 1, HEARTBEAT_PERIODS * period_s
        self._own_heartbeats = (
            Pace(*too_many) if loopback else Pace(OWN_HEARTBEATS, OWN_HEARTBEAT_TIMEOUTS * config.drive_heartbeat_s)
        )
        self._syncs = Pace(math.ceil(EXCESS * SYNC_WINDOW_S * config.control_hz) + 1, SYNC_WINDOW_S)
        self._heartbeats = Pace(*too_many)
        self._disorder = Pace(DISORDER_COUNT, DISORDER_S)
        self._control_hz, self._period_s = config.control_hz, period_s
        self._lost_s, self._off_beat_s = SYNC_LOST / config.control_hz, OFF_BEAT / config.control_hz
        self._sync_at = math.inf
        self._copies = SentAgain(loopback=loopback)
        self._setpoints: dict[int, bytes] = {}
        """COB-ID and data of the setpoints since the last SYNC."""
        self.last: Sign | None = None

    def on_setpoint(self, cob_id: int, node_id: int, data: bytes, now_s: float) -> None:
        """An RPDO of the driver, or of somebody else."""
        self._copies.on_setpoint(cob_id, data, now_s)
        other = self._setpoints.setdefault(cob_id, data)
        if other != data:
            self._setpoints[cob_id] = data
            if now_s - self._sync_at < self._lost_s and self._disorder.too_fast(now_s):
                self.note(node_id, f"two different setpoints {cob_id:03X}h between two SYNCs", now_s)

    def on_sync(self, now_s: float) -> None:
        """A SYNC of the driver, or of somebody else."""
        self._copies.on_sync(now_s)
        off_beat = now_s - self._sync_at < self._off_beat_s
        if not self._setpoints and off_beat and self._disorder.too_fast(now_s):
            self.note_too_many(0, "SYNCs without setpoints", now_s)
        self._setpoints.clear()
        self._sync_at = now_s
        if self._syncs.too_fast(now_s):
            self.note_too_many(0, f"more SYNCs than the driver's {self._control_hz:g} per second", now_s)

    def on_heartbeat(self, now_s: float) -> None:
        """A heartbeat of the driver's node, or of another one that uses its number."""
        if self._heartbeats.too_fast(now_s):
            self.note_too_many(0, f"more heartbeats 77Fh than one each {self._period_s:.3f} s", now_s)

    def on_watchdog_heartbeat(self, now_s: float) -> None:
        """A heartbeat of this watchdog's own node that was received."""
        self._copies.on_own(now_s)
        if self._own_heartbeats.too_fast(now_s):
            self.note_too_many(0, NOT_OURS, now_s)

    def note(self, node_id: int, detail: str, now_s: float) -> None:
        """A sign of which once is enough."""
        self.last = Sign(now_s, node_id, detail)

    def note_too_many(self, node_id: int, detail: str, now_s: float) -> None:
        """A sign that frames which are sent again give as well."""
        self.last = Sign(now_s, node_id, detail, self._copies.is_likely(now_s))
