"""A receive PDO at work: setpoints into the dictionary, at once or with the next SYNC, with deadline (CiA 301, PDO)."""

from __future__ import annotations

import struct
from collections.abc import Callable
from math import inf

from canopen import SdoAbortedError

from canbase_sim.cia301 import emcy
from canbase_sim.cia301.dictionary import Dictionary
from canbase_sim.cia301.pdo_rules import COB_ID, EVENT, MAX_SYNC_TYPE, TYPE, PdoRules

COMMUNICATION, MAPPING = 0x1400, 0x1600
"""First indexes of the RPDO parameters."""


class Rpdo:
    """RPDO `number` (1 to 4). `on_deadline` is called when its event timer 1400h:5 runs out."""

    def __init__(
        self,
        number: int,
        dictionary: Dictionary,
        errors: emcy.EmcyService,
        operational: Callable[[], bool],
        on_deadline: Callable[[], None],
    ) -> None:
        self.number = number
        self.takes_every = 1
        """A fault of the receiver: it takes every n-th frame only, 0: none."""
        self._came = 0
        self.received_at = -inf
        self._dictionary, self._errors, self._on_deadline = dictionary, errors, on_deadline
        self._rules = PdoRules(dictionary, COMMUNICATION + number - 1, MAPPING + number - 1, True, operational)
        self.stop()

    def stop(self) -> None:
        """Outside of NMT OPERATIONAL no RPDO is received, none waits for a SYNC and no deadline runs."""
        self.cob_id: int | None = None
        self._waiting: bytes | None = None
        self._deadline: float | None = None

    def start(self) -> None:
        """Take over the parameters as they are now, on entering NMT OPERATIONAL."""
        self.stop()
        if not self._rules.valid:
            return
        try:
            mapped = self._rules.mapped()
        except SdoAbortedError:  # somebody starts the node in the middle of a mapping
            return
        self._codec = struct.Struct("<" + "".join(m.code for m in mapped))
        self._writers = [_skip if m.address is None else self._dictionary.writer(m.address) for m in mapped]
        self._at_sync = self._rules.value(TYPE) <= MAX_SYNC_TYPE
        self._timeout = self._rules.value(EVENT) / 1000.0
        self.cob_id = self._rules.value(COB_ID) & 0x7FF

    def receive(self, data: bytes, now_s: float) -> None:
        """A frame with this PDO's COB-ID. Too short: dropped, 8210h; too long: the first bytes count, 8220h."""
        self._came += 1
        if not self.takes_every or self._came % self.takes_every:
            return
        self.received_at = now_s
        length = self._codec.size
        if len(data) != length and not self._usable(len(data), length):
            return
        if len(data) == length:
            self._errors.clear_error(emcy.PDO_TOO_SHORT, self.number)
            self._errors.clear_error(emcy.PDO_TOO_LONG, self.number)
        if self._timeout:
            self._deadline = now_s + self._timeout
            self._errors.clear_error(emcy.RPDO_TIMEOUT, self.number)
        if self._at_sync:
            self._waiting = data
        else:
            self._apply(data)

    def on_sync(self) -> None:
        """A synchronous PDO takes effect with the SYNC after it came; only the last one before it."""
        if self._waiting is not None:
            data, self._waiting = self._waiting, None
            self._apply(data)

    def tick(self, now_s: float) -> None:
        """Find the deadline missed; it runs from the first RPDO on."""
        if self._deadline is not None and now_s > self._deadline:
            self._deadline = None
            self._errors.raise_error(emcy.RPDO_TIMEOUT, self.number)
            self._on_deadline()

    def _usable(self, given: int, mapped: int) -> bool:
        self._errors.raise_error(emcy.PDO_TOO_SHORT if given < mapped else emcy.PDO_TOO_LONG, self.number)
        return given > mapped

    def _apply(self, data: bytes) -> None:
        values = self._codec.unpack_from(data)
        for at, write in enumerate(self._writers):
            try:  # noqa: SIM105 - it costs nothing
                write(values[at])
            except SdoAbortedError:  # the object does not take it; an RPDO has no answer
                pass


def _skip(value: int) -> None:
    """A dummy entry: its bytes are ignored."""
