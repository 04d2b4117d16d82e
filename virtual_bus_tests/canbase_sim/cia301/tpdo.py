"""A transmit PDO at work: on SYNC, on change with inhibit time, or by event timer (CiA 301, PDO)."""

from __future__ import annotations

import struct
from collections.abc import Callable

from canopen.sdo.exceptions import SdoAbortedError

from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.pdo_rules import COB_ID, EVENT, INHIBIT, MAX_SYNC_TYPE, TYPE, PdoRules
from canbase_sim.frame import Frame

COMMUNICATION, MAPPING = 0x1800, 0x1A00
"""First indexes of the TPDO parameters."""
ROUNDING_S = 1e-9
"""Times are sums of steps: a timer that is due at a step is due at it, and not at the next one."""
INHIBIT_UNIT = 1e-4
"""1800h:3 counts in 100 µs."""


class Tpdo:
    """TPDO `number` (1 to 4)."""

    def __init__(
        self, number: int, dictionary: Dictionary, send: Callable[[Frame], None], operational: Callable[[], bool]
    ) -> None:
        self._values, self._entries, self._send = dictionary.values, dictionary.entries, send
        self._rules = PdoRules(dictionary, COMMUNICATION + number - 1, MAPPING + number - 1, False, operational)
        self.lost = False
        """A fault of the sender: it is due, and does not get onto the bus."""
        self.stop()

    def stop(self) -> None:
        """Outside of NMT OPERATIONAL no TPDO is sent."""
        self.on_sync_active = self.on_event_active = False

    def start(self) -> None:
        """Take over the parameters as they are now; an event-driven PDO is then sent once (entering OPERATIONAL)."""
        self.stop()
        if not self._rules.valid:
            return
        try:
            mapped = self._rules.mapped()
        except SdoAbortedError:  # somebody starts the node in the middle of a mapping
            return
        self._pack = struct.Struct("<" + "".join(m.code for m in mapped)).pack
        self._places = [self._entries[m.address].place for m in mapped if m.address is not None]
        self._cob_id = self._rules.value(COB_ID) & 0x7FF
        self._type = self._rules.value(TYPE)
        self._inhibit = self._rules.value(INHIBIT) * INHIBIT_UNIT
        self._period = self._rules.value(EVENT) / 1000.0
        self._syncs = 0
        self._last_data: bytes | None = None
        self._last_time = float("-inf")
        self.on_sync_active = self._type <= MAX_SYNC_TYPE
        self.on_event_active = not self.on_sync_active

    def on_sync(self) -> None:
        """Type n: every n-th SYNC; type 0: the SYNC after a change."""
        self._syncs += 1
        if self._syncs < self._type:
            return
        self._syncs = 0
        data = self._mapped()
        if self._type == 0 and data == self._last_data:
            return
        self._last_data = data
        self._say(data)

    def tick(self, now_s: float) -> None:
        """Types 254 and 255: when the data changed, not more often than the inhibit time; and by the event timer."""
        elapsed = now_s - self._last_time + ROUNDING_S
        if elapsed < self._inhibit:
            return
        data = self._mapped()
        timer_is_over = self._period > 0.0 and elapsed >= self._period
        if data != self._last_data or timer_is_over:
            self._last_data, self._last_time = data, now_s
            self._say(data)

    def _mapped(self) -> bytes:
        """What it carries now. Nearly all carry two values; compiled, a star makes a list of them first."""
        values, places = self._values, self._places
        if len(places) == 2:
            return self._pack(values[places[0]], values[places[1]])
        return self._pack(*[values[place] for place in places])

    def _say(self, data: bytes) -> None:
        if not self.lost:
            self._send(Frame(self._cob_id, data))
